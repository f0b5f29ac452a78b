"""Ticks without an answer: always a finite, bounded command with a status, never an exception."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from hypothesis.extra import numpy as hnp
from oracles import near_home

from poise.control import (
    CommandStatus,
    DifferentialIK,
    OperationalSpaceController,
    ReducedController,
    WholeBodyController,
)
from poise.control._fallback import DAMPING_RATIO, DECAY_TIME
from poise.control._whole_body import FullProgram
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.hqp import SolveStatus
from poise.stack import ComTask, PostureTask, Stack, SurfaceContact, Task, TorqueLimit


@pytest.fixture
def robot(get_robot):
    return get_robot("humanoid33")


KINDS = pytest.mark.parametrize("kind", [WholeBodyController, ReducedController])


@pytest.fixture(params=[WholeBodyController, ReducedController])
def controller(robot, request):
    return request.param(robot)


@pytest.fixture
def whole(robot):
    return WholeBodyController(robot)


def at_home(robot, time=0.0, speed=0.0):
    return RobotState(robot.q_home, np.full(robot.nv, speed), time=time)


def is_safe(command, robot, scale=1.0):
    torque = command.torque
    return np.isfinite(torque).all() and (np.abs(torque) <= scale * robot.tau_max).all()


def spoil(state, **changes):
    return dataclasses.replace(state, **changes)


def bad_states(robot):
    home = at_home(robot, time=1.0)
    nan_q, inf_v, flat = home.q.copy(), home.v.copy(), home.q.copy()
    nan_q[9], inf_v[9], flat[3:7] = np.nan, np.inf, [0.0, 0.0, 0.0, 2.0]
    return {
        "nan in q": spoil(home, q=nan_q),
        "infinity in v": spoil(home, v=inf_v),
        "short q": spoil(home, q=home.q[:-1]),
        "long v": spoil(home, v=np.zeros(robot.nv + 1)),
        "empty": RobotState(np.zeros(0), np.zeros(0)),
        "quaternion of norm two": spoil(home, q=flat),
        "no quaternion": spoil(home, q=np.zeros(robot.nq)),
        "time is nan": spoil(home, time=float("nan")),
        "overflowing v": spoil(home, v=np.full(robot.nv, 1e200)),
        "largest float": spoil(home, q=np.full(robot.nq, np.finfo(float).max)),
        "faster than any robot": spoil(home, v=np.full(robot.nv, 1e8)),
    }


@pytest.mark.parametrize("case", range(11))
def test_a_bad_state_gives_a_safe_command_that_says_so(robot, controller, case):
    name, state = list(bad_states(robot).items())[case]
    for first in (True, False):
        if not first:
            controller.step(at_home(robot, time=0.999))
        command = controller.step(state)
        assert command.status is CommandStatus.BAD_STATE, name
        assert not command.status.ok
        assert is_safe(command, robot)
        assert controller.status().command is CommandStatus.BAD_STATE


def test_one_bad_tick_hardly_changes_the_torque(robot, controller):
    good = controller.step(at_home(robot, time=1.0))
    for name, state in bad_states(robot).items():
        controller.step(at_home(robot, time=1.0))
        command = controller.step(spoil(state, time=1.001 if state.time == 1.0 else state.time))
        change = np.abs(command.torque - good.torque).max()
        assert change < 0.1 * np.abs(good.torque).max(), name


def test_the_next_good_state_is_controlled_again(robot, controller):
    good = controller.step(at_home(robot))
    controller.step(bad_states(robot)["nan in q"])
    again = controller.step(at_home(robot))
    assert again.status.ok
    assert np.abs(again.torque - good.torque).max() < 1e-6


@pytest.mark.parametrize("clock", ["runs", "stands still", "jumps back", "is nan"])
def test_the_last_torque_fades_into_damping_whatever_the_clock_does(robot, controller, clock):
    good = controller.step(at_home(robot, time=10.0))
    v = np.zeros(robot.nv)
    v[6:] = 0.1 * robot.v_max
    v[0] = np.nan
    sizes = []
    for tick in range(1, 1001):
        time = {"runs": 10.0 + 1e-3 * tick, "stands still": 10.0, "jumps back": 0.0}
        state = RobotState(robot.q_home, v, time=time.get(clock, float("nan")))
        command = controller.step(state)
        sizes.append(np.abs(command.torque + 0.1 * DAMPING_RATIO * robot.tau_max).max())
    assert sizes[-1] < 1e-3 * np.abs(good.torque).max()
    expected = sizes[0] * np.exp(-0.1 / DECAY_TIME)
    assert sizes[100] == pytest.approx(expected, rel=0.05)


class Elbow(Task):
    """A task of a user's own, on one joint, that does what it is told to do wrong."""

    def __init__(self, wrong=""):
        super().__init__("elbow", kp=100.0, kd=None, weight=1.0)
        self.wrong = wrong

    def _resolve(self, robot):
        self.column = robot.nv - 1
        return 1

    def _evaluate(self, dynamics):
        nv = dynamics.robot.nv
        self.jacobian = np.zeros((1, nv if self.wrong != "columns" else nv - 6))
        self.jacobian[0, -1] = 1.0
        self.drift, self.error = np.zeros(1), np.zeros(3 if self.wrong == "rows" else 1)
        self.error_rate = np.zeros(1)
        if self.wrong == "raises":
            raise KeyError("no such thing")
        return None if self.wrong == "returns nothing" else np.zeros(1)


WRONG = {
    "raises": "KeyError",
    "columns": "jacobian",
    "rows": "error",
    "returns nothing": "target's acceleration of task",
}

OWN = pytest.mark.parametrize(
    "kind",
    [WholeBodyController, ReducedController, OperationalSpaceController, DifferentialIK],
)


def with_elbow(robot, kind, wrong=""):
    elbow = Elbow(wrong)
    stack = Stack(
        contacts=[SurfaceContact(sole) for sole in robot.soles],
        levels=[[ComTask()], [elbow], [PostureTask()]],
    )
    more = {"dt": 1e-3} if kind is DifferentialIK else {}
    return kind(robot, stack, **more), elbow


@OWN
@pytest.mark.parametrize("wrong", WRONG)
def test_a_task_of_ones_own_that_fails_in_the_loop_gives_a_status_that_says_why(robot, kind, wrong):
    controller, elbow = with_elbow(robot, kind)
    assert controller.step(at_home(robot)).status.ok
    elbow.wrong = wrong
    command = controller.step(at_home(robot, time=1e-3))
    assert command.status is CommandStatus.SOLVER_FAILED
    joints = command.velocity if kind is DifferentialIK else command.torque
    assert np.isfinite(joints).all()
    said = controller.status()
    assert "elbow" in said.reason
    assert WRONG[wrong] in said.reason
    elbow.wrong = ""
    assert controller.step(at_home(robot, time=2e-3)).status.ok
    assert controller.status().reason == ""


@OWN
@pytest.mark.parametrize("wrong", WRONG)
def test_one_that_fails_at_once_is_refused_by_name(robot, kind, wrong):
    with pytest.raises(ConfigurationError, match="elbow") as refused:
        with_elbow(robot, kind, wrong)
    assert WRONG[wrong] in str(refused.value)


def force(controller, solution):
    program = FullProgram(controller.strategy.current.full, lambda: Always(solution))
    controller.strategy.prepared.of = lambda contacts: program


def solution_of(controller):
    return controller.strategy.current.solution


class Always:
    name, time_limit = "always", None

    def __init__(self, solution):
        self.solution = solution
        self.x, self.relative_residuals = solution.x, solution.relative_residuals

    def reset(self):
        pass

    def prepare(self, problem):
        pass

    def follow(self, problem, last):
        pass

    def run(self, problem):
        return self.solution.status

    def solve(self, problem):
        return self.solution

    def report(self):
        return self.solution


@pytest.mark.parametrize(
    ("status", "wanted"),
    [
        (SolveStatus.FAILED, CommandStatus.SOLVER_FAILED),
        (SolveStatus.BAD_PROBLEM, CommandStatus.SOLVER_FAILED),
    ],
)
def test_a_solver_that_failed_is_not_obeyed(robot, whole, status, wanted):
    good = whole.step(at_home(robot))
    solution = dataclasses.replace(solution_of(whole), status=status, x=0.0 * solution_of(whole).x)
    force(whole, solution)
    command = whole.step(at_home(robot, time=0.001))
    assert command.status is wanted
    assert is_safe(command, robot)
    assert np.abs(command.torque - good.torque).max() < 0.05 * np.abs(good.torque).max()


def test_a_solver_that_breaks_physics_is_not_obeyed(robot, whole):
    whole.step(at_home(robot))
    wrong = solution_of(whole).relative_residuals.copy()
    wrong[0] = 1e-3
    force(whole, dataclasses.replace(solution_of(whole), relative_residuals=wrong))
    assert whole.step(at_home(robot)).status is CommandStatus.SOLVER_FAILED


def test_a_solver_that_returns_nan_is_not_obeyed(robot, whole):
    whole.step(at_home(robot))
    x = np.full_like(solution_of(whole).x, np.nan)
    force(whole, dataclasses.replace(solution_of(whole), x=x))
    command = whole.step(at_home(robot))
    assert command.status is CommandStatus.SOLVER_FAILED
    assert is_safe(command, robot)


@pytest.mark.parametrize("strategy", ["direct", "cascade", "weighted"])
def test_a_tiny_time_cap_never_raises_and_says_so(robot, strategy):
    backend = "daqp" if strategy != "direct" else None
    controller = WholeBodyController(robot, strategy=strategy, backend=backend, time_limit=1e-9)
    for tick in range(20):
        command = controller.step(near_home(robot, tick, time=1e-3 * tick))
        assert is_safe(command, robot)
        late = solution_of(controller).status is SolveStatus.TIME_LIMIT
        assert command.status is (CommandStatus.TIME_LIMIT if late else CommandStatus.OK)


def test_a_point_that_knows_no_task_yet_is_not_obeyed(robot, whole):
    whole.step(at_home(robot))
    force(whole, dataclasses.replace(solution_of(whole), status=SolveStatus.TIME_LIMIT))
    command = whole.step(at_home(robot, time=0.001))
    assert command.status is CommandStatus.TIME_LIMIT
    assert is_safe(command, robot)


def test_a_generous_time_cap_changes_nothing(robot, controller):
    state = near_home(robot, 0)
    command = type(controller)(robot, time_limit=10.0).step(state)
    assert np.abs(command.torque - controller.step(state).torque).max() < 1e-9


@KINDS
def test_a_fallback_keeps_a_scaled_torque_limit(robot, kind):
    stack = Stack(
        contacts=[SurfaceContact(s) for s in robot.soles],
        levels=[[PostureTask()]],
        torque_limit=TorqueLimit(0.1),
    )
    controller = kind(robot, stack)
    v = np.full(robot.nv, np.nan)
    v[6:] = 5.0 * robot.v_max
    for tick in range(1000):
        command = controller.step(RobotState(robot.q_home, v, time=1e-3 * tick))
        assert is_safe(command, robot, scale=0.1)


def test_what_a_user_does_to_a_command_does_not_reach_the_fallback(robot, controller):
    command = controller.step(at_home(robot))
    torque = command.torque.copy()
    command.torque[:] = 1e9
    safe = controller.step(bad_states(robot)["nan in q"])
    assert (np.abs(safe.torque) <= np.abs(torque) + 1e-9).all()


def test_a_command_keeps_its_numbers_after_the_next_tick(robot, controller):
    command = controller.step(near_home(robot, 0))
    kept = [command.torque, command.acceleration, *command.wrenches.values()]
    then = [a.copy() for a in kept]
    for seed in range(1, 4):
        controller.step(near_home(robot, seed))
    for a, b in zip(kept, then, strict=True):
        assert np.array_equal(a, b)


garbage = st.floats(allow_nan=True, allow_infinity=True, width=64)


@pytest.mark.slow
@KINDS
@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_no_state_makes_a_step_raise(get_robot, kind, data):
    robot = get_robot("biped20")
    stack = Stack(
        contacts=[SurfaceContact(s) for s in robot.soles], levels=[[ComTask()], [PostureTask()]]
    )
    controller = kind(robot, stack)
    sizes = st.sampled_from([robot.nq, robot.nq, robot.nq, robot.nv, 0, 1, 100])
    for _ in range(3):
        q = data.draw(hnp.arrays(np.float64, data.draw(sizes), elements=garbage))
        v = data.draw(hnp.arrays(np.float64, data.draw(sizes), elements=garbage))
        command = controller.step(RobotState(q, v, time=data.draw(garbage)))
        assert is_safe(command, robot)
        assert str(controller.status())


@KINDS
@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    spread=st.floats(0.0, 3.0),
    speed=st.sampled_from([0.0, 1.0, 10.0, 1e3]),
    offset=st.sampled_from([0.0, 1.0, 10.0, 1e4]),
)
def test_no_finite_state_makes_a_step_raise(get_robot, kind, seed, spread, speed, offset):
    """Sizes fit and everything is finite: joints outside their limits, speeds no robot reaches."""
    robot = get_robot("biped20")
    stack = Stack(
        contacts=[SurfaceContact(s) for s in robot.soles], levels=[[ComTask()], [PostureTask()]]
    )
    controller = kind(robot, stack)
    rng = np.random.default_rng(seed)
    state = near_home(robot, seed, spread=spread, speed=speed)
    q = state.q.copy()
    q[7:] += offset * rng.normal(size=robot.nj)
    command = controller.step(RobotState(q, state.v))
    assert is_safe(command, robot)


def test_a_clock_that_goes_back_brings_no_torque_back(robot, controller):
    controller.step(at_home(robot, time=10.0))
    sizes = []
    for time in (10.1, 10.2, float("nan"), 0.0, 10.1):
        command = controller.step(spoil(bad_states(robot)["nan in q"], time=time))
        sizes.append(np.abs(command.torque).max())
    assert all(later < sooner for sooner, later in pairwise(sizes))


def test_a_time_that_no_float_holds_is_no_time(robot, controller):
    for time in (10**400, -(10**400)):
        command = controller.step(spoil(at_home(robot), time=time))
        assert command.status is CommandStatus.BAD_STATE
        assert is_safe(command, robot)
