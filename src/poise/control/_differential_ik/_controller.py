"""`DifferentialIK`: prioritised joint velocities."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float64, Int64

from poise._checks import Numbers, checked_kind, checked_number
from poise.control._command import Command, CommandStatus
from poise.control._differential_ik._bounds import VelocityBounds, limit_weights
from poise.control._differential_ik._closed_form import RANK
from poise.control._differential_ik._formulation import (
    HomeJacobians,
    RowWeights,
    VelocityFormulation,
    velocity_gain,
)
from poise.control._differential_ik._hierarchy import VelocityHierarchy
from poise.control._differential_ik._within_bounds import solve_within_bounds
from poise.control._fallback import VelocityFallback
from poise.control._osf import RankTreatment
from poise.control._ticking import TickingController
from poise.dynamics import RobotState
from poise.errors import ConfigurationError, UnknownNameError
from poise.hqp import HierarchicalProblem, SolveStatus
from poise.robots import Robot
from poise.stack import Contact, Stack, Task, checked_gain

METHODS = ("closed_form", "hqp")
"""How the levels are solved, by name."""

_EXACT = 2
"""Levels that the closed form meets exactly: held contacts, and the first of the user's."""

_BOUND_TOLERANCE = 1e-6
"""How far outside its bounds a QP may leave a joint before its answer is refused [rad/s]."""


class DifferentialIK(TickingController[Float64[np.ndarray, " n"] | None]):
    """Tasks in strict priority in, joint velocities out: prioritised differential kinematics.

    After Zhang and Kikuuwe, "COM Shifter and Body Rotator for Step-by-Step Teleoperation of Bipedal
    Robots", sections 2.3 and 3.4, for any number of levels of the tasks that the torque controllers
    use. A floating base is taken to stand on one contact, the stance, which does not move; other
    active contacts are held above all tasks. A task asks for its target's velocity plus kp / kd
    times its error, or for what `Task.set_velocity` gave it.

    "closed_form" meets the first level by a right inverse and those below by SR-inverses, with
    joints near their limits weighed down; joints that would leave their limits are held. "hqp"
    solves the hierarchical QP with hard position and velocity limits.

    `step` never raises. A state that is not finite gives the last good velocities decayed to a
    stop, and says so in the command's status.

    Args:
        robot: the robot.
        stack: contacts and tasks; `default_stack(robot)` when None. Of its joint limit the
            positions and the velocity scale count.
        dt: control period, over which a velocity is held [s].
        method: one of `METHODS`.
        joints: names of the joints that may move, the others have velocity zero; all when None.
        stance: name of the contact that the robot stands on, as long as it is active; the first
            active one of the stack when None.
        speeds: largest norm of the velocity that a task asks for, by its name: one number, or one
            for each of its blocks (position [m/s], then orientation [rad/s]).
        limit_time: time in which no joint may go farther than its limit [s], see
            `VelocityBounds`; at least `dt`, which is what a shorter one counts as.
        rank: what happens where an exact level loses rank; `RANK` when None.

    Attributes:
        weights: W_A, by task; may be changed every tick.

    Raises:
        PoiseError: a name that the robot does not have, a floating base without a surface contact,
            or a setting that cannot be right.
    """

    def __init__(
        self,
        robot: Robot,
        stack: Stack | None = None,
        *,
        dt: float,
        method: str = "closed_form",
        joints: Sequence[str] | None = None,
        stance: str | None = None,
        speeds: Mapping[str, Numbers] | None = None,
        limit_time: float = 0.1,
        rank: RankTreatment | None = None,
    ) -> None:
        super().__init__(robot, stack)
        self.dt = checked_number(dt, "dt of the controller [s]", above=0.0)
        if method not in METHODS:
            raise UnknownNameError("no such method", got=method, choices=METHODS)
        self.method = method
        self.rank = checked_kind(rank or RANK, RankTreatment, "rank of the controller")
        _check_gains(self.stack)
        self.weights = RowWeights(self.stack)
        self._speeds = _checked_speeds(speeds or {}, self.stack)
        self._joints = _joint_indices(robot, joints)
        limit_time = checked_number(limit_time, "limit_time of the controller [s]")
        self._bounds = VelocityBounds(
            robot, self.stack.joint_limit, max(self.dt, limit_time), self._joints
        )
        self._q_index = self._joints + (robot.nq - robot.nj)
        self._home = HomeJacobians(robot, self.stack)
        self._stances = [c for c in self.stack.contacts if c.dim == 6]
        if robot.floating_base and not self._stances:
            raise ConfigurationError(
                "a floating base needs something to stand on",
                got=[c.name for c in self.stack.contacts],
                wanted="a stack with a surface contact",
            )
        self._named: Contact | None = None
        self._prepared: dict[
            tuple[Contact | None, ...], tuple[VelocityFormulation, VelocityHierarchy | None]
        ] = {}
        self._stance = self._stances[0] if robot.floating_base else None
        self.set_stance(stance)
        self._current = self._prepare()
        self.reset()

    @property
    def stance(self) -> Contact | None:
        """The contact that the robot was taken to stand on at the last tick; None for none."""
        return self._stance

    @property
    def formulation(self) -> VelocityFormulation:
        """Rows of the last tick."""
        return self._current[0]

    @property
    def problem(self) -> HierarchicalProblem | None:
        """The hierarchical problem of the last tick by "hqp"; None in closed form."""
        hierarchy = self._current[1]
        return None if hierarchy is None else hierarchy.problem

    @property
    def suspended(self) -> tuple[Task, ...]:
        """Tasks that a contact stands in for at the last tick."""
        return self._current[0].suspended

    @property
    def size(self) -> tuple[int, int]:
        """Number of joints that may move, and of rows, their bounds among them."""
        joints = len(self._joints)
        return joints, joints + len(self.formulation.velocity)

    @property
    def joint_weights(self) -> Float64[np.ndarray, " n"]:
        """W_B of the last tick, of the joints that may move."""
        return self._joint_weight.copy()

    def set_stance(self, name: str | None) -> None:
        """Chooses the contact that the robot stands on, from the next tick.

        Args:
            name: name of a surface contact of the stack, which counts as long as it is active; None
                for the first active one.

        Raises:
            ConfigurationError: no such contact, one that does not hold all six directions, or a
                robot whose base does not move.
        """
        if name is None:
            self._named = None
            return
        contact = self.stack.contact(name)
        if contact not in self._stances or not self.robot.floating_base:
            raise ConfigurationError(
                "nothing can stand on this contact",
                got=name,
                wanted="a surface contact of a robot with a floating base",
                choices=[c.name for c in self._stances],
            )
        self._named = contact

    def reset(self) -> None:
        """Forgets the last command and targets taken from the robot.

        Contacts stay as loaded as they are.
        """
        super().reset()
        self._fallback = VelocityFallback(self.robot)
        self._missing = np.zeros(len(self.formulation.velocity))
        self._last = np.zeros(len(self._joints))
        self._held = np.zeros(len(self._joints), dtype=np.bool_)
        self._joint_weight = np.ones(len(self._joints))
        for _, hierarchy in self._prepared.values():
            if hierarchy is not None:
                hierarchy.reset()

    def _tick(self, state: RobotState) -> Command:
        # What a user asks for may be beyond all numbers; the check of the result finds it.
        with np.errstate(all="ignore"):
            return super()._tick(state)

    def _prepare(self) -> tuple[VelocityFormulation, VelocityHierarchy | None]:
        # Kept per stance and set of contacts: switching back to one allocates nothing.
        active = [c for c in self.stack.contacts if c.active]
        self._stance = self._find_stance(active)
        key = (self._stance, *active)
        pair = self._prepared.get(key)
        if pair is None:
            formulation = VelocityFormulation(
                self.stack,
                self._stance,
                [c for c in active if c is not self._stance],
                self._joints,
                speeds=self._speeds,
                home=self._home,
            )
            names = [self.robot.joint_names[i] for i in self._joints]
            pair = (
                formulation,
                VelocityHierarchy(formulation, names) if self.method == "hqp" else None,
            )
            self._prepared[key] = pair
        return pair

    def _find_stance(self, active: list[Contact]) -> Contact | None:
        if not self.robot.floating_base:
            return None
        if self._named is not None and self._named.active:
            return self._named
        # In flight the last stance stands for lack of a better one.
        return next((c for c in active if c.dim == 6), self._stance)

    def _switch(self) -> tuple[Task, ...]:
        current = self._prepare()
        if current is self._current:
            return ()
        self._current = current
        return current[0].suspended

    def _assemble(self) -> None:
        self.formulation.fill(self.dynamics)

    def _solve(self) -> Float64[np.ndarray, " n"] | None:
        """Velocities of the joints that may move; None where the QP has no answer."""
        formulation, hierarchy = self._current
        bounds, joints = self._bounds, self.dynamics.state.q[self._q_index]
        lower, upper = bounds.at(joints)
        if hierarchy is not None:
            solution = hierarchy.solve(lower, upper)
            usable = solution.status in (SolveStatus.OPTIMAL, SolveStatus.INACCURATE)
            outside = np.maximum(solution.x - upper, lower - solution.x).max()
            if not usable or not outside <= _BOUND_TOLERANCE:
                return None
            return np.minimum(np.maximum(solution.x, lower), upper)
        # By the last command: the sign of a measured velocity is noise where a joint rests.
        self._joint_weight = limit_weights(joints, self._last, bounds.q_min, bounds.q_max)
        u, self._held = solve_within_bounds(
            formulation.levels,
            self._joint_weight,
            lower,
            upper,
            exact=_EXACT,
            rank=self.rank,
        )
        return u

    def _command(self, answer: Float64[np.ndarray, " n"] | None, state: RobotState) -> Command:
        if answer is None or not math.isfinite(np.add.reduce(answer)):
            return self._safe(CommandStatus.SOLVER_FAILED, state)
        formulation = self.formulation
        self._missing = formulation.jacobian @ answer
        self._missing -= formulation.velocity
        velocity = np.zeros(self.robot.nj)
        velocity[self._joints] = answer
        self._last = answer
        self._fallback.remember(velocity, state.time)
        return Command(status=CommandStatus.OK, velocity=velocity, residuals=self._residuals())

    def _residuals(self) -> tuple[float, ...]:
        """Joint limits, which always hold, then contacts, then the user's levels."""
        found, start = [0.0], 0
        for level in self.formulation.levels:
            stop = start + len(level.velocity)
            missing = self._missing[start:stop]
            asked = math.sqrt(level.velocity.dot(level.velocity))
            found.append(math.sqrt(missing.dot(missing)) / max(1.0, asked))
            start = stop
        return tuple(found)

    def _task_residuals(self) -> dict[str, float]:
        return {
            task.name: float(np.linalg.norm(self._missing[rows]))
            for task, rows in self.formulation.task_rows
        }

    def _explain(self) -> str:
        formulation, hierarchy = self._current
        notes: list[str] = []
        if formulation.stance is not None and not formulation.stance.active:
            notes.append(f"no contact is active: {formulation.stance.name} still counts as stance")
        if hierarchy is not None and hierarchy.solution is not None:
            notes.append(hierarchy.solution.explain(hierarchy.problem))
        names = [self.robot.joint_names[i] for i in self._joints[self._held]]
        if names:
            notes.append("held at their limits: " + ", ".join(names))
        return "; ".join(notes) or "contacts and limits hold"

    def _safe(self, status: CommandStatus, state: object) -> Command:
        time = state.time if isinstance(state, RobotState) else None
        return Command(status=status, velocity=self._fallback.velocity(time))


def _joint_indices(robot: Robot, names: Sequence[str] | None) -> Int64[np.ndarray, " n"]:
    if names is None:
        return np.arange(robot.nj)
    if isinstance(names, str) or not names:
        raise ConfigurationError(
            "joints of the controller are no list of names", got=names, wanted="joint names"
        )
    index = sorted(robot.joint_index(name) for name in names)
    if len(set(index)) != len(index):
        raise ConfigurationError("the controller's joints name one twice", got=list(names))
    return np.array(index, dtype=np.int64)


def _check_gains(stack: Stack) -> None:
    for _, task in stack.tasks():
        if np.any((task.kp > 0.0) & (task.kd == 0.0)) or not np.isfinite(velocity_gain(task)).all():
            raise ConfigurationError(
                f"task {task.name!r} has no damping, and its velocity is kp / kd times its error",
                got=task.kd.tolist(),
                wanted="kd > 0",
            )


def _checked_speeds(
    speeds: Mapping[str, Numbers], stack: Stack
) -> dict[str, Float64[np.ndarray, " b"]]:
    found: dict[str, Float64[np.ndarray, " b"]] = {}
    for name, value in speeds.items():
        task = stack.task(name)
        what = f"largest speed of task {name!r}"
        found[name] = checked_gain(value, len(task.blocks), what)
        if found[name].min() <= 0.0:
            raise ConfigurationError(f"{what} must be positive", got=value, wanted="> 0")
    return found
