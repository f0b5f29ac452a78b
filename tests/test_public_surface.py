"""The names that users write, and that wrong kinds of things are refused in production too."""

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from unchecked import run_unchecked

import poise

SURFACE = set(poise.__all__)
ROOT = Path(poise.__file__).parent
MOST_NAMES = 169
"""What there is now; a new public name takes the place of another, or says why it is needed.

The last ones: a campaign from a program, its episodes as scenarios, workers for whoever runs
anything else many times, the bad operator, whom scenarios and studies share, the bridge to a user's
own MuJoCo model; `describe`, `try_out` and `write_page`, a stranger's description, its trial and
its page, for programs that go through many models; and the state estimator with its configuration
and status, its two parts that are of use alone, and what a state carries for it; the balance limit
and the self-collision limit, which stacks have or not;
and the plant of step teleoperation, for studies of it;
and the walker that is led by commands with the limits of those, which nothing that follows a plan
made before could be, and the session in which somebody drives it;
and the poor link, which scenarios and studies put between an operator and a robot; and the
predictor for late sensors, which only whoever runs the loop can put behind an estimator;
and what whoever owns two arms with force feedback writes a driver to, the driver that lets hands
feel feet, the device that both make in the robot's process, and an arm that is simulated;
and what a hand and the body are told, what leads hands beside whatever leads the feet, and what
those do; and where the head looks;
and the payload that a state carries, with what finds it, which nothing else tells controllers;
and two trackers that lead feet, which everybody who has some would write anew, and wrongly: ours
did, twice; and the numbers of a teleoperated robot, which whoever changes one has to have;
and the order of joints of other programs, which everybody who deploys a policy writes anew;
and the link to a robot with its states and commands, two links, the last check, the split of
torques and the watchdog, without which everyone who has a robot writes these, and less safely.
"""


FACES = tuple(
    ".".join(("poise", *path.parent.relative_to(ROOT).parts))
    for path in sorted(ROOT.rglob("__init__.py"))
    if not any(part.startswith("_") for part in path.parent.relative_to(ROOT).parts)
)
"""Packages that are not private; `poise.errors` is a module, and `poise.apps` has no names."""


def names_of_all_faces():
    faces = {*FACES, "poise.errors"} - {"poise.apps"}
    return {name for module in faces for name in import_module(module).__all__}


def test_there_are_no_more_public_names_than_there_were():
    assert len(names_of_all_faces()) <= MOST_NAMES


@pytest.mark.parametrize("name", sorted(SURFACE))
def test_every_name_exists_and_says_what_it_is(name):
    thing = getattr(poise, name)
    assert thing.__doc__
    assert thing.__module__.startswith("poise.")


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="nothing_like_this"):
        _ = poise.nothing_like_this


def test_the_version_is_the_packages():
    from importlib.metadata import version

    assert version("poise") == poise.__version__


def test_the_simulator_comes_when_asked_for():
    pytest.importorskip("mujoco")
    assert poise.sim.Plant is poise.Plant
    assert poise.rollout
    assert poise.run_scenario


@pytest.mark.parametrize("name", ["g1", "humanoid33"])
def test_the_example_of_the_design_runs(get_robot, name):
    """As the README writes it, for a fifth of a second."""
    pytest.importorskip("mujoco")
    get_robot(name)
    robot = poise.load_robot(name)
    stack = poise.Stack(
        contacts=[poise.SurfaceContact("left_sole"), poise.SurfaceContact("right_sole")],
        levels=[
            [poise.ComTask(kp=40.0), poise.FrameTask("pelvis", axes="orientation")],
            [poise.FrameTask("right_hand"), poise.MomentumTask(axes="angular_xy")],
            [poise.PostureTask()],
        ],
    )
    controller = poise.WholeBodyController(robot, stack)
    plant = poise.Plant(robot)
    while plant.time < 0.2:
        command = controller.step(plant.state())
        assert command.status.ok
        plant.step(command)
    state = plant.state()
    dynamics = poise.Dynamics(robot)
    height = dynamics.com[2]
    dynamics.update(state)
    assert abs(dynamics.com[2] - height) < 0.01
    assert np.abs(state.v).max() < 0.2
    text = str(controller.status())
    assert text.startswith("status: ok")
    for task in ("com", "pelvis orientation", "right_hand pose", "angular momentum", "posture"):
        assert task in text


WRONG_KINDS = """
import json
import numpy as np, poise
from poise import ComTask, FrameTask, JointLimit, PoiseError, PostureTask, Stack, SurfaceContact
from poise import JointTask, Plant, PointContact, TorqueLimit, WholeBodyController

robot = poise.load_robot("biped20")
wrong = {
    "a task among the contacts": lambda: Stack(contacts=[ComTask()]),
    "a contact among the tasks": lambda: Stack(levels=[[SurfaceContact("left_sole")]]),
    "a task for a level": lambda: Stack(levels=[ComTask()]),
    "a contact for the list of contacts": lambda: Stack(contacts=SurfaceContact("left_sole")),
    "a task for the list of levels": lambda: Stack(levels=ComTask()),
    "a name for a contact": lambda: Stack(contacts=["left_sole"]),
    "a word for a gain": lambda: ComTask(kp="high"),
    "a name for the joints of a task": lambda: JointTask("left_knee"),
    "two numbers for a pose": lambda: FrameTask("pelvis").set_target([0, 0]),
    "ragged numbers for a pose": lambda: FrameTask("pelvis").set_target([[0.0, [1.0]], 2.0]),
    "a name for the robot of a plant": lambda: Plant("biped20"),
    "a dictionary for the configuration of a plant": lambda: Plant(robot, {"friction": 0.5}),
    "a word for a friction": lambda: SurfaceContact("left_sole", friction="slippery"),
    "a list for a friction": lambda: PointContact("left_sole", friction=[0.5, 0.5]),
    "None for a margin": lambda: SurfaceContact("left_sole", margin=None),
    "a word for a scale": lambda: TorqueLimit("half"),
    "a word for a horizon": lambda: JointLimit(horizon="long"),
    "a word for a target": lambda: ComTask().set_target("there"),
    "ragged numbers for a target": lambda: ComTask().set_target([[0.0], [1.0, 2.0], 3.0]),
    "None for a target": lambda: ComTask().set_target(None),
    "a number for axes": lambda: ComTask(3),
    "a number for a frame": lambda: WholeBodyController(robot, Stack(levels=[[FrameTask(3)]])),
    "a torque limit for a joint limit": lambda: Stack(joint_limit=TorqueLimit()),
    "a joint limit for a torque limit": lambda: Stack(torque_limit=JointLimit()),
    "a list for a stack": lambda: WholeBodyController(robot, [[ComTask()]]),
    "a name for a robot": lambda: WholeBodyController("biped20"),
    "words for a posture": lambda: PostureTask(["straight"]),
}
failed = []
for name, make in wrong.items():
    try:
        make()
    except PoiseError as error:
        if "got" not in str(error):
            failed.append(f"{name}: the message does not say what it got: {error}")
    except Exception as error:
        failed.append(f"{name}: {type(error).__name__}: {error}")
    else:
        failed.append(f"{name}: accepted")
controller = WholeBodyController(robot)
q, v = robot.q_home, np.zeros(robot.nv)
for state in (
    poise.RobotState(q.astype(str), v),
    poise.RobotState(q, np.zeros(robot.nv, dtype=bool)),
    poise.RobotState([list(q)], v),
    poise.RobotState([q, v], v),
    poise.RobotState(None, v),
    poise.RobotState(q, None),
    poise.RobotState(q, v, time=None),
    poise.RobotState(q[:, None], v),
    None,
):
    try:
        command = controller.step(state)
    except Exception as error:
        failed.append(f"step of {state!r}: {type(error).__name__}: {error}")
    else:
        if command.status.ok or not np.isfinite(command.torque).all():
            failed.append(f"step of {state!r}: {command}")
print(json.dumps(failed))
"""
"""Run without the tests' shape checking, which would answer first."""


def test_wrong_kinds_of_things_are_refused_by_poise_itself():
    assert run_unchecked(WRONG_KINDS) == []
