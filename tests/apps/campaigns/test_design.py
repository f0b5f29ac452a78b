"""A campaign's file: what its episodes are, and what is refused before anything runs."""

import itertools
import math

import pytest

pytest.importorskip("mujoco")

from poise.apps.campaigns import Design
from poise.apps.campaigns._fields import steps, with_fields
from poise.apps.scenarios import read_scenario
from poise.errors import ConfigurationError, PoiseError

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


def test_a_path_is_written_as_messages_write_it():
    assert steps("pushes[0].velocity_change[1]") == ("pushes", 0, "velocity_change", 1)


def test_fields_are_set_in_a_copy_and_sections_made():
    data = {"controller": "osf", "stack": {"levels": [["posture"]]}, "pushes": [{"force": [1, 2]}]}
    values = {
        "controller.strategy": "fused",
        "stack.levels[0][0].posture.kp": 9.0,
        "pushes[0].force[1]": 5,
        "plant.sensors.gyro_noise": 0.1,
    }
    assert with_fields(data, values) == {
        "controller": {"name": "osf", "strategy": "fused"},
        "stack": {"levels": [[{"posture": {"kp": 9.0}}]]},
        "pushes": [{"force": [1, 5]}],
        "plant": {"sensors": {"gyro_noise": 0.1}},
    }
    assert data["controller"] == "osf"
    assert data["pushes"][0]["force"] == [1, 2]


def test_grids_are_combined_and_the_last_changes_first(design):
    made = design("vary: {plant.friction: [0.4, 0.8], plant.mass_scale: [0.9, 1.0, 1.1]}")
    assert made.count == 6
    points = [tuple(job.values.values()) for job in made.jobs()]
    assert points == list(itertools.product([0.4, 0.8], [0.9, 1.0, 1.1]))


def test_more_episodes_than_points_go_through_the_grid_again_with_other_seeds(design):
    jobs = [*design("episodes: 5\nvary: {plant.friction: [0.4, 0.8]}").jobs()]
    assert [job.values["plant.friction"] for job in jobs] == [0.4, 0.8, 0.4, 0.8, 0.4]
    assert len({job.seed for job in jobs}) == 5


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


def test_a_shipped_scenario_and_fields_set_for_all(design, tmp_path):
    path = tmp_path / "shipped.yaml"
    path.write_text("name: s\nscenario: stand\nset: {robot: biped20, duration: 0.5}\n")
    made = Design.load(path)
    assert made.count == 1
    assert made.job(0).make().duration == 0.5
    assert made.scenario == {**read_scenario("stand")[0], "robot": "biped20", "duration": 0.5}


def test_a_design_can_be_made_of_its_json(design):
    one = design(DRAWN.format(episodes=4))
    content = one.to_json()
    other = Design(content["campaign"], content["scenario"], "a folder")
    assert [job.values for job in other.jobs()] == [job.values for job in one.jobs()]


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


def test_trials_have_the_same_draws_and_their_own_values(design):
    made = design(
        "vary: {plant.friction: {uniform: [0.4, 0.8]}}\n"
        "tune: {figure: com_error_max_m, failure: 1, trials: 3, episodes: 2, "
        "fields: {plant.mass_scale: {uniform: [0.9, 1.1]}}}"
    )
    first, second = made.trial(0, {"plant.mass_scale": 1.0}), made.trial(1, {"plant.mass_scale": 2})
    assert made.count == 6
    assert [job.number for job in (*first, *second)] == [0, 1, 2, 3]
    assert [job.seed for job in first] == [job.seed for job in second]
    assert first[0].values["plant.friction"] == second[0].values["plant.friction"]
    assert second[1].values["plant.mass_scale"] == 2
    assert second[1].labels == {"trial": 1}


TUNE = "figure: com_error_max_m, failure: 1, trials: 3"
BAD = {
    "field that does not exist": (
        "vary: {plant.fricton: [1]}",
        ("campaign.yaml: vary: 'plant.fricton'", "choices: friction"),
    ),
    "section that does not exist": ("vary: {plnt.friction: [1]}", ("choices: plant",)),
    "task's gain that does not exist": (
        'vary: {"stack.levels[0][0].com.kq": [1]}',
        ("choices: kp",),
    ),
    "place that does not exist": ('vary: {"pushes[1].at": [1]}', ("a list of 1", "longer than 1")),
    "a key of a number": ("vary: {duration.x: [1]}", ("duration.x", "got 2.0")),
    "no path": ('vary: {"plant..x": [1]}', ("'plant..x'", "pushes[0]")),
    "value out of range": ("vary: {plant.friction: [1, -1]}", ("got -1",)),
    "bound out of range": ("vary: {plant.friction: {uniform: [-1, 1]}}", ("got -1",)),
    "value of the wrong kind": ("vary: {plant.friction: [high]}", ("'high'", "a positive number")),
    "whole bounds of what is whole": (
        "set: {checks: [{metric: residual_max, level: 1, at_most: 1}]}\n"
        'vary: {"checks[0].level": {uniform: [1, 3]}}',
        ("vary: 'checks[0].level'", "got 2.27", "whole number"),
    ),
    "field that is set does not exist": ("set: {plant.x: 1}", ("choices: ",)),
    "seed": ("vary: {seed: [1, 2]}", ("cannot be varied", "'seed'")),
    "seed for all": ("set: {seed: 7}", ("each episode has one of its own", "got 7", "key seed")),
    "empty grid": ("vary: {plant.friction: []}", ("grid is empty",)),
    "bounds the wrong way round": ("vary: {plant.friction: {uniform: [1, 0.5]}}", ("low < high",)),
    "logarithm of zero": ("vary: {plant.friction: {log_uniform: [0, 1]}}", ("got [0.0, 1.0]",)),
    "two ways to draw": (
        "vary: {plant.friction: {uniform: [0, 1], choice: [1]}}",
        ("one of these keys", "choices: uniform, grid"),
    ),
    "unknown way to draw": ("vary: {plant.friction: {normal: [0, 1]}}", ("choices: ",)),
    "unknown key": ("epsiodes: 4", ("choices: episodes",)),
    "no episodes": ("episodes: 0", ("got 0",)),
    "unknown metric": ("figures: {a: {metric: com}}", ("choices: com_",)),
    "figure by another's name": (
        "figures: {seed: {metric: com_travel}}",
        ("got 'seed'", "another name"),
    ),
    "figure by the name of a residual": (
        "figures: {residual_max_1: {metric: com_travel}}",
        ("got 'residual_max_1'", "another name"),
    ),
    "figure by the name of a check": (
        'figures: {"check: missed ticks": {metric: com_travel}}',
        ("got 'check: missed ticks'", "another name"),
    ),
    "figure by the name of a field that varies": (
        "vary: {plant.friction: [1]}\nfigures: {plant.friction: {metric: com_travel}}",
        ("got 'plant.friction'", "another name"),
    ),
    "figure by the name of a field that is tuned": (
        f"figures: {{plant.friction: {{metric: com_travel}}}}\n"
        f"tune: {{{TUNE}, fields: {{plant.friction: {{choice: [1]}}}}}}",
        ("got 'plant.friction'", "another name"),
    ),
    "tuned figure that is none": (
        f"tune: {{{TUNE.replace('max_m', 'm')}, fields: {{plant.mass_scale: {{choice: [1]}}}}}}",
        ("'com_error_m'", "choices: com_error_max_m"),
    ),
    "tuned over a grid": (
        f"tune: {{{TUNE}, fields: {{plant.mass_scale: [1]}}}}",
        ("choice: [...]",),
    ),
    "tuned field that does not exist": (
        f"tune: {{{TUNE}, fields: {{plant.mass: {{choice: [1]}}}}}}",
        ("tune: fields: 'plant.mass'", "choices: mass_scale"),
    ),
    "start of a field that is not tuned": (
        f"tune: {{{TUNE}, start: {{a: 1}}, fields: {{plant.mass_scale: {{choice: [1]}}}}}}",
        ("got 'a'", "choices: plant.mass_scale"),
    ),
    "start with a value that is no choice": (
        f"tune: {{{TUNE}, start: {{plant.friction: 0.7}}, "
        "fields: {plant.friction: {choice: [0.5, 1.0]}}}",
        ("plant.friction is not tuned over", "got 0.7", "one of [0.5, 1.0]"),
    ),
    "start beyond a bound": (
        f"tune: {{{TUNE}, start: {{plant.friction: 2.0}}, "
        "fields: {plant.friction: {uniform: [0.5, 1.0]}}}",
        ("plant.friction is not tuned over", "got 2.0", "in [0.5, 1.0]"),
    ),
    "start with no number": (
        f"tune: {{{TUNE}, start: {{plant.friction: high}}, "
        "fields: {plant.friction: {log_uniform: [0.5, 1.0]}}}",
        ("got 'high'", "in [0.5, 1.0]"),
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


def test_a_scenario_that_is_not_there_is_refused(tmp_path):
    (tmp_path / "c.yaml").write_text("name: c\nscenario: nowhere.yaml\n")
    with pytest.raises(PoiseError, match="nowhere.yaml"):
        Design.load(tmp_path / "c.yaml")
    with pytest.raises(ConfigurationError, match="No such file"):
        Design.load(tmp_path / "d.yaml")
