"""The study of strangers: which files it takes, and what it says of them."""

import re

import pytest

pytest.importorskip("mujoco")

from poise.errors import ConfigurationError
from poise.robots._catalog import find_entry, open_entry
from studies.plan import StudyOptions
from studies.strangers.tries_section import tries_section


def silent(done, whole):
    """No progress."""


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


@pytest.mark.parametrize("name", ["nowhere", "."])
def test_a_folder_without_models_is_refused(tmp_path, name):
    with pytest.raises(ConfigurationError, match="folder"):
        tries_section(StudyOptions(directory=str(tmp_path / name)), silent)
