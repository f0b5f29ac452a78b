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
    "a list": ("- a\n- b\n", r"wrong kind.*\['a', 'b'\].*keys"),
    "a text": ("just words", "wrong kind.*'just words'"),
    "not YAML": ("name: [x", "not valid YAML.*line 1"),
    "control characters": ("name: \x07", "not valid YAML.*special characters"),
    "a key twice": ("name: a\nname: b\nduration: 1", "not valid YAML.*'name' stands twice.*line 2"),
    "a key that is a list": ("? [a, b]\n: c", "not valid YAML.*a key is not text"),
    "a key that is a number": (top("1: 2"), "has an unknown key; got 1; choices: name"),
    "a tag": ("name: !!int x", "not valid YAML.*tag.*not allowed"),
    "a date that is none": (top("seed: 2026-13-45"), "not valid YAML.*month"),
    "nested without end": ("[" * 5000, "not valid YAML.*recursion"),
    # The top of the file.
    "no name": (f"duration: 1.0\n{STACK}", "lacks the key 'name'"),
    "no duration": (f"name: s\n{STACK}", "lacks the key 'duration'"),
    "unknown key": (top("pushs: []"), "unknown key.*'pushs'.*choices: pushes"),
    "name that leaves the folder": (GOOD.replace("name: s", "name: ../x"), "name.*'../x'.*letters"),
    "name that is yes": (GOOD.replace("name: s", "name: yes"), "name.*True.*a text"),
    "name that is blank": (GOOD.replace("name: s", 'name: " "'), "name.*wrong kind"),
    "duration with a unit": ("name: s\nduration: 5 s", "duration.*wrong kind.*'5 s'.*number"),
    "duration true": ("name: s\nduration: true", "duration.*wrong kind.*True"),
    "duration zero": ("name: s\nduration: 0", "duration.*out of range.*positive"),
    "duration negative": ("name: s\nduration: -1.0", "duration.*out of range.*-1.0"),
    "duration NaN": ("name: s\nduration: .nan", "duration.*out of range.*nan"),
    "duration infinite": ("name: s\nduration: .inf", "duration.*out of range.*inf"),
    "duration a huge number": (f"name: s\nduration: 1{'0' * 400}", "duration.*out of range"),
    "duration under a tick": ("name: s\nduration: 1e-5", "duration.*1e-05.*one control period"),
    "seed half": (top("seed: 1.5"), "seed.*1.5.*whole number"),
    "seed negative": (top("seed: -1"), "seed.*-1.*at least 0"),
    "seed text": (top("seed: one"), "seed.*'one'"),
    "unknown robot": (top("robot: humanoid34x"), "unknown robot.*'humanoid34x'.*humanoid33"),
    "robot file that is missing": (top("robot: nowhere/robot.urdf"), "nowhere/robot.urdf"),
    "robot a number": (top("robot: 33"), "robot.*wrong kind.*33.*text"),
    "unknown controller": (top("controller: wholebody"), "no such controller.*whole_body"),
    "unknown strategy": (top("controller: {strategy: fast}"), "strategy.*'fast'.*direct"),
    "a formula of the study": (
        top("controller: {name: osf, strategy: original}"),
        "no such strategy of controller osf.*'original'.*fused",
    ),
    "unknown backend": (top("controller: {strategy: cascade, backend: gurobi}"), "'gurobi'.*osqp"),
    "time limit zero": (top("controller: {time_limit: 0}"), "time_limit.*positive"),
    "time limit text": (top("controller: {time_limit: 5 ms}"), "time_limit.*'5 ms'"),
    "controller a number": (top("controller: 3"), "controller.*wrong kind.*3"),
    "unknown key of controller": (
        top("controller: {solver: x}"),
        "unknown key.*'solver'.*strategy",
    ),
    # The plant.
    "plant a list": (top("plant: []"), "plant.*wrong kind"),
    "unknown key of plant": (plant("frictoin: 1.0"), "unknown key.*'frictoin'.*choices: friction"),
    "friction negative": (plant("friction: -0.1"), "friction.*-0.1"),
    "friction a list": (plant("friction: [1.0]"), r"friction.*\[1.0\].*number"),
    "mass scale zero": (
        plant("mass_scale: 0"),
        "mass_scale is out of range; got 0; wanted a positive",
    ),
    "control period no multiple": (plant("control_dt: 0.0015"), "multiple of physics_dt.*0.0015"),
    "physics step too long": (plant("physics_dt: 0.01, control_dt: 0.01"), "contact_time_constant"),
    "slope of one number": (plant("floor_slope: [0.1]"), "floor_slope.*2 numbers"),
    "slope in degrees": (plant("floor_slope: [5.0, 0.0]"), r"floor_slope.*5.0.*to 0.7 \[rad\]"),
    "actuation unknown": (plant("actuation: servo"), "actuation.*'servo'.*torque"),
    "actuation that torques cannot drive": (plant("actuation: velocity"), "'velocity'.*torque"),
    "payload with a unit": (
        plant("payloads: [{frame: left_hand, mass: 5 kg}]"),
        "mass.*'5 kg'.*number",
    ),
    "payload of negative mass": (
        plant("payloads: [{frame: left_hand, mass: -5}]"),
        r"payloads\[0\].mass.*-5.*positive.*\[kg\]",
    ),
    "payload on no frame": (
        plant("payloads: [{frame: left_pocket, mass: 5}]"),
        "unknown frame.*'left_pocket'.*left_hand",
    ),
    "payload without a mass": (
        plant("payloads: [{frame: left_hand}]"),
        r"payloads\[0\] lacks the key 'mass'",
    ),
    "payload far away": (
        plant("payloads: [{frame: left_hand, mass: 1, offset: [0, 1000, 0]}]"),
        r"offset.1.*1000.*to 100 \[m\]",
    ),
    "payloads no list": (plant("payloads: {frame: left_hand}"), "payloads.*wanted a list"),
    "link error on no link": (plant("link_errors: [{link: tail}]"), "unknown link.*'tail'"),
    "noise negative": (
        plant("sensors: {gyro_noise: -1}"),
        "gyro_noise is out of range; got -1; wanted a number of at least 0",
    ),
    "delay no multiple": (plant("sensors: {delay: 0.0005}"), "delay.*multiple of control_dt"),
    # The stack.
    "stack text": ("name: s\nduration: 1\nstack: com", "stack.*wrong kind.*'com'"),
    "unknown key of stack": (top("").replace("  levels:", "  leveles:"), "'leveles'.*levels"),
    "unknown task kind": (with_stack("- com", "- comm"), "unknown key.*'comm'.*com"),
    "unknown contact kind": (
        with_stack("surface: {frame: left", "flat: {frame: left"),
        "'flat'.*point",
    ),
    "two kinds in one": (with_stack("- com\n", "- {com: {}, posture: {}}\n"), "one kind"),
    "level that is no list": (
        with_stack("- - posture", "- posture"),
        r"levels\[2\].*'posture'.*a list",
    ),
    "level that is empty": (with_stack("- - posture", "- []"), "level 2.*at least one task"),
    "unknown frame": (with_stack("frame: left_hand", "frame: left_hnad"), "'left_hnad'.*left_hand"),
    "contact on no frame": (
        with_stack("left_sole", "left_toe"),
        "unknown frame.*'left_toe'.*left_sole",
    ),
    "contact on a frame that is no sole": (
        with_stack("left_sole", "left_hand"),
        "not on a sole.*'left_hand'.*length and width",
    ),
    "two contacts on one frame": (with_stack("right_sole", "left_sole"), "two contacts.*left_sole"),
    "two tasks of one name": (with_stack("name: hand", "name: pelvis"), "one name.*pelvis"),
    "gain negative": (with_stack("- com\n", "- com: {kp: -5}\n"), "kp.*-5.*>= 0"),
    "gain text": (with_stack("- com\n", "- com: {kp: stiff}\n"), "kp.*'stiff'.*number"),
    "gain NaN": (with_stack("- com\n", "- com: {kp: .nan}\n"), "kp.*nan"),
    "gain true": (with_stack("- com\n", "- com: {kp: true}\n"), "kp.*True"),
    "gains of wrong length": (
        with_stack("- com\n", "- com: {kp: [1, 2]}\n"),
        "kp.*shape.*3 numbers",
    ),
    "no gains": (with_stack("- com\n", "- com: {kp: []}\n"), "kp.*3 numbers"),
    "weight zero": (with_stack("- com\n", "- com: {weight: 0}\n"), "weight.*out of range.*> 0"),
    "axes unknown": (with_stack("- com\n", "- com: {axes: xw}\n"), "axis mask.*'xw'"),
    "unknown key of a task": (with_stack("- com\n", "- com: {k_p: 5}\n"), "unknown key.*'k_p'.*kp"),
    "joint unknown": (
        with_stack("- com\n", "- joints: {joints: [left_kne]}\n"),
        "unknown joint.*'left_kne'.*left_knee",
    ),
    "joints no list": (
        with_stack("- com\n", "- joints: {joints: left_knee}\n"),
        "got 'left_knee'; wanted a list",
    ),
    "no joints": (with_stack("- com\n", "- joints: {joints: []}\n"), "names no joint"),
    "contact friction zero": (
        with_stack("{frame: left_sole}", "{frame: left_sole, friction: 0}"),
        "friction.*> 0",
    ),
    "margin wider than the sole": (
        with_stack("{frame: left_sole}", "{frame: left_sole, margin: 0.2}"),
        "margin.*leaves nothing",
    ),
    "torque limit negative": (
        top("").replace("  levels:", "  torque_limit: {scale: -1}\n  levels:"),
        "scale|torque limit",
    ),
    # Motions.
    "motions no list": (top("motions: {task: com}"), "motions.*wanted a list"),
    "motion of nothing": (
        top("motions: [null]"),
        r"motions\[0\] has the wrong kind; got None; wanted keys",
    ),
    "motion of an unknown task": (
        motion("task: hnad, at: 0, over: 1, by: [0, 0, 0]"),
        "unknown task.*'hnad'.*hand",
    ),
    "motion without a goal": (motion("task: hand, at: 0, over: 1"), "one of these keys.*to, by"),
    "motion with two goals": (
        motion("task: hand, at: 0, over: 1, by: [0, 0, 0], to: [0, 0, 0]"),
        r"one of.*\['to', 'by'\]",
    ),
    "motion before the start": (
        motion("task: hand, at: -1, over: 1, by: [0, 0, 0]"),
        "at.*-1.*at least 0",
    ),
    "motion after the end": (
        motion("task: hand, at: 100, over: 1, by: [0, 0, 0]"),
        "outside the run.*100.*duration of 1",
    ),
    "motion that takes negative time": (
        motion("task: hand, at: 0, over: -1, by: [0, 0, 0]"),
        "over.*-1",
    ),
    "goal of two numbers": (motion("task: hand, at: 0, over: 1, to: [0, 0]"), "to.*3 numbers"),
    "goal with NaN": (motion("task: hand, at: 0, over: 1, to: [0, .nan, 0]"), "to.1.*nan"),
    "goal with text": (motion("task: hand, at: 0, over: 1, to: [0, 1 m, 0]"), "to.1.*'1 m'"),
    "goal in micrometres": (
        motion("task: hand, at: 0, over: 1, to: [9e5, 0, 0]"),
        r"to\[0\].*900000.*to 1000 \[m",
    ),
    "above nothing": (motion("task: com, at: 0, over: 1, above: []"), "above is empty"),
    "above no sole": (motion("task: com, at: 0, over: 1, above: floor"), "'floor'.*left_sole"),
    "reach nowhere": (
        motion("task: hand, at: 0, over: 1, reach: {direction: [0, 0, 0], ratio: 1}"),
        "zero",
    ),
    "reach by a negative ratio": (
        motion("task: hand, at: 0, over: 1, reach: {direction: [1, 0, 0], ratio: -1}"),
        "ratio.*-1",
    ),
    "turning a position": (motion("task: hand, at: 0, over: 1, turn: [0, 0, 1]"), "'turn'.*to, by"),
    "moving an orientation": (motion("task: pelvis, at: 0, over: 1, by: [0, 0, 1]"), "'by'.*turn"),
    "joints of a posture in degrees": (
        motion("task: posture, at: 0, over: 1, joints: {left_elbow: -90}"),
        "left_elbow.*-90.*rad",
    ),
    # Contacts and pushes.
    "contact change of nothing": (top("contacts: [{at: 0}]"), "one of these keys.*load, unload"),
    "contact change unknown": (
        top("contacts: [{unload: left_foot, at: 0}]"),
        "'left_foot'.*left_sole",
    ),
    "touchdown while unloading": (
        top("contacts: [{unload: left_sole, at: 0, touchdown: 5}]"),
        "touchdown goes with load",
    ),
    "push on no body": (
        push("body: tail, at: 0, duration: 0.1, force: [1, 0, 0]"),
        "'tail'.*torso",
    ),
    "push of no time": (
        push("body: torso, at: 0, duration: 0, force: [1, 0, 0]"),
        "duration.*positive",
    ),
    "push with a unit": (
        push("body: torso, at: 0, duration: 0.1, force: [10 N, 0, 0]"),
        "force.0.*'10 N'",
    ),
    "push after the end": (
        push("body: torso, at: 2, duration: 1, force: [1, 0, 0]"),
        "outside the run",
    ),
    # Checks.
    "unknown metric": (check("metric: com_eror_max, at_most: 1"), "'com_eror_max'.*com_error_max"),
    "check without a bound": (check("metric: com_travel"), "one of these keys.*at_most, at_least"),
    "check with two bounds": (
        check("metric: com_travel, at_most: 1, at_least: 0"),
        r"\['at_most', 'at_least'\]",
    ),
    "bound with a unit": (check("metric: com_travel, at_most: 1 cm"), "at_most.*'1 cm'"),
    "check without its task": (
        check("metric: task_error_max, at_most: 1"),
        "wanted the key 'task'",
    ),
    "check with a task too many": (
        check("metric: com_travel, task: com, at_most: 1"),
        r"\['task'\].*no task",
    ),
    "check on an unknown task": (
        check("metric: task_error_max, task: head, at_most: 1"),
        "'head'.*choices: hand, com, pelvis",
    ),
    "check on an unknown sole": (
        check("metric: sole_force_max, sole: left_foot, at_most: 1"),
        "'left_foot'.*left_sole",
    ),
    "check on an unknown level": (
        check("metric: residual_max, level: 9, at_most: 1"),
        "level.*1 to 5",
    ),
    "check on level zero": (check("metric: residual_max, level: 0, at_most: 1"), "level.*1 to 5"),
    "axis unknown": (check("metric: com_travel, axis: w, at_most: 1"), "axis.*'w'.*x, y, z"),
    "axis where there is none": (check("metric: com_speed_end, axis: x, at_most: 1"), "no axis"),
    "window that is empty": (
        check("metric: com_travel, from: 0.8, until: 0.5, at_most: 1"),
        "empty",
    ),
    "window after the end": (
        check("metric: com_travel, from: 5, at_most: 1"),
        "outside the run.*5",
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


def test_there_are_as_many_cases_as_promised():
    assert len(CASES) >= 30


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


def test_a_number_may_be_written_with_an_exponent():
    prepare(GOOD.replace("duration: 1.0", "duration: 1e0"))


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
