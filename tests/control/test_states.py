"""States as people have them; why one is of no use; a robot that has fallen."""

import numpy as np
import pinocchio as pin
import pytest

import poise
from poise.control import CommandStatus
from poise.dynamics import RobotState
from poise.errors import ConfigurationError


@pytest.fixture
def robot(get_robot):
    return get_robot("humanoid33")


@pytest.fixture(params=["whole_body", "differential_ik"])
def controller(request, robot):
    if request.param == "whole_body":
        return poise.WholeBodyController(robot)
    controller = poise.DifferentialIK(robot, dt=2e-3)
    assert controller.fall_height_ratio is None
    controller.fall_height_ratio = 0.25
    return controller


def joints_of(command):
    return command.velocity if command.torque is None else command.torque


def lying(robot, time=0.0):
    """On its back."""
    q = robot.q_home.copy()
    q[2] = 0.15
    q[3:7] = pin.Quaternion(pin.utils.rotate("y", -0.5 * np.pi)).coeffs()
    return RobotState(q, np.zeros(robot.nv), time=time)


def standing(robot, time=0.0):
    return RobotState(robot.q_home, np.zeros(robot.nv), time=time)


@pytest.mark.parametrize(
    "convert",
    [list, tuple, lambda a: a.tolist(), lambda a: a.astype(np.float32), lambda a: a[::-1][::-1]],
    ids=["list", "tuple", "plain numbers", "float32", "strided"],
)
def test_states_are_taken_as_lists_and_in_single_precision(robot, controller, convert):
    expected = joints_of(controller.step(standing(robot))).copy()
    controller.reset()
    state = RobotState(convert(robot.q_home), convert(np.zeros(robot.nv)), time=np.float32(0.0))
    assert state.q.dtype == state.v.dtype == np.float64
    command = controller.step(state)
    assert command.status is CommandStatus.OK
    np.testing.assert_allclose(
        joints_of(command), expected, atol=2e-2 * (np.abs(expected).max() + 1e-3)
    )


def test_whole_numbers_are_numbers_and_doubles_are_not_copied(robot):
    state = RobotState(robot.q_home, np.zeros(robot.nv, dtype=int))
    assert state.q is robot.q_home
    assert state.v.dtype == np.float64


def at(vector, place, value):
    changed = vector.copy()
    changed[place] = value
    return changed


REASONS = {
    "nan in a joint": (lambda q, v: (at(q, 7, np.nan), v), "in q, {first} is nan"),
    "infinite speed": (lambda q, v: (q, at(v, 6, -np.inf)), "in v, {first} is -inf"),
    "speed of no robot": (lambda q, v: (q, at(v, 6, 1e7)), "in v, {first} is 1e+07"),
    "nan in the base": (lambda q, v: (at(q, 2, np.nan), v), "in q, entry 2 of the base is nan"),
    "all of it": (lambda q, v: (q, v * np.nan), "entry 2 of the base is nan and {rest} more"),
    "short": (lambda q, v: (q[1:], v), "q is an array of shape ({short},) and type float64"),
    "a matrix": (lambda q, v: (q, v[:, None]), "v is an array of shape ({nv}, 1)"),
    "a long quaternion": (lambda q, v: (at(q, 6, 2.0), v), "q[3:7] has length 2, wanted 1"),
    "words": (lambda q, v: ("standing", v), "q is of kind str, wanted {nq} numbers"),
    "nothing": (lambda q, v: (q, None), "v is of kind NoneType, wanted {nv} numbers"),
}


@pytest.mark.parametrize("case", REASONS)
def test_a_bad_state_says_which_entry_is_wrong(robot, controller, case):
    spoil, said = REASONS[case]
    state = standing(robot)
    q, v = spoil(state.q, state.v)
    bad = standing(robot)
    # Past the tests' own check of kinds, which would answer first.
    object.__setattr__(bad, "q", q)
    object.__setattr__(bad, "v", v)
    assert controller.step(bad).status is CommandStatus.BAD_STATE
    wanted = said.format(
        first=robot.joint_names[0],
        rest=robot.nv - 3,
        short=robot.nq - 1,
        nq=robot.nq,
        nv=robot.nv,
    )
    assert wanted in controller.status().reason
    assert wanted in str(controller.status()).splitlines()[0]
    assert controller.step(state).status is CommandStatus.OK
    assert controller.status().reason == ""


def test_a_wrong_time_is_said(robot, controller):
    controller.step(standing(robot, time=float("nan")))
    assert "the time is nan" in controller.status().reason


def test_a_robot_that_lies_has_fallen_after_a_while(robot, controller):
    """One wrong measurement is no fall; the command then dies away, as without an answer."""
    for k in range(100):
        assert controller.step(lying(robot, time=1e-3 * k)).status is CommandStatus.OK
    command = controller.step(lying(robot, time=0.1))
    assert command.status is CommandStatus.FALLEN
    assert "the robot has fallen" in controller.status().reason
    for k in range(1000):
        command = controller.step(lying(robot, time=0.1 + 1e-3 * k))
    assert np.abs(joints_of(command)).max() < 1e-3 * robot.tau_max.max()


def test_a_robot_that_stands_again_is_controlled_again(robot, controller):
    for k in range(200):
        controller.step(lying(robot, time=1e-3 * k))
    assert controller.status().command is CommandStatus.FALLEN
    assert controller.step(standing(robot, time=0.3)).status is CommandStatus.OK
    # And a further fall takes its time anew, also when the clock starts again.
    assert controller.step(lying(robot, time=0.0)).status is CommandStatus.OK
    assert controller.step(lying(robot, time=0.2)).status is CommandStatus.FALLEN
    controller.reset()
    assert controller.step(lying(robot, time=0.4)).status is CommandStatus.OK


def test_stairs_and_heights_are_no_fall(robot, controller):
    """The pelvis is looked at from the soles, not from a floor."""
    q = robot.q_home.copy()
    q[2] -= 3.0
    for time in (0.0, 0.2):
        command = controller.step(RobotState(q, np.zeros(robot.nv), time=time))
        assert command.status is CommandStatus.OK


def test_who_lies_on_purpose_says_so(robot, controller):
    assert controller.fall_height_ratio == 0.25
    controller.fall_height_ratio = None
    for time in (0.0, 0.2):
        assert controller.step(lying(robot, time=time)).status is not CommandStatus.FALLEN
    for wrong in (0.0, 1.0, -1.0, float("nan")):
        with pytest.raises(ConfigurationError, match="fall_height_ratio"):
            controller.fall_height_ratio = wrong


def test_what_is_fixed_does_not_fall(get_robot):
    arm = poise.OperationalSpaceController(get_robot("arm6"))
    assert arm.fall_height_ratio is None
    with pytest.raises(ConfigurationError, match="does not fall"):
        arm.fall_height_ratio = 0.5
