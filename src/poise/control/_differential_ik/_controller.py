"""`DifferentialIK`: prioritised joint velocities."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from jaxtyping import Float64, Int64

from poise._checks import Numbers, checked_kind, checked_number
from poise.control._controller import Controller
from poise.control._differential_ik._bounds import LedJoints, VelocityBounds
from poise.control._differential_ik._closed_form import RANK
from poise.control._differential_ik._rows import ROW_WEIGHT, RowWeights
from poise.control._differential_ik._strategy import VelocityStrategy
from poise.control._rank import RankTreatment
from poise.control._strategy import bound_stack
from poise.dynamics import Dynamics
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack import Contact, Stack


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
