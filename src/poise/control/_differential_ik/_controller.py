"""`DifferentialIK`: prioritised joint velocities, in closed form or by a hierarchical QP.

`VelocityHierarchy`: the levels as a hierarchical QP with hard joint limits.
"""

from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np
from jaxtyping import Float64, Int64

from poise._checks import Numbers, checked_kind, checked_number
from poise.control._controller import Controller
from poise.control._differential_ik._bounds import LedJoints, VelocityBounds, limit_weights
from poise.control._differential_ik._closed_form import RANK, ClosedForm, WithinBounds
from poise.control._differential_ik._kernels import NO_VELOCITY
from poise.control._differential_ik._rows import (
    ROW_WEIGHT,
    HomeJacobians,
    RowWeights,
    VelocityRows,
)
from poise.control._rank import RankTreatment
from poise.control._strategy import (
    PHYSICS_LEVELS,
    UNSOFTENED,
    USABLE,
    Answer,
    bound_stack,
    softening_notes,
)
from poise.dynamics import Dynamics
from poise.errors import ConfigurationError, UnknownNameError
from poise.hqp import HierarchicalProblem, SoftenedSolver, Solution, SolveStatus, make_solver
from poise.robots import Robot
from poise.stack import Contact, ContactSets, Stack, Task

STRATEGIES = ("closed_form", "hqp")
"""Methods of solving the levels, by name."""


class VelocityHierarchy:
    """Levels over joint velocities, solved exactly within their bounds.

    level 1   bounds of the joint velocities
    level 2   contacts that are held stay where they are
    level     J u >= bound, the self-collision limit, where there is one
    level 3.. the user's tasks
    cost      |u|^2
    """

    def __init__(
        self,
        rows: VelocityRows,
        joint_names: list[str],
        joints: Int64[np.ndarray, " n"],
        dt: float,
    ) -> None:
        stack_rows = rows.stack_rows
        limits, (contacts, *sizes) = (
            stack_rows.limits,
            [len(level.velocity) for level in rows.levels],
        )
        levels = len(sizes)
        self.problem = HierarchicalProblem.allocate(
            len(joint_names),
            [0, contacts, *(limit.dim for limit in limits), *sizes],
            names=[
                "joint limits",
                "contacts",
                *(limit.name for limit in limits),
                *stack_rows.level_names[:levels],
            ],
            labels=[
                [],
                stack_rows.motion_labels,
                *(limit.labels for limit in limits),
                *stack_rows.task_labels[:levels],
            ],
        )
        # Sources of the problem's rows: those of limits stand behind the others.
        bounded = stack_rows.collision_rows
        behind = np.arange(bounded.start, bounded.stop)
        self._order = np.insert(np.arange(contacts + sum(sizes)), contacts, behind)
        self._first, self._bounded = PHYSICS_LEVELS + len(limits), contacts + np.arange(len(behind))
        self.unnumbered = range(PHYSICS_LEVELS, self._first)
        self.problem.labels[:1] = [(f"limit of {name}", 1) for name in joint_names]
        self.solution: Solution | None = None
        self._rows, self._joints = rows, joints
        self._softening = softening = stack_rows.softening
        softening.read_from(stack_rows.evaluation.rows, velocities=True)
        self._reference, self._rest = (
            np.zeros(len(joints)),
            np.zeros(len(softening.terms.reference)),
        )
        softened = [level for level in softening.levels if level < levels]
        self._solver = SoftenedSolver(
            self.problem,
            make_solver(),
            {level: self._first + level for level in softened},
            range(len(joints)),
            weights=softening.terms.weights[: len(softened)],
            reference=self._reference,
            find=self._find_terms,
            exact=softening.exact and levels == len(stack_rows.levels),
            tolerance=UNSOFTENED * dt,
            make_solver=make_solver,
        )

    def solve(self, lower: Float64[np.ndarray, " n"], upper: Float64[np.ndarray, " n"]) -> Solution:
        problem = self.problem
        problem.x_lower[:], problem.x_upper[:] = lower, upper
        problem.A[:] = self._rows.jacobian[self._order]
        problem.lower[problem.n :] = problem.upper[problem.n :] = self._rows.velocity[self._order]
        problem.upper[problem.n + self._bounded] = np.inf
        for i, level in enumerate(self._rows.levels[1:]):
            weights = problem.level(self._first + i).weights
            np.sqrt(level.weight / ROW_WEIGHT, out=weights)
        self._solver.run()
        self.solution = self._solver.report()
        return self.solution

    def _find_terms(self, u: Float64[np.ndarray, " n"]) -> float:
        terms, rest = self._softening.terms, self._rest
        self._softening.find(rest, rest, 0)
        self._reference[:] = terms.reference[self._joints]
        off = u - self._reference
        return float(terms.weights[: len(self._solver.softened)].max(initial=0.0)) * float(
            np.sqrt(off.dot(off))
        )

    @property
    def softened(self) -> dict[int, float]:
        return self._softening.by_level(self._solver.softened)

    def reset(self) -> None:
        self._solver.reset()
        self.solution = None


_Prepared = tuple[VelocityRows, VelocityHierarchy | None]
"""Rows of one stance and set of contacts, and their problem where there is one."""


class VelocityStrategy:
    """Joint velocities of a stack; a `Strategy`, see `DifferentialIK`."""

    commands: Literal["torque", "velocity"] = "velocity"
    kept = ("named", "stance", "_last")

    def __init__(
        self,
        robot: Robot,
        stack: Stack,
        strategy: str,
        stance: str | None,
        joints: Int64[np.ndarray, " n"],
        led: LedJoints,
        bounds: VelocityBounds,
        rank: RankTreatment,
        dt: float,
    ) -> None:
        if strategy not in STRATEGIES:
            raise UnknownNameError("no such strategy", got=strategy, choices=STRATEGIES)
        self.robot, self.stack, self.name = robot, stack, strategy
        self._joints, self._led, self._bounds, self._dt = joints, led, bounds, dt
        self._within = WithinBounds(ClosedForm(len(joints), rank))
        self._q_index = joints + (robot.nq - robot.nj)
        self._home = HomeJacobians(robot, stack)
        self.weights = RowWeights(stack)
        self._stances = [c for c in stack.contacts if c.dim == 6]
        if robot.floating_base and not self._stances:
            raise ConfigurationError(
                "a floating base needs something to stand on",
                got=[c.name for c in stack.contacts],
                wanted="a stack with a surface contact that holds all of its frame's motion",
            )
        self.named: Contact | None = None
        self.set_stance(stance)
        self.stance = self._stances[0] if robot.floating_base else None
        self._prepared = {
            stance: self._prepare_for(stance)
            for stance in (self._stances if robot.floating_base else (None,))
        }
        self._current = self._find(stack.active_contacts)
        self.reset()
        # What is compiled is compiled now, not in the first tick.
        limit_weights(bounds.q_min, self._last, bounds.q_min, bounds.q_max)

    @property
    def current(self) -> VelocityRows:
        """Rows of the last tick."""
        return self._current[0]

    @property
    def problem(self) -> HierarchicalProblem | None:
        """The hierarchical problem of the last tick by "hqp"; None in closed form."""
        hierarchy = self._current[1]
        return None if hierarchy is None else hierarchy.problem

    @property
    def suspended(self) -> tuple[Task, ...]:
        return self.current.stack_rows.suspended

    @property
    def softened(self) -> dict[int, float]:
        """Weight of each softened level's term, counted from zero; none in closed form."""
        hierarchy = self._current[1]
        return hierarchy.softened if hierarchy is not None and self._solved else {}

    @property
    def size(self) -> tuple[int, int]:
        """Number of joints that are solved for, and of rows, their bounds among them."""
        joints = len(self._joints)
        return joints, joints + len(self.current.velocity)

    @property
    def joint_weights(self) -> Float64[np.ndarray, " n"]:
        """W_B of the last tick, of the joints that are solved for."""
        return self._joint_weight.copy()

    def set_stance(self, name: str | None) -> None:
        if name is None:
            self.named = None
            return
        contact = self.stack.contact(name)
        if contact not in self._stances or not self.robot.floating_base:
            raise ConfigurationError(
                "nothing can stand on this contact",
                got=name,
                wanted="a surface contact of a robot with a floating base",
                choices=[c.name for c in self._stances],
            )
        self.named = contact

    def reset(self) -> None:
        self._solved = False
        self._last = np.zeros(len(self._joints))
        self._held = np.zeros(len(self._joints), dtype=np.bool_)
        self._joint_weight = np.ones(len(self._joints))
        for sets in self._prepared.values():
            for _, hierarchy in sets:
                if hierarchy is not None:
                    hierarchy.reset()

    def prepare(self, contacts: tuple[Contact, ...]) -> bool:
        last, self._current = self._current, self._find(contacts)
        return self._current is not last

    def rehearse(self, dynamics: Dynamics) -> None:
        self.assemble(dynamics)
        self.solve()
        self.reset()

    def assemble(self, dynamics: Dynamics) -> None:
        # Targets may overflow; the check of the result finds it.
        with np.errstate(all="ignore"):
            self.current.fill(dynamics)
            self._q = dynamics.state.q[self._q_index]
            self._lower, self._upper = self._bounds.at(self._q)

    def solve(self) -> Answer:
        """Find velocities of all joints; zero where they are neither solved for nor of `led`."""
        rows, hierarchy = self._current
        with np.errstate(all="ignore"):
            status, u = self._in_closed_form() if hierarchy is None else self._by_qp(hierarchy)
            found = rows.stack_rows.measure(u, rows.jacobian).tolist()
        self._solved = True
        velocity = np.zeros(self.robot.nj)
        velocity[self._joints], velocity[self._led.index] = u, rows.led_velocity
        if status in USABLE and np.isfinite(np.add.reduce(u)):
            self._last = u
        # Joint limits always hold.
        return Answer(status, velocity, (0.0, *found))

    def task_residuals(self) -> dict[str, float]:
        return self.current.stack_rows.task_residuals() if self._solved else {}

    def explain(self) -> str:
        rows, hierarchy = self._current
        notes: list[str] = []
        if rows.stance is not None and not rows.stance.active:
            notes.append(f"no contact is active: {rows.stance.name} still counts as stance")
        if hierarchy is not None and hierarchy.solution is not None:
            notes.append(hierarchy.solution.explain(hierarchy.problem, hierarchy.unnumbered))
            notes += softening_notes(hierarchy.softened)
        held = *self._joints[self._held], *self._led.index[self._led.held]
        names = [self.robot.joint_names[i] for i in held]
        if names:
            notes.append("held at their limits: " + ", ".join(names))
        return "; ".join(notes) or "contacts and limits hold"

    def _in_closed_form(self) -> tuple[SolveStatus, Float64[np.ndarray, " n"]]:
        bounds = self._bounds
        # By the last answer: the sign of a measured velocity is noise where a joint rests.
        self._joint_weight = limit_weights(self._q, self._last, bounds.q_min, bounds.q_max)
        bounds = self._joint_weight, self._lower, self._upper
        rows = self.current
        u, self._held = self._within.solve(rows.served, rows.joined, *bounds)
        return SolveStatus.OPTIMAL, u

    def _by_qp(self, hierarchy: VelocityHierarchy) -> tuple[SolveStatus, Float64[np.ndarray, " n"]]:
        lower, upper = self._lower, self._upper
        solution = hierarchy.solve(lower, upper)
        outside = np.maximum(solution.x - upper, lower - solution.x).max()
        status = solution.status if outside <= NO_VELOCITY else SolveStatus.FAILED
        return status, np.minimum(np.maximum(solution.x, lower), upper)

    def _find(self, contacts: tuple[Contact, ...]) -> _Prepared:
        if self.robot.floating_base:
            if self.named is not None and self.named.active:
                self.stance = self.named
            else:
                # In flight the last stance counts.
                self.stance = next((c for c in contacts if c.dim == 6), self.stance)
        return self._prepared[self.stance].of(contacts)

    def _prepare_for(self, stance: Contact | None) -> ContactSets[_Prepared]:
        def make(contacts: tuple[Contact, ...]) -> _Prepared:
            rows = VelocityRows(
                self.robot,
                self.stack,
                stance,
                [c for c in contacts if c is not stance],
                self._joints,
                self._led,
                home=self._home,
            )
            if self.name != "hqp":
                return rows, None
            names = [self.robot.joint_names[i] for i in self._joints]
            return rows, VelocityHierarchy(rows, names, self._joints, self._dt)

        return ContactSets(self.stack, make)


class DifferentialIK(Controller):
    """Joint velocities of tasks in strict priority: prioritised differential kinematics.

    After Zhang and Kikuuwe, "COM Shifter and Body Rotator for Step-by-Step Teleoperation of Bipedal
    Robots", sections 2.3 and 3.4, for any number of levels of the tasks that the torque controllers
    use. A floating base is assumed to stand on one contact, the stance, which does not move; other
    active contacts are held above all tasks. The velocity of a task is its target's plus kp / kd
    times its error, within its `speed`, or that of `Task.set_velocity`.

    Joints of the joint tasks in `led` follow those alone, within their limits; all other tasks are
    served by the other joints, which compensate.

    "closed_form" meets the first level by a right inverse and those below by SR-inverses, with
    joints near their limits weighed down; joints that would leave their limits are held. "hqp"
    solves the hierarchical QP with hard position and velocity limits.

    `step` never raises. For a state that is not finite it returns the last good velocities decayed
    to a stop, with that status.

    Args:
        robot: the robot.
        stack: contacts and tasks; `default_stack(robot)` when None. Of its joint limit only
            positions and velocity scale are used.
        dt: control period, over which a velocity is held [s].
        strategy: "closed_form" or "hqp".
        joints: names of the joints that are solved for, the others have velocity zero, or are led;
            all that are not led when None.
        led: names of joint tasks whose joints are led, in levels of their own below all others.
        stance: name of the contact that the robot stands on, as long as it is active; the first
            active one of the stack when None.
        limit_time: time in which no joint may go farther than its limit [s], see
            `VelocityBounds`; `dt` where that is longer.
        rank: treatment of exact levels that lose rank; `RANK` when None.
        dynamics: shared with the estimator of the state, see `Controller`; its own when None.

    Attributes:
        ROW_WEIGHT: W_A of a row whose task has weight one; with weight w it is w^2 times that.
        dt: control period [s].

    Raises:
        PoiseError: a name that the robot does not have, a floating base without a surface contact,
            or a setting that cannot be right.
    """

    ROW_WEIGHT: ClassVar = ROW_WEIGHT

    def __init__(
        self,
        robot: Robot,
        stack: Stack | None = None,
        *,
        dt: float,
        strategy: str = "closed_form",
        joints: Sequence[str] | None = None,
        led: Sequence[str] = (),
        stance: str | None = None,
        limit_time: float = 0.1,
        rank: RankTreatment | None = None,
        dynamics: Dynamics | None = None,
    ) -> None:
        stack = bound_stack(robot, stack)
        self.dt = checked_number(dt, "dt of the controller [s]", above=0.0)
        limit_time = checked_number(limit_time, "limit_time of the controller [s]")
        _check_gains(stack)
        limit_time = max(self.dt, limit_time)
        leads = LedJoints(robot, stack, led, limit_time)
        index = _joint_indices(robot, joints, leads)
        bounds = VelocityBounds(robot, stack.joint_limit, limit_time, index)
        self._velocities = VelocityStrategy(
            robot,
            stack,
            strategy,
            stance,
            index,
            leads,
            bounds,
            checked_kind(rank or RANK, RankTreatment, "rank of the controller"),
            self.dt,
        )
        super().__init__(self._velocities, dynamics=dynamics)

    @property
    def strategy(self) -> VelocityStrategy:
        """Rows, and by "hqp" the problem, of the last tick."""
        return self._velocities

    @property
    def weights(self) -> RowWeights:
        """W_A, by task; may be changed every tick."""
        return self._velocities.weights

    @property
    def joint_weights(self) -> Float64[np.ndarray, " n"]:
        """W_B of the last tick, of the joints that are solved for."""
        return self._velocities.joint_weights

    @property
    def stance(self) -> Contact | None:
        """The assumed stance contact of the last tick; None for none."""
        return self._velocities.stance

    def set_gains(self, task: str, kp: Numbers | None = None, kd: Numbers | None = None) -> None:
        """Set stiffness and damping of a task, from the next tick.

        Args:
            task: its name in the stack.
            kp: stiffness, one number or one a row [1/s^2]; as it is when None.
            kd: damping, positive where there is stiffness [1/s]; critical, 2 sqrt(kp), when None.

        Raises:
            ConfigurationError: wrong length, or gains that are not finite, negative, or without
                damping; they stay as they were.
            UnknownNameError: no such task.
        """
        changed = self.stack.task(task)
        before = changed.kp.copy(), changed.kd.copy()
        super().set_gains(task, kp, kd)
        try:
            _check_gains(self.stack)
        except ConfigurationError:
            changed.set_gains(*before)
            raise

    def set_stance(self, name: str | None) -> None:
        """Set the contact that the robot stands on, from the next tick.

        Args:
            name: name of a surface contact of the stack, which counts as long as it is active; None
                for the first active one.

        Raises:
            ConfigurationError: no such contact, one that does not hold all six directions, or a
                robot whose base does not move.
        """
        self._velocities.set_stance(name)


def _joint_indices(
    robot: Robot, names: Sequence[str] | None, led: LedJoints
) -> Int64[np.ndarray, " n"]:
    if names is None:
        names = [name for i, name in enumerate(robot.joint_names) if i not in led.index]
    if isinstance(names, str) or not names:
        raise ConfigurationError(
            "joints of the controller are no list of names", got=names, wanted="joint names"
        )
    index = sorted(robot.joint_index(name) for name in names)
    if len(set(index)) != len(index):
        raise ConfigurationError("the controller's joints name one twice", got=list(names))
    both = [robot.joint_names[i] for i in index if i in led.index]
    if both:
        raise ConfigurationError("joints are led and solved for", got=both, wanted="either")
    return np.array(index, dtype=np.int64)


def _check_gains(stack: Stack) -> None:
    for _, task in stack.tasks():
        if np.any((task.kp > 0.0) & (task.kd == 0.0)) or not np.isfinite(task.velocity_gain).all():
            raise ConfigurationError(
                f"task {task.name!r} has no damping, and its velocity is kp / kd times its error",
                got=task.kd.tolist(),
                wanted="kd > 0",
            )
