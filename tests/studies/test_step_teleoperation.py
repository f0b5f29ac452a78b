"""The study of step teleoperation: its parts in their quick version, against the paper's claims."""

import pytest
from unchecked import run_unchecked

from studies.step_teleoperation import PLAN

for package in ("matplotlib", "mujoco"):
    pytest.importorskip(package)

COMPUTE = """
import json, sys
from importlib import import_module
from studies.plan import StudyOptions
name = sys.argv[1]
section = getattr(import_module(f"studies.step_teleoperation.{name}"), name)
seen = []
result = section(StudyOptions(quick=True), lambda done, total: seen.append((done, total)))
print(json.dumps({
    "failed": [f.name for f in result.findings if not f.ok],
    "names": [f.name for f in result.findings],
    "figures": [f.name for f in result.figures],
    "last": seen[-1],
}))
"""


@pytest.mark.parametrize(
    ("section", "figure"),
    [
        ("cart_table_section", "figure-6"),
        ("obstacle_section", "figure-8"),
        ("lift_section", "figure-10"),
        ("switch_section", "figure-12"),
        ("swing_section", "figure-14-forward"),
    ],
)
def test_every_claim_of_the_paper_holds(section, figure):
    result = run_unchecked(COMPUTE, section)
    assert result["failed"] == []
    assert figure in result["figures"]
    assert len(set(result["names"])) == len(result["names"]) > 0
    assert result["last"][0] == result["last"][1]


def test_parts_have_names_of_their_own():
    names = [part.name for part in PLAN.parts]
    assert len(set(names)) == len(names)
