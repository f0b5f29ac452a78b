"""The study of strangers: which files it takes, and what it says of them."""

import importlib
import re

import pytest

pytest.importorskip("mujoco")

from poise.errors import ConfigurationError
from poise.robots._catalog import find_entry, open_entry
from studies.bad_operator.conditions import DESCRIBED, MIXED
from studies.plan import StudyOptions
from studies.strangers.led_section import led_section
from studies.strangers.tries_section import tries_section


def silent(done, whole):
    """No progress."""


def one_after_another(run, kind, trials, progress, options):
    """As `run_each`, in this process."""
    return {trial: run(trial) for trial in trials}


def test_every_model_below_a_folder_has_a_row_and_failures_their_words(tmp_path):
    text = open_entry(find_entry("biped20"))[0]
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "good.urdf").write_text(text)
    (tmp_path / "footless.urdf").write_text(text.replace('type="revolute"', 'type="prismatic"'))
    (tmp_path / "scene.xml").write_text("<mujoco><worldbody/></mujoco>")
    (tmp_path / "broken.urdf").write_text("<robot")
    (tmp_path / "bare.urdf").write_text(
        re.sub(r"<(box|mesh|cylinder|sphere|capsule)", "<none", text)
    )
    section = tries_section(StudyOptions(quick=True, directory=str(tmp_path)), silent)
    (table,) = section.tables
    rows = {row[0]: row for row in table.rows}
    assert set(rows) == {"bare.urdf", "deep/good.urdf", "footless.urdf"}
    assert rows["deep/good.urdf"][1] == "yes"
    assert rows["bare.urdf"][1] == "no"
    assert "sole" in rows["bare.urdf"][-1] or "face" in rows["bare.urdf"][-1]
    (finding,) = section.findings
    assert finding.name == "models that load"


@pytest.mark.parametrize("section", [tries_section, led_section])
@pytest.mark.parametrize("name", ["nowhere", "."])
def test_a_folder_without_models_is_refused(tmp_path, name, section):
    with pytest.raises(ConfigurationError, match="folder"):
        section(StudyOptions(directory=str(tmp_path / name)), silent)


def test_who_can_be_led_is_and_the_others_say_why_not(tmp_path, monkeypatch):
    led = importlib.import_module("studies.strangers.led_section")
    monkeypatch.setattr(led, "run_each", one_after_another)
    monkeypatch.setattr(led, "_SECONDS", (1.0, 1.0))
    text = open_entry(find_entry("biped20"))[0]
    (tmp_path / "good.urdf").write_text(text)
    bare = re.sub(r"<(box|mesh|cylinder|sphere|capsule)", "<none", text)
    (tmp_path / "bare.urdf").write_text(bare)
    section = led_section(StudyOptions(quick=True, directory=str(tmp_path)), silent)
    rows = {(row[0], row[1]): row for row in section.tables[0].rows}
    assert len(rows) == 4
    for condition in (DESCRIBED, MIXED):
        assert rows["good.urdf", condition][2:4] == ("stood", pytest.approx(1.0))
        assert rows["bare.urdf", condition][2] is None
        assert rows["bare.urdf", condition][-1]
    assert [f.ours for f in section.findings] == [0, 0]
    assert all("1 seeds" in f.name for f in section.findings)
