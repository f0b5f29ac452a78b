"""Bad scenarios: a PoiseError with what came, what was wanted and what there is, and no tick."""

from dataclasses import replace

import pytest
from dry_run import forbid_ticks, prepare

from poise.apps.scenarios import Scenario, load_scenario, run_scenario
from poise.apps.scenarios._scenario import CheckPlan
from poise.errors import ConfigurationError, PoiseError, UnknownNameError

STACK = """
stack:
  contacts:
    - surface: {frame: left_sole}
    - surface: {frame: right_sole}
  levels:
    - - com
      - frame: {frame: pelvis, axes: orientation, name: pelvis}
    - - frame: {frame: left_hand, axes: position, name: hand}
    - - posture
"""
GOOD = f"name: s\nduration: 1.0\n{STACK}"


def with_stack(old, new):
    assert old in STACK
    return f"name: s\nduration: 1.0\n{STACK.replace(old, new)}"


def motion(text):
    return f"{GOOD}motions:\n  - {{{text}}}\n"


def push(text):
    return f"{GOOD}pushes:\n  - {{{text}}}\n"


def check(text):
    return f"{GOOD}checks:\n  - {{{text}}}\n"


def plant(text):
    return f"{GOOD}plant: {{{text}}}\n"


def top(text):
    return f"{GOOD}{text}\n"


CASES = {
    # What the whole file is.
    "empty": ("", "wrong kind.*None.*keys with values"),
    "a key twice": ("name: a\nname: b\nduration: 1", "not valid YAML.*'name' stands twice.*line 2"),
    "a tag": ("name: !!int x", "not valid YAML.*tag.*not allowed"),
    "no duration": (f"name: s\n{STACK}", "lacks the key 'duration'"),
    "unknown key": (top("pushs: []"), "unknown key.*'pushs'.*choices: pushes"),
    "name that leaves the folder": (GOOD.replace("name: s", "name: ../x"), "name.*'../x'.*letters"),
    "duration with a unit": ("name: s\nduration: 5 s", "duration.*wrong kind.*'5 s'.*number"),
    "duration NaN": ("name: s\nduration: .nan", "duration.*out of range.*nan"),
    "seed half": (top("seed: 1.5"), "seed.*1.5.*whole number"),
    "unknown robot": (top("robot: humanoid34x"), "unknown robot.*'humanoid34x'.*humanoid33"),
    "unknown strategy": (top("controller: {strategy: fast}"), "strategy.*'fast'.*direct"),
    "time limit zero": (top("controller: {time_limit: 0}"), "time_limit.*positive"),
    "unknown key of plant": (plant("frictoin: 1.0"), "unknown key.*'frictoin'.*choices: friction"),
    "control period no multiple": (plant("control_dt: 0.0015"), "multiple of physics_dt.*0.0015"),
    "payload on no frame": (
        plant("payloads: [{frame: left_pocket, mass: 5}]"),
        "unknown frame.*'left_pocket'.*left_hand",
    ),
    "noise negative": (
        plant("sensors: {gyro_noise: -1}"),
        "gyro_noise is out of range; got -1; wanted a number of at least 0",
    ),
    "unknown task kind": (with_stack("- com", "- comm"), "unknown key.*'comm'.*com"),
    "two kinds in one": (with_stack("- com\n", "- {com: {}, posture: {}}\n"), "one kind"),
    "level that is empty": (with_stack("- - posture", "- []"), "level 2.*at least one task"),
    "unknown frame": (with_stack("frame: left_hand", "frame: left_hnad"), "'left_hnad'.*left_hand"),
    "gain negative": (with_stack("- com\n", "- com: {kp: -5}\n"), "kp.*-5.*>= 0"),
    "joint unknown": (
        with_stack("- com\n", "- joints: {joints: [left_kne]}\n"),
        "unknown joint.*'left_kne'.*left_knee",
    ),
    "margin wider than the sole": (
        with_stack("{frame: left_sole}", "{frame: left_sole, margin: 0.2}"),
        "margin.*leaves nothing",
    ),
    "motion of an unknown task": (
        motion("task: hnad, at: 0, over: 1, by: [0, 0, 0]"),
        "unknown task.*'hnad'.*hand",
    ),
    "motion with two goals": (
        motion("task: hand, at: 0, over: 1, by: [0, 0, 0], to: [0, 0, 0]"),
        r"one of.*\['to', 'by'\]",
    ),
    "motion after the end": (
        motion("task: hand, at: 100, over: 1, by: [0, 0, 0]"),
        "outside the run.*100.*duration of 1",
    ),
    "goal of two numbers": (motion("task: hand, at: 0, over: 1, to: [0, 0]"), "to.*3 numbers"),
    "turning a position": (motion("task: hand, at: 0, over: 1, turn: [0, 0, 1]"), "'turn'.*to, by"),
    "touchdown while unloading": (
        top("contacts: [{unload: left_sole, at: 0, touchdown: 5}]"),
        "touchdown goes with load",
    ),
    "push of no time": (
        push("body: torso, at: 0, duration: 0, force: [1, 0, 0]"),
        "duration.*positive",
    ),
    # Checks.
    "unknown metric": (check("metric: com_eror_max, at_most: 1"), "'com_eror_max'.*com_error_max"),
    "check without a bound": (check("metric: com_travel"), "one of these keys.*at_most, at_least"),
    "check on an unknown task": (
        check("metric: task_error_max, task: head, at_most: 1"),
        "'head'.*choices: hand, com, pelvis",
    ),
    "window that is empty": (
        check("metric: com_travel, from: 0.8, until: 0.5, at_most: 1"),
        "empty",
    ),
    "com error without a com task": (
        with_stack("- com\n      - frame", "- frame")
        + "checks:\n  - {metric: com_error_max, at_most: 1}\n",
        "needs a com task",
    ),
}


@pytest.fixture(autouse=True)
def _no_ticks(monkeypatch):
    forbid_ticks(monkeypatch)


def test_the_unspoilt_scenario_gets_to_its_first_tick():
    prepare(GOOD)


@pytest.mark.parametrize("case", CASES)
def test_bad_input_is_refused_before_the_first_tick(case):
    text, message = CASES[case]
    with pytest.raises(PoiseError, match=message) as error:
        prepare(text)
    said = str(error.value)
    assert "\n" not in said
    assert type(error.value) is not PoiseError, "a class that a caller can tell apart"
    told = "; got " in said or "; wanted " in said or "choices" in said
    assert told or "not valid YAML" in said or "lacks the key" in said


def test_a_scenario_that_is_not_there_lists_those_that_are(tmp_path):
    with pytest.raises(UnknownNameError, match=r"'squad'; choices: squat"):
        load_scenario("squad")
    with pytest.raises(UnknownNameError, match="neither a shipped scenario nor a file"):
        load_scenario(tmp_path)


def test_a_file_of_bytes_is_refused(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_bytes(bytes(range(128, 256)))
    with pytest.raises(ConfigurationError, match="not text.*UTF-8"):
        load_scenario(path)


def test_a_scenario_made_in_python_is_checked_too():
    with pytest.raises(ConfigurationError, match="duration"):
        Scenario(name="s", duration=float("nan"))
    late = CheckPlan(metric="com_travel", at_most=1.0, begin=9.0)
    with pytest.raises(ConfigurationError, match="outside the run"):
        Scenario(name="s", duration=5.0, checks=(late,))


@pytest.mark.parametrize(
    ("scenario", "robot", "needs"),
    [
        ("push", "arm6", "two feet; got .*wanted a robot with left_sole, right_sole"),
        ("squat", "arm6", "two feet and two hands; got .*left_hand, right_hand"),
        ("reach_arm", "biped20", "a hand; got .*wanted a robot with hand"),
    ],
)
def test_a_robot_without_the_limbs_of_a_scenario_is_refused_by_what_it_lacks(
    scenario, robot, needs
):
    with pytest.raises(
        ConfigurationError, match=f"scenario '{scenario}' needs a robot with {needs}"
    ):
        run_scenario(replace(load_scenario(scenario), robot=robot))
