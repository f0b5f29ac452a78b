"""A campaign's file: what its episodes are, and what is refused before anything runs."""

import itertools
import math

import pytest

pytest.importorskip("mujoco")

from poise.apps.campaigns import Design
from poise.errors import PoiseError

SCENARIO = """
name: small
robot: biped20
controller: osf
duration: 2.0
stack:
  contacts:
    - surface: {frame: left_sole}
    - surface: {frame: right_sole}
  levels:
    - - com: {kp: 40}
    - - posture
pushes:
  - {body: torso, at: 0.5, duration: 0.1, velocity_change: [0.1, 0.0, 0.0]}
"""


@pytest.fixture
def design(tmp_path):
    """A campaign of the small scenario from the rest of its file."""
    (tmp_path / "small.yaml").write_text(SCENARIO)

    def load(text):
        (tmp_path / "campaign.yaml").write_text(f"name: trial\nscenario: small.yaml\n{text}")
        return Design.load(tmp_path / "campaign.yaml")

    return load


def test_grids_are_combined_and_the_last_changes_first(design):
    made = design("vary: {plant.friction: [0.4, 0.8], plant.mass_scale: [0.9, 1.0, 1.1]}")
    assert made.count == 6
    points = [tuple(job.values.values()) for job in made.jobs()]
    assert points == list(itertools.product([0.4, 0.8], [0.9, 1.0, 1.1]))


DRAWN = """
seed: 3
episodes: {episodes}
vary:
  plant.friction: {{uniform: [0.4, 0.8]}}
  plant.sensors.gyro_noise: {{log_uniform: [1.0e-4, 1.0]}}
  controller: {{choice: [osf, whole_body, reduced]}}
  pushes[0].velocity_change[1]: {{uniform: [-0.2, 0.2]}}
"""


def test_what_is_drawn_keeps_to_its_bounds_and_fills_them(design):
    jobs = [*design(DRAWN.format(episodes=300)).jobs()]
    friction = [job.values["plant.friction"] for job in jobs]
    assert 0.4 <= min(friction) < 0.42
    assert 0.78 < max(friction) <= 0.8
    noise = sorted(math.log10(job.values["plant.sensors.gyro_noise"]) for job in jobs)
    assert -4.0 <= noise[0] < -3.8
    assert noise[150] == pytest.approx(-2.0, abs=0.3)
    assert {job.values["controller"] for job in jobs} == {"osf", "whole_body", "reduced"}


def test_an_episode_is_the_same_however_many_there_are(design):
    few, many = design(DRAWN.format(episodes=3)), design(DRAWN.format(episodes=300))
    assert [(j.seed, j.values) for j in few.jobs()] == [
        (j.seed, j.values) for j in itertools.islice(many.jobs(), 3)
    ]


def test_a_job_makes_its_scenario(design):
    job = design(DRAWN.format(episodes=1)).job(0)
    scenario = job.make()
    assert scenario.seed == job.seed
    assert scenario.plant.friction == job.values["plant.friction"]
    assert scenario.controller.name == job.values["controller"]
    assert scenario.pushes[0].velocity_change == (
        0.1,
        job.values["pushes[0].velocity_change[1]"],
        0.0,
    )


def test_the_files_of_all_robots_are_a_part_of_what_a_campaign_is(design, tmp_path):
    one, two, third = (tmp_path / f"{name}.urdf" for name in ("one", "two", "third"))
    for file in (one, two, third):
        file.write_text(f'<robot name="r"><link name="{file.stem}"/></robot>')
    assert design("vary: {robot: [g1, biped20]}").to_json()["robots"] == {}
    text = (
        f"set: {{robot: {one}}}\nvary: {{robot: [g1, {two}]}}\n"
        f"tune: {{{TUNE}, fields: {{robot: {{choice: [g1, {third}]}}}}}}"
    )
    before = design(text).to_json()["robots"]
    assert list(before) == [str(one), str(third), str(two)]
    (tmp_path / "two.poise.yaml").write_text("base: fixed")
    after = design(text).to_json()["robots"]
    assert [file for file in before if before[file] != after[file]] == [str(two)]


TUNE = "figure: com_error_max_m, failure: 1, trials: 3"
BAD = {
    "field that does not exist": (
        "vary: {plant.fricton: [1]}",
        ("campaign.yaml: vary: 'plant.fricton'", "choices: friction"),
    ),
    "place that does not exist": ('vary: {"pushes[1].at": [1]}', ("a list of 1", "longer than 1")),
    "no path": ('vary: {"plant..x": [1]}', ("'plant..x'", "pushes[0]")),
    "value out of range": ("vary: {plant.friction: [1, -1]}", ("got -1",)),
    "seed": ("vary: {seed: [1, 2]}", ("cannot be varied", "'seed'")),
    "bounds the wrong way round": ("vary: {plant.friction: {uniform: [1, 0.5]}}", ("low < high",)),
    "two ways to draw": (
        "vary: {plant.friction: {uniform: [0, 1], choice: [1]}}",
        ("one of these keys", "choices: uniform, grid"),
    ),
    "unknown key": ("epsiodes: 4", ("choices: episodes",)),
    "unknown metric": ("figures: {a: {metric: com}}", ("choices: com_",)),
    "figure by another's name": (
        "figures: {seed: {metric: com_travel}}",
        ("got 'seed'", "another name"),
    ),
    "tuned figure that is none": (
        f"tune: {{{TUNE.replace('max_m', 'm')}, fields: {{plant.mass_scale: {{choice: [1]}}}}}}",
        ("'com_error_m'", "choices: com_error_max_m"),
    ),
    "tuned over a grid": (
        f"tune: {{{TUNE}, fields: {{plant.mass_scale: [1]}}}}",
        ("choice: [...]",),
    ),
    "start beyond a bound": (
        f"tune: {{{TUNE}, start: {{plant.friction: 2.0}}, "
        "fields: {plant.friction: {uniform: [0.5, 1.0]}}}",
        ("plant.friction is not tuned over", "got 2.0", "in [0.5, 1.0]"),
    ),
    "tuning with episodes beside": (
        f"episodes: 3\ntune: {{{TUNE}, fields: {{plant.mass_scale: {{choice: [1]}}}}}}",
        ("tune: episodes",),
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused_with_what_would_be_right(design, case):
    text, words = BAD[case]
    with pytest.raises(PoiseError) as error:
        design(text)
    assert all(word in str(error.value) for word in words), str(error.value)
