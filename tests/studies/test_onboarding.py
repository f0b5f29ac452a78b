"""The study of onboarding: which files it takes, and what it says of them."""

import importlib
import os
import re

import pytest

pytest.importorskip("mujoco")

from poise.errors import ConfigurationError, MissingExtraError
from poise.robots._catalog import find_entry, open_entry
from studies.bad_operator.conditions import DESCRIBED, MIXED
from studies.onboarding import tries_section as module
from studies.onboarding.led_section import led_section
from studies.onboarding.listed import LISTED
from studies.onboarding.tries_section import listed_section, others_section
from studies.plan import StudyOptions

HEADER = ("load", "stand", "squat", "reach", "walk", "obstacle")


def silent(done, whole):
    """No progress."""


def one_after_another(run, kind, trials, progress, options):
    """As `run_each`, in this process."""
    return {trial: run(trial) for trial in trials}


@pytest.fixture
def here(monkeypatch):
    monkeypatch.setattr(module, "run_each", one_after_another)


def text_of_a_robot():
    return open_entry(find_entry("biped20"))[0]


def without_shapes():
    return re.sub(r"<(box|mesh|cylinder|sphere|capsule)", "<none", text_of_a_robot())


def rows_of(section):
    """Rows by their first cell, each as a mapping by column."""
    (table,) = section.tables
    return {row[0]: dict(zip(table.columns, row, strict=True)) for row in table.rows}


def put(folder, listed, text):
    path = folder / listed.file
    path.parent.mkdir(parents=True)
    path.write_text(text)
    return path


def test_the_list_names_each_file_once_with_what_it_is_listed_for():
    assert len({model.file for model in LISTED}) == len(LISTED) >= 10
    assert len({model.model for model in LISTED}) == len(LISTED)
    for model in LISTED:
        assert model.path.endswith((".urdf", ".xml", ".xacro"))
        assert model.kind
        assert model.licence
        assert re.fullmatch(r"[\w.-]+/[\w.-]+", model.repository)
        assert model.file == f"{model.repository.replace('/', '+')}/{model.path}"


def test_listed_models_are_tried_in_order_and_missing_ones_are_said(tmp_path, here):
    good, bad = LISTED[:2]
    put(tmp_path, good, text_of_a_robot())
    put(tmp_path, bad, "<robot")
    section = listed_section(StudyOptions(quick=True, directory=str(tmp_path)), silent)
    rows = rows_of(section)
    assert list(rows) == [model.model for model in LISTED]
    assert (rows[good.model]["load"], rows[bad.model]["load"]) == ("yes", "no")
    assert rows[bad.model]["remarks"]
    assert rows[LISTED[2].model]["load"] is None
    assert "missing" in rows[LISTED[2].model]["remarks"]
    count, load = section.findings
    assert (count.ours, count.paper, count.ok) == (2, len(LISTED), False)
    assert (load.name, load.ours) == ("listed models: load", 0.5)


def test_every_other_model_below_a_folder_has_a_row_and_failures_their_words(tmp_path, here):
    text = text_of_a_robot()
    put(tmp_path, LISTED[0], text)
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "good.urdf").write_text(text)
    (tmp_path / "footless.urdf").write_text(text.replace('type="revolute"', 'type="prismatic"'))
    (tmp_path / "scene.xml").write_text("<mujoco><worldbody/></mujoco>")
    (tmp_path / "broken.urdf").write_text("<robot")
    (tmp_path / "bare.urdf").write_text(without_shapes())
    section = others_section(StudyOptions(quick=True, directory=str(tmp_path)), silent)
    rows = rows_of(section)
    assert set(rows) == {"bare.urdf", "deep/good.urdf", "footless.urdf"}
    assert rows["deep/good.urdf"]["load"] == "yes"
    assert rows["bare.urdf"]["load"] == "no"
    assert "sole" in rows["bare.urdf"]["remarks"] or "face" in rows["bare.urdf"]["remarks"]
    (finding,) = section.findings
    assert finding.name == "other models: load"


@pytest.mark.parametrize(
    "error", [MissingExtraError("xacro", "robots", "a xacro file"), ZeroDivisionError("at a mesh")]
)
def test_a_model_that_trips_a_library_fails_alone(tmp_path, here, monkeypatch, error):
    trips, real = tmp_path / "trips.urdf", module.describe

    def describe(path):
        if path == trips:
            raise error
        return real(path)

    monkeypatch.setattr(module, "describe", describe)
    for name in ("trips.urdf", "good.urdf"):
        (tmp_path / name).write_text(text_of_a_robot())
    rows = rows_of(others_section(StudyOptions(quick=True, directory=str(tmp_path)), silent))
    assert (rows["good.urdf"]["load"], rows["trips.urdf"]["load"]) == ("yes", "no")
    assert str(error) in rows["trips.urdf"]["remarks"]


def test_a_simulation_that_cannot_begin_is_a_robot_that_does_not_stand(tmp_path, here, monkeypatch):
    def refuse(robot):
        raise ConfigurationError("no plant", got=robot.name, wanted="one")

    monkeypatch.setattr(module, "try_out", refuse)
    (tmp_path / "good.urdf").write_text(text_of_a_robot())
    section = others_section(StudyOptions(directory=str(tmp_path)), silent)
    row = rows_of(section)["good.urdf"]
    assert [row[thing] for thing in HEADER] == ["yes", "no", None, None, None, None]
    assert "no plant" in row["remarks"]
    ok = {finding.name: finding.ok for finding in section.findings}
    assert ok["other models: load"]
    assert not ok["other models: stand"]
    assert not ok["other models: obstacle"]


def test_a_second_run_tries_changed_files_alone(tmp_path, monkeypatch):
    path = tmp_path / "good.urdf"
    path.write_text(text_of_a_robot())
    (tmp_path / "same.urdf").write_text(text_of_a_robot())
    options = StudyOptions(quick=True, directory=str(tmp_path), folder=tmp_path / "out")
    first = rows_of(others_section(options, silent))
    before = path.stat().st_mtime_ns
    path.write_text(without_shapes())
    os.utime(path, ns=(before + 1, before + 1))
    again = rows_of(others_section(options, silent))
    assert first["good.urdf"]["load"] == "yes"
    assert again["good.urdf"]["load"] == "no"
    assert again["same.urdf"] == first["same.urdf"]


@pytest.mark.parametrize("section", [listed_section, others_section, led_section])
def test_a_folder_that_is_not_there_is_refused(tmp_path, section):
    with pytest.raises(ConfigurationError, match="folder"):
        section(StudyOptions(directory=str(tmp_path / "nowhere")), silent)


def test_nobody_leads_in_a_folder_without_models(tmp_path):
    with pytest.raises(ConfigurationError, match="folder"):
        led_section(StudyOptions(directory=str(tmp_path)), silent)


def test_who_can_be_led_is_and_the_others_say_why_not(tmp_path, monkeypatch):
    led = importlib.import_module("studies.onboarding.led_section")
    monkeypatch.setattr(led, "run_each", one_after_another)
    monkeypatch.setattr(led, "_SECONDS", (1.0, 1.0))
    (tmp_path / "good.urdf").write_text(text_of_a_robot())
    (tmp_path / "bare.urdf").write_text(without_shapes())
    section = led_section(StudyOptions(quick=True, directory=str(tmp_path)), silent)
    rows = {(row[0], row[1]): row for row in section.tables[0].rows}
    assert len(rows) == 4
    for condition in (DESCRIBED, MIXED):
        assert rows["good.urdf", condition][2:4] == ("stood", pytest.approx(1.0))
        assert rows["bare.urdf", condition][2] is None
        assert rows["bare.urdf", condition][-1]
    assert [f.ours for f in section.findings] == [0, 0]
    assert all("1 seeds" in f.name for f in section.findings)
