"""`FullProblem`: the conventional whole-body problem over accelerations and wrenches.

`SoftenedFull`: a solver of it that softens the levels of its stack.
"""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float64

from poise._compiled import MemoryBlock, compiled, view
from poise.control._strategy import PHYSICS_LEVELS, UNSOFTENED
from poise.dynamics import Dynamics, StateNumbers
from poise.hqp import HierarchicalProblem, SoftenedSolver, Solver
from poise.robots import Robot
from poise.stack import AT_BOUND, Contact, Stack, StackRows, any_dynamics, find_softening

_WRENCH_COST, _UNEVEN = 1e-4, 0.1
"""Final cost of a wrench, by the metric of its contact, against the acceleration energy; and the
factor of normal forces in it: feet share their load before the pressure goes to the edge of either,
where a sole that does not quite lie on its ground turns over.

It only chooses among the internal forces that every level leaves free; it stands in the final
cost, below all levels, so it takes nothing from a task."""


def wrench_cost(contacts: Sequence[Contact]) -> Float64[np.ndarray, "w w"]:
    """Return the final cost of the wrenches of contacts, one after the other."""
    size = sum(contact.dim for contact in contacts)
    cost, start = np.zeros((size, size)), 0
    for contact in contacts:
        block = slice(start, start := start + contact.dim)
        metric = contact.metric
        metric[2, 2] *= _UNEVEN
        cost[block, block] = _WRENCH_COST * metric
    return cost


class FullProblem:
    """Rows of section 2 and Table 1 of Ahn et al. 2024 for one set of active contacts.

    Variables are x = [dv; F], torques follow from the actuated rows (7):

        level 1   M_u dv - J_c,u^T F = -h_u                    base dynamics (6)
                  tau_min - h_l <= M_l dv - J_c,l^T F <= tau_max - h_l, by the tick's bounds
        level 2   J_c dv = reference - drift                   stationary contacts (2)
                  C F <= 0                                     contact wrench cones (3)
                  bounds on joint accelerations and normal forces
        level     J dv <= bound                                balance and self-collision limit
        levels    J dv = reference - drift                     the user's tasks (4)
        cost      dv^T M dv / 2, the acceleration energy (27)

    Wrenches act on the robot, which turns the sign of the paper's F_c. Rows of contacts and tasks
    are written by `StackRows`, straight into this problem.
    """

    def __init__(self, robot: Robot, stack: Stack, contacts: Sequence[Contact]) -> None:
        cones = sum(len(c.cone) for c in contacts)
        self.rows = rows = StackRows(
            robot, stack, contacts, own_rows=cones, balance="before", collisions="before"
        )
        self._nv, self._base = robot.nv, robot.base_dofs
        # The level of limits between physics and tasks.
        self.unnumbered = [PHYSICS_LEVELS] if rows.limits else []
        self.velocity = np.zeros(robot.nv)
        self.problem = problem = self._allocate(robot, rows)
        nv, n = robot.nv, problem.n
        self._wrenches = [
            (contact.name, slice(nv + own.start, nv + own.stop))
            for contact, own in zip(rows.contacts, rows.wrench_slices, strict=True)
        ]
        problem.labels[:1] = _bound_labels(robot, rows)
        problem.H[nv:, nv:] = wrench_cost(contacts)
        # The stack's rows begin where the dynamics' end, and the bounds on x precede them all.
        stacked = slice(n + nv, None)
        rows.write_into(
            problem.A,
            nv,
            (problem.lower[stacked], problem.upper[stacked]),
            problem.weights[stacked],
            (problem.x_lower[nv:], problem.x_upper[nv:]),
        )
        touch = problem.level(1)
        rows.write_cones_into(touch.A[rows.own_rows, nv:])
        touch.lower[rows.own_rows], touch.upper[rows.own_rows] = -np.inf, 0.0
        torque, joint = stack.torque_limit, stack.joint_limit
        self.numbers = self.numbers_with(
            (torque.tick_lower, torque.tick_upper), (joint.lower, joint.upper)
        )
        # What is compiled is compiled now, not in the first tick.
        home = any_dynamics(robot)
        fill(self.numbers.address, home.numbers.address)
        self.answer(np.zeros(n), home)

    def numbers_with(
        self,
        torques: tuple[Float64[np.ndarray, " nj"], Float64[np.ndarray, " nj"]],
        joints: tuple[Float64[np.ndarray, " nj"], Float64[np.ndarray, " nj"]],
    ) -> "FullNumbers":
        """Make the problem for compiled code, with bounds of torques and of joint accelerations."""
        problem = self.problem
        balance, first = self.rows.balance_rows, self.rows.evaluation.rows.first
        return FullNumbers(
            base=self._base,
            wrench_dim=self.rows.contact_rows.stop,
            A=problem.A,
            lower=problem.lower,
            upper=problem.upper,
            H=problem.H,
            torque_lower=torques[0],
            torque_upper=torques[1],
            joint_lower=joints[0],
            joint_upper=joints[1],
            point=np.zeros(problem.n),
            torque=np.zeros(len(torques[0])),
            balance_begin=first + balance.start,
            balance_end=first + balance.stop,
        )

    def fill(self, dynamics: Dynamics) -> None:
        """Write one state's rows into the problem."""
        self.velocity = dynamics.v
        self.rows.update(dynamics)
        fill(self.numbers.address, dynamics.numbers.address)

    def answer(
        self, x: Float64[np.ndarray, " n"], dynamics: Dynamics
    ) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " nj"], bool]:
        """Return a copy of a solution, its torques [N m], and True where the balance limit acts."""
        numbers = self.numbers
        numbers.point[:] = x
        held = answer(numbers.address, dynamics.numbers.address)
        return numbers.point.copy(), numbers.torque.copy(), held

    def wrenches(self, x: Float64[np.ndarray, "n ..."]) -> dict[str, Float64[np.ndarray, "m ..."]]:
        """Return the wrenches at each active contact of solutions, by the contact's name."""
        return {name: x[place] for name, place in self._wrenches}

    def task_residuals(self, slacks: Float64[np.ndarray, " nm"]) -> dict[str, float]:
        """Return the norm of each task's residual, by its name, from a solution's slacks."""
        return self.rows.task_residuals(slacks[self.problem.n + self._nv :])

    @staticmethod
    def _allocate(robot: Robot, rows: StackRows) -> HierarchicalProblem:
        wrench_dim, cones = rows.contact_rows.stop, len(rows.cone)
        torques = [(f"torque limit of {j}", 1) for j in robot.joint_names]
        limits = rows.limits
        # One level for both, whose rows are accelerations of lengths alike; none without any.
        size = [sum(limit.dim for limit in limits)] if limits else []
        name = [", ".join(limit.name for limit in limits)] if limits else []
        labels = [[label for limit in limits for label in limit.labels]] if limits else []
        return HierarchicalProblem.allocate(
            robot.nv + wrench_dim,
            [robot.nv, wrench_dim + cones, *size, *rows.level_sizes],
            names=["dynamics", "contacts", *name, *rows.level_names],
            labels=[
                [("base dynamics", robot.base_dofs), *torques],
                rows.motion_labels + rows.cone_labels,
                *labels,
                *rows.task_labels,
            ],
            bounds_level=1,
        )


class SoftenedFull(SoftenedSolver):
    """A solver of a full problem that softens the levels of its stack."""

    def __init__(self, full: FullProblem, make_solver: Callable[[], Solver]) -> None:
        softening, problem = full.rows.softening, full.problem
        first, base = len(problem.levels) - len(full.rows.levels), full.numbers.base

        terms = softening.terms

        def find(x: Float64[np.ndarray, " n"]) -> float:
            return find_softening(terms.address, full.velocity, x, base)

        super().__init__(
            problem,
            make_solver(),
            {level: first + level for level in softening.levels},
            range(base, base + len(terms.reference)),
            weights=terms.weights,
            reference=terms.reference,
            find=find,
            exact=softening.exact,
            tolerance=UNSOFTENED,
            make_solver=make_solver,
        )


class FullNumbers(MemoryBlock):
    """A `FullProblem` for compiled code."""

    base: int  # coordinates of the base
    wrench_dim: int  # length of all wrenches
    A: Float64[np.ndarray, "m n"]  # rows and bounds of the problem, and its final cost
    lower: Float64[np.ndarray, " nm"]
    upper: Float64[np.ndarray, " nm"]
    H: Float64[np.ndarray, "n n"]
    torque_lower: Float64[np.ndarray, " nj"]  # bounds of the tick [N m]
    torque_upper: Float64[np.ndarray, " nj"]
    joint_lower: Float64[np.ndarray, " nj"]  # bounds of the joint accelerations [rad/s^2]
    joint_upper: Float64[np.ndarray, " nj"]
    point: Float64[np.ndarray, " n"]  # solution
    torque: Float64[np.ndarray, " nj"]  # its torques [N m]
    balance_begin: int  # rows of A of the balance limit
    balance_end: int


@compiled
def fill(numbers_at: int, state_at: int) -> None:
    """Write all rows except those of the stack, which are already written."""
    p, state = view(FullNumbers, numbers_at), view(StateNumbers, state_at)
    M, h, A, H, lower, upper = state.M, state.h, p.A, p.H, p.lower, p.upper
    nv, n, base = len(h), len(H), p.base
    for i in range(nv):
        for k in range(nv):
            A[i, k] = M[i, k]
            H[i, k] = M[i, k]
        for k in range(p.wrench_dim):
            A[i, nv + k] = -A[nv + k, i]
    for i in range(base):
        lower[n + i] = upper[n + i] = -h[i]
    for i in range(nv - base):
        lower[n + base + i] = p.torque_lower[i] - h[base + i]
        upper[n + base + i] = p.torque_upper[i] - h[base + i]
        lower[base + i] = p.joint_lower[i]
        upper[base + i] = p.joint_upper[i]


@compiled
def answer(numbers_at: int, state_at: int) -> bool:
    """Find the torques of the point; return True where a row of the balance limit is active."""
    p, state = view(FullNumbers, numbers_at), view(StateNumbers, state_at)
    x, A, n = p.point, p.A, len(p.point)
    for i in range(len(p.torque)):
        row, total = A[p.base + i], state.h[p.base + i]
        for k in range(n):
            total += row[k] * x[k]
        p.torque[i] = total
    for i in range(p.balance_begin, p.balance_end):
        row, total = A[i], 0.0
        for k in range(n):
            total += row[k] * x[k]
        if max(total - p.upper[n + i], p.lower[n + i] - total) >= -AT_BOUND:
            return True
    return False


def _bound_labels(robot: Robot, rows: StackRows) -> list[tuple[str, int]]:
    labels = [("acceleration of the base", robot.base_dofs)]
    labels += [(f"joint limit of {j}", 1) for j in robot.joint_names]
    return [(name, count) for name, count in labels + rows.force_labels if count]
