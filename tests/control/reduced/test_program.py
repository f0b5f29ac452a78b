"""LQP 1 and what follows from it, against the whole problem at the same states."""

import numpy as np
import pytest
from jaxtyping import Float64
from oracles import near_home, random_state
from stances import HUMANOIDS, relative, stances

from poise._compiled import compiled, view
from poise.control._full_problem import FullProblem
from poise.control._reduced import _controller
from poise.control._reduced._assignment import assign
from poise.control._reduced._controller import ReducedProgram
from poise.control._reduced._elimination import Elimination, recover
from poise.dynamics import Dynamics, Partitions
from poise.hqp import SolveStatus, certify_point, make_solver
from poise.hqp._cascade import CascadeSolver
from poise.stack import (
    BalanceLimit,
    ComTask,
    FrameTask,
    JointTask,
    MomentumTask,
    PointContact,
    PostureTask,
    RelativeFrameTask,
    Stack,
    SurfaceContact,
    Task,
    TorqueLimit,
)

SEEDS = range(8)
STANCES = ("double support", "left support", "hand contact", "one foot and one hand")
TOLERANCE = 1e-9
RESOLVED = 1e-7
"""What two exact solutions of one hierarchy with levels that give may differ by."""


@compiled
def _recover(address: int, x: Float64[np.ndarray, " n"]) -> None:
    recover(view(Elimination, address), x)


def recovered(chain, x):
    """Acceleration of the unconstrained chain for a solution of LQP 1."""
    _recover(chain.block.address, np.ascontiguousarray(x))
    return chain.block.dv_u.copy()


def balance(robot):
    return [ComTask(kp=40.0), FrameTask(robot.pelvis, "orientation")]


def stack_of(robot, frames, levels, scale=1.0):
    contacts = [SurfaceContact(f) if f in robot.soles else PointContact(f) for f in frames]
    # States are anywhere: the balance limit would cut what is compared; it is compared apart.
    stack = Stack(
        contacts,
        [level for level in levels if level],
        torque_limit=TorqueLimit(scale),
        balance_limit=BalanceLimit(enabled=False),
        softening=0.0,
    )
    stack.bind(robot)
    return stack


def exact(problem):
    """The optimum by a solver that the programs do not use, certified."""
    solution = CascadeSolver("daqp").solve(problem)
    assert solution.ok
    assert certify_point(problem, solution.x).worst < 1e-8
    return solution.x


class Both:
    """The reduced and the whole problem of one stack."""

    def __init__(self, robot, frames, levels, scale=1.0, strategy="direct"):
        self.robot, self.dynamics = robot, Dynamics(robot)
        self.stack = stack_of(robot, frames, levels, scale)
        self.program = ReducedProgram(
            robot,
            self.stack,
            self.stack.contacts,
            Partitions(robot).of(frames),
            lambda: make_solver(strategy),
        )
        self.whole = FullProblem(robot, self.stack, self.stack.contacts)
        self._strategy = strategy

    def at(self, state):
        for _, task in self.stack.tasks():
            task.reset()
        self.program.reset()
        self.dynamics.update(state)
        self.program.assemble(self.dynamics)
        answer = self.program.solve()
        self.whole.fill(self.dynamics)
        return answer

    def solve_whole(self):
        # A new solver: nothing is left of another state.
        return make_solver(self._strategy).solve(self.whole.problem)

    def of(self, x):
        """Accelerations, all wrenches and torques in a point of the whole problem."""
        nv = self.robot.nv
        return x[:nv], x[nv:], self.whole.answer(x, self.dynamics)[1]

    def point(self, answer):
        """An answer as a point of the whole problem."""
        wrenches = [answer.wrenches[c.name] for c in self.stack.contacts]
        return np.concatenate((answer.acceleration, *wrenches))

    def residuals(self, x):
        problem = self.whole.problem
        values = problem.A @ x
        n = problem.n
        slack = values - np.clip(values, problem.lower[n:], problem.upper[n:])
        return np.array([np.linalg.norm(v.weights * slack[v.slice]) for v in problem.levels])


def free_hands(robot, frames):
    return [FrameTask(h, "position") for h in robot.hands if h not in frames]


@pytest.mark.parametrize("stance", STANCES)
@pytest.mark.parametrize("name", HUMANOIDS)
@pytest.mark.parametrize("hands", ["no hands", "hands below", "hands above"])
def test_answers_are_those_of_the_whole_problem(get_robot, name, stance, hands):
    """With tasks of the unconstrained chain and without, whichever chain's task ranks higher."""
    robot = get_robot(name)
    frames = stances(robot)[stance]
    levels = [balance(robot), free_hands(robot, frames)]
    levels = {"no hands": levels[:1], "hands below": levels, "hands above": levels[::-1]}[hands]
    both, compared = Both(robot, frames, levels), 0
    for seed in SEEDS:
        answer = both.at(near_home(robot, seed, spread=0.1, speed=0.05))
        whole = both.solve_whole()
        assert both.program.first_solution.ok
        if both.program.second_solution is not None or whole.relaxed:
            continue
        compared += 1
        dv, F, torque = both.of(whole.x)
        assert relative(answer.acceleration, dv) < TOLERANCE
        assert relative(both.point(answer)[robot.nv :], F) < TOLERANCE
        assert relative(answer.joints, torque) < TOLERANCE
    assert compared > 0


@pytest.mark.parametrize("stance", STANCES[:3])
@pytest.mark.parametrize("name", ["humanoid33", "g1"])
def test_levels_that_must_give_give_what_they_give_in_the_whole_problem(get_robot, name, stance):
    """A posture below everything: both hierarchies resolved exactly, level by level."""
    robot = get_robot(name)
    frames = stances(robot)[stance]
    both = Both(robot, frames, [balance(robot), free_hands(robot, frames), [PostureTask()]])
    for seed in SEEDS[:3]:
        both.at(near_home(robot, seed, spread=0.1, speed=0.05))
        if both.program.second_solution is not None:
            continue
        first, part = both.program.first, both.program.reduced.partition
        reduced, expected = exact(first.problem), exact(both.whole.problem)
        x = reduced[: part.nr + both.program.chain.shape[0]]
        dv = part.merge(x[: part.na], recovered(both.program.chain, x))
        point = np.concatenate((dv, reduced[len(x) :]))
        for actual, wanted in zip(both.of(point), both.of(expected), strict=True):
            assert relative(actual, wanted) < RESOLVED
        assert np.abs(both.residuals(point) - both.residuals(expected)).max() < RESOLVED


@pytest.mark.parametrize("name", ["humanoid33", "g1"])
def test_a_hand_that_its_limits_hold_back_misses_as_much_as_in_the_whole_problem(get_robot, name):
    """LQP 1 does not know the arm's limits, and what it decided is not obeyed where they count."""
    robot = get_robot(name)
    frames = stances(robot)["double support"]
    hand = FrameTask(robot.hands[0], "position", kp=20.0, speed=np.inf)
    both = Both(robot, frames, [balance(robot), [hand]])
    hand.set_target([3.0, 2.0, 2.0])
    limited = 0
    for seed in SEEDS:
        answer = both.at(near_home(robot, seed, spread=0.1, speed=0.05))
        limited += both.program.second_solution is not None
        expected = both.residuals(exact(both.whole.problem))
        assert np.abs(both.residuals(both.point(answer)) - expected).max() < RESOLVED
    assert 0 < limited < len(SEEDS)


def test_an_arm_that_can_give_way_within_its_limits_does(get_robot, monkeypatch):
    """LQP 2: the hand stays where it should be, and the elbow moves as it may.

    Were that to take more energy than it may, the whole problem would answer.
    """
    robot = get_robot("humanoid33")
    frames = stances(robot)["double support"]
    both = Both(robot, frames, [balance(robot), free_hands(robot, frames)])
    found = 0
    for seed in range(60):
        state = near_home(robot, seed, spread=0.1, speed=0.05)
        both.at(state)
        free = recovered(both.program.chain, both.program.first_solution.x[:24])
        joint = robot.joint_index("left_shoulder_yaw")
        limit = both.stack.joint_limit
        both.dynamics.update(state)
        both.program.assemble(both.dynamics)
        place = both.program.reduced.partition.unconstrained.index("left_shoulder_yaw")
        # Tightened behind the limit's back, just short of what the joint would have done.
        limit._set(evaluate=lambda dynamics: None)
        limit.upper[joint] = limit.lower[joint] = 0.9 * free[place]
        answer = both.program.solve()
        bounded = both.program.second_solution is not None and both.program.whole_solution is None
        if bounded:
            with monkeypatch.context() as patch:
                patch.setattr(_controller, "_MORE_ENERGY", -1.0)
                both.program.solve()
            assert both.program.whole_solution is not None
        del limit.evaluate
        if not bounded:
            continue
        found += 1
        assert answer.acceleration[6 + joint] == pytest.approx(0.9 * free[place], abs=1e-8)
        assert max(answer.residuals) < 1e-8
        assert both.residuals(both.point(answer)).max() < 1e-6
    assert found > 0


def test_where_the_chain_cannot_follow_the_whole_problem_answers(get_robot):
    """TALOS stands at the torque limits of its arms: what LQP 1 decided would take more."""
    robot = get_robot("talos")
    frames = stances(robot)["double support"]
    both, wholes = Both(robot, frames, [balance(robot), free_hands(robot, frames)]), 0
    for seed in range(20):
        answer = both.at(near_home(robot, seed, spread=0.1, speed=0.05))
        if both.program.whole_solution is not None:
            wholes += 1
            assert np.array_equal(both.point(answer), both.program.whole_solution.x)
        assert both.residuals(both.point(answer))[:2].max() < 1e-6
        assert (np.abs(answer.joints) <= both.stack.torque_limit.upper + 1e-6).all()
    assert wholes > 0


def test_beyond_its_limits_the_chain_follows_no_point_that_may_be_none(get_robot, monkeypatch):
    """Its torques were cut to their limits, and the dynamics said to hold."""
    robot = get_robot("talos")
    frames = stances(robot)["double support"]
    both = Both(robot, frames, [balance(robot), free_hands(robot, frames)])
    solver = both.program._current[1]

    def run(problem):
        type(solver).run(solver, problem)
        return SolveStatus.INACCURATE

    monkeypatch.setattr(solver, "run", run)
    wholes = 0
    for seed in range(20):
        answer = both.at(near_home(robot, seed, spread=0.1, speed=0.05))
        wholes += both.program.whole_solution is not None
        assert both.residuals(both.point(answer))[0] < 1e-6
        assert (np.abs(answer.joints) <= both.stack.torque_limit.upper + 1e-6).all()
    assert 0 < wholes < 20


@pytest.mark.parametrize("seed", [74, 65, 75])
@pytest.mark.parametrize("name", ["humanoid33", "g1"])
def test_a_nearly_straight_arm_costs_no_accuracy(get_robot, name, seed):
    """The inverse square of what it can still do would be in the energy, and was."""
    robot = get_robot(name)
    frames = stances(robot)["one foot and one hand"]
    both = Both(robot, frames, [balance(robot), free_hands(robot, frames)])
    answer = both.at(near_home(robot, seed, spread=0.1, speed=0.05))
    assert both.program.second_solution is None
    problem = both.program.first.problem
    assert np.linalg.cond(problem.H) < 1e10
    expected = both.of(exact(both.whole.problem))
    for actual, wanted in zip(both.of(both.point(answer)), expected, strict=True):
        assert relative(actual, wanted) < TOLERANCE


@pytest.mark.parametrize("name", ["humanoid33", "g1"])
def test_exactly_straight_arms_leave_rows_for_the_rest_of_the_robot(get_robot, name):
    robot = get_robot(name)
    frames = stances(robot)["double support"]
    both = Both(robot, frames, [balance(robot), free_hands(robot, frames)])
    state = near_home(robot, 0, spread=0.02, speed=0.0)
    for i, joint in enumerate(robot.joint_names):
        if "hip" not in joint and "knee" not in joint and "ankle" not in joint:
            state.q[7 + i] = 0.0
    answer = both.at(state)
    assert np.isfinite(answer.acceleration).all()
    expected = both.residuals(exact(both.whole.problem))
    assert np.abs(both.residuals(both.point(answer)) - expected).max() < RESOLVED


def test_torque_limits_of_both_chains_hold_and_base_dynamics_stay_exact(get_robot):
    """The second problem, or the whole one, is called where an arm has too little torque."""
    robot = get_robot("humanoid33")
    frames = stances(robot)["double support"]
    hand = FrameTask(robot.hands[0], "position", kp=100.0)
    both = Both(robot, frames, [balance(robot), [hand]], scale=0.25)
    hand.set_target(Dynamics(robot).frame(robot.frame_id(robot.hands[0])).position + [0.8, 0, 0.8])
    seconds = wholes = 0
    for seed in SEEDS:
        answer = both.at(near_home(robot, seed, spread=0.02, speed=0.02))
        seconds += both.program.second_solution is not None
        wholes += both.program.whole_solution is not None
        residuals = both.residuals(both.point(answer))
        assert residuals[0] < 1e-6
        limit = both.stack.torque_limit.upper
        assert (np.abs(answer.joints) <= limit + 1e-6).all()
        torque = both.of(both.point(answer))[2]
        assert relative(answer.joints, torque) < TOLERANCE
    assert seconds > 0


@pytest.mark.parametrize("strategy", ["direct", "weighted"])
def test_every_strategy_solves_it(get_robot, strategy):
    robot = get_robot("humanoid33")
    frames = stances(robot)["double support"]
    both = Both(robot, frames, [balance(robot), free_hands(robot, frames)], strategy=strategy)
    answer = both.at(near_home(robot, 0, spread=0.05, speed=0.05))
    residuals = both.residuals(both.point(answer))
    # Weights meet no level exactly, in the whole problem neither.
    assert (residuals <= 1.1 * both.solve_whole().residuals + 1e-4).all()


def test_the_cascade_solves_it(get_robot):
    pytest.importorskip("osqp")
    robot = get_robot("humanoid33")
    frames = stances(robot)["double support"]
    stack = stack_of(robot, frames, [balance(robot), free_hands(robot, frames)])
    partition = Partitions(robot).of(frames)
    program = ReducedProgram(robot, stack, stack.contacts, partition, CascadeSolver)
    dynamics = Dynamics(robot)
    dynamics.update(near_home(robot, 0, spread=0.05, speed=0.05))
    program.assemble(dynamics)
    program.solve()
    assert program.first_solution.relative_residuals.max() < 1e-3


@pytest.mark.parametrize("stance", ["flight", "everything", "hanging by a hand"])
def test_no_contact_and_no_unconstrained_chain_are_solved_too(get_robot, stance):
    robot = get_robot("humanoid33")
    frames = stances(robot)[stance]
    both = Both(robot, frames, [free_hands(robot, frames)])
    answer = both.at(near_home(robot, 0, spread=0.1, speed=0.05))
    whole = both.solve_whole()
    assert both.program.second_solution is None
    for actual, wanted in zip(both.of(both.point(answer)), both.of(whole.x), strict=True):
        assert np.abs(actual - wanted).max(initial=0.0) < 1e-7 * np.abs(whole.x).max()


@pytest.mark.parametrize("name", ["upper17", "arm6"])
def test_a_fixed_base_is_solved_too(get_robot, name):
    robot = get_robot(name)
    both = Both(robot, (), [[FrameTask(robot.hands[0])]])
    answer = both.at(random_state(robot, 0, speed=0.2))
    whole = both.solve_whole()
    assert both.program.second_solution is None
    assert not whole.relaxed
    assert relative(answer.acceleration, whole.x) < TOLERANCE


def test_a_state_without_inertia_or_numbers_gives_a_solution_that_failed(get_robot):
    robot = get_robot("humanoid33")
    frames = stances(robot)["double support"]
    both = Both(robot, frames, [balance(robot), free_hands(robot, frames)])
    state = near_home(robot, 0)
    state.v[:] = np.nan
    both.dynamics.update(state)
    both.program.assemble(both.dynamics)
    assert not both.program.solve().status.ok
    assert both.at(near_home(robot, 0)).status.ok


def assigned(robot, frames, task):
    task.bind(robot)
    assignment = assign(task, robot, Partitions(robot).of(frames))
    return assignment.first.tolist(), assignment.second.tolist()


def test_tasks_go_where_what_they_need_is_decided(get_robot):
    robot = get_robot("humanoid33")
    both = tuple(robot.soles)
    one = both[:1]
    six = list(range(6))
    assert assigned(robot, both, ComTask()) == ([0, 1, 2], [])
    assert assigned(robot, both, MomentumTask("angular_xy")) == ([0, 1], [])
    assert assigned(robot, both, FrameTask(robot.pelvis)) == (six, [])
    assert assigned(robot, both, FrameTask("left_hand")) == ([], six)
    # The swing foot is decided by LQP 1 in double support, and by the chain in single support.
    assert assigned(robot, both, FrameTask("right_sole")) == (six, [])
    assert assigned(robot, one, FrameTask("right_sole")) == ([], six)
    assert assigned(robot, both, RelativeFrameTask("left_sole", "right_sole")) == (six, [])
    assert assigned(robot, both, RelativeFrameTask("left_hand", "right_hand")) == ([], six)
    held = (*both, "left_hand")
    assert assigned(robot, held, FrameTask("torso")) == (six, [])
    assert assigned(robot, held, RelativeFrameTask("left_hand", "torso")) == (six, [])
    joints = ["left_knee", "neck_yaw", "right_knee"]
    assert assigned(robot, both, JointTask(joints)) == ([0, 2], [1])
    first, second = assigned(robot, both, PostureTask())
    assert (len(first), len(second)) == (12, 21)


class _Own(Task):
    """Rows that the library does not know: `rows(dynamics)` gives Jacobian and drift."""

    def __init__(self, rows):
        super().__init__("mine", kp=30.0, kd=None, weight=np.array([2.0, 1.0, 0.5]))
        self._rows = rows

    def _resolve(self, robot):
        return 3

    def _evaluate(self, dynamics):
        self.jacobian, self.drift = self._rows(dynamics)
        self.error = np.array([0.01, -0.02, 0.005])
        self.error_rate = -self.jacobian @ dynamics.state.v
        return np.zeros(3)


def of_com(dynamics):
    return dynamics.com_jacobian.copy(), dynamics.com_bias


def of_hand_against_com(dynamics):
    hand = dynamics.frame(dynamics.robot.frame_id("left_hand"))
    return hand.jacobian[:3] - dynamics.com_jacobian, hand.bias[:3] - dynamics.com_bias


def of_sole(dynamics):
    foot = dynamics.frame(dynamics.robot.frame_id("left_sole"))
    return foot.jacobian[:3], foot.bias[:3]


@pytest.mark.parametrize("rows", [of_com, of_hand_against_com, of_sole])
@pytest.mark.parametrize("above", [True, False])
def test_a_users_own_kind_of_task_is_solved_whatever_it_needs(get_robot, rows, above):
    """The centroids alone, both chains at once, or no unconstrained chain at all."""
    robot = get_robot("humanoid33")
    frames = stances(robot)["left support" if rows is not of_sole else "double support"]
    if rows is of_sole:
        frames = frames[1:]
    pelvis, hands = FrameTask(robot.pelvis, "orientation"), free_hands(robot, frames)
    levels = [[_Own(rows), pelvis], hands] if above else [[pelvis], hands, [_Own(rows)]]
    both, compared = Both(robot, frames, levels), 0
    for seed in SEEDS[:4]:
        answer = both.at(near_home(robot, seed, spread=0.1, speed=0.05))
        whole = both.solve_whole()
        if both.program.second_solution is not None or whole.relaxed:
            continue
        compared += 1
        for actual, wanted in zip(both.of(both.point(answer)), both.of(whole.x), strict=True):
            assert relative(actual, wanted) < TOLERANCE
    assert compared > 0
