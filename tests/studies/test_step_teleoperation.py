"""The study of step teleoperation: its parts in their quick version, against the paper's claims."""

import pytest

from poise.studies import StudyOptions
from poise.studies.step_teleoperation import PLAN
from poise.studies.step_teleoperation.cart_table_section import cart_table_section
from poise.studies.step_teleoperation.lift_section import lift_section
from poise.studies.step_teleoperation.obstacle_section import obstacle_section
from poise.studies.step_teleoperation.swing_section import swing_section
from poise.studies.step_teleoperation.switch_section import switch_section

for package in ("matplotlib", "mujoco"):
    pytest.importorskip(package)


def compute(section):
    seen = []
    result = section(StudyOptions(quick=True), lambda done, total: seen.append((done, total)))
    assert seen[-1][0] == seen[-1][1]
    return result


@pytest.mark.parametrize(
    ("section", "figure"),
    [
        (cart_table_section, "figure-6"),
        (obstacle_section, "figure-8"),
        (lift_section, "figure-10"),
        (switch_section, "figure-12"),
        (swing_section, "figure-14-forward"),
    ],
)
def test_every_claim_of_the_paper_holds(section, figure):
    result = compute(section)
    assert [f for f in result.findings if not f.ok] == []
    assert figure in [f.name for f in result.figures]
    names = [f.name for f in result.findings]
    assert len(set(names)) == len(names)


def test_parts_have_names_of_their_own():
    names = [part.name for part in PLAN.parts]
    assert len(set(names)) == len(names)
