"""`Fallback`: a safe command for the ticks that have no answer.

`RateLimit`: bound on the change of a command from tick to tick.
`FallWatch`: detection of a robot that lies. `is_usable`: validation of a state.
"""

import math

import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int64

from poise._checks import Numbers, is_array, is_time, laid_out
from poise._compiled import compiled
from poise.dynamics import (
    LARGEST,
    Dynamics,
    Motion,
    PayloadEstimate,
    RobotState,
    frames_of,
    motion_of,
)
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack import SHORTEST_TICK, UNIT_TOLERANCE, TorqueLimit

DECAY_TIME = 0.1
"""Time constant with which the last good torque decays [s]."""

DAMPING_RATIO = 0.3
"""Damping torque at a joint's velocity limit, by its torque limit."""

STOP_TIME = 0.05
"""Time constant with which the last good velocities decay to a stop [s]."""


class Fallback:
    """The last good command, decayed towards a safe one; always finite and bounded.

    u = r u_last - (1 - r) D v with r = exp(-t / T) since the last good command; v is clipped to the
    joints' velocity limits and u to its own bounds. Before any good command u_last is zero. Torques
    decay towards damping, velocities, with D = 0, to a stop.
    """

    def __init__(
        self,
        robot: Robot,
        decay_time: float,
        damping: Float64[np.ndarray, " nj"],
        lower: Float64[np.ndarray, " nj"],
        upper: Float64[np.ndarray, " nj"],
    ) -> None:
        self._base, self._v_max = robot.base_dofs, robot.v_max
        self._decay_time, self._damping = decay_time, damping
        self._lower, self._upper = lower, upper
        self._last = np.zeros(robot.nj)
        self.reset()

    @staticmethod
    def of_torque(robot: Robot, limit: TorqueLimit) -> "Fallback":
        """Make one of torques, which decay towards damping of the joints."""
        damping = DAMPING_RATIO * robot.tau_max / robot.v_max
        return Fallback(robot, DECAY_TIME, damping, limit.lower, limit.upper)

    @staticmethod
    def of_velocity(robot: Robot) -> "Fallback":
        """Make one of velocities, which decay to a stop."""
        unbounded = np.full(robot.nj, np.inf)
        return Fallback(robot, STOP_TIME, np.zeros(robot.nj), -unbounded, unbounded)

    def reset(self) -> None:
        """Forget the last good command."""
        self._last[:] = 0.0
        self._time, self._elapsed = 0.0, 0.0

    def remember(self, command: Float64[np.ndarray, " nj"], time: float) -> None:
        """Copy a good command, with the time of its state [s]."""
        self._last[:] = command
        self._time, self._elapsed = time, 0.0

    def command(self, state: object) -> Float64[np.ndarray, " nj"]:
        """Return the safe command; each call counts as a tick."""
        v, time = (state.v, state.time) if isinstance(state, RobotState) else (None, None)
        ratio = self._ratio(time)
        command = ratio * self._last - (1.0 - ratio) * self._damping * self._joint_velocities(v)
        return np.clip(command, self._lower, self._upper)

    def _ratio(self, time: object) -> float:
        """Return the share of the last good command."""
        # Monotonic: a clock that steps back restores no torque, and one that stands still or is
        # not a number does not hold the last command for ever.
        self._elapsed += SHORTEST_TICK
        if is_time(time):
            self._elapsed = max(self._elapsed, time - self._time)
        return math.exp(-self._elapsed / self._decay_time)

    def _joint_velocities(self, v: object) -> Float64[np.ndarray, " nj"]:
        joints = np.zeros(len(self._last))
        size = self._base + len(joints)
        if isinstance(v, np.ndarray) and v.shape == (size,) and v.dtype.kind in "fiu":
            measured = v[self._base :]
            np.copyto(joints, measured, where=np.isfinite(measured))
            # A speed that no joint can have must not ask for full torque.
            np.clip(joints, -self._v_max, self._v_max, out=joints)
        return joints


DEFAULT_STEP = 0.1
"""Largest change of a torque in a tick, by its limit, where the user gives none."""


class RateLimit:
    """Moves along the straight line from the last command to the new one, as far as allowed.

    All joints go the same fraction of the line: torques that hold contacts and limits form a convex
    set at one state, so that what lies between two of them holds too.
    """

    def __init__(self, robot: Robot, bound: Numbers | None) -> None:
        values = np.asarray(DEFAULT_STEP * robot.tau_max if bound is None else bound, dtype=float)
        if values.shape not in ((), (robot.nj,)) or not np.all(values > 0.0):
            raise ConfigurationError(
                "torque_step of the controller is out of range",
                got=bound,
                wanted=f"a number > 0 [N m], or {robot.nj} of them",
            )
        self.bound: Float64[np.ndarray, " nj"] = np.broadcast_to(values, (robot.nj,)).copy()
        self._last: Float64[np.ndarray, " nj"] | None = None

    def limited(self, command: Float64[np.ndarray, " nj"]) -> Float64[np.ndarray, " nj"]:
        """Return the allowed command nearest to the given one."""
        last = self._last
        if last is not None:
            change = command - last
            ratio = float((np.abs(change) / self.bound).max())
            if ratio > 1.0:
                command = last + change / ratio
        self.remember(command)
        return command

    def remember(self, command: Float64[np.ndarray, " nj"]) -> None:
        """Copy the command of a tick."""
        self._last = command.copy()

    def reset(self) -> None:
        """Forget the last command: the next one is unlimited."""
        self._last = None


FALL_HEIGHT_RATIO = 0.25
"""Height of the pelvis over the lowest sole, by that at home, below which a robot lies; one that
squats or kneels is higher."""

_PATIENCE = 0.1
"""Time for which the pelvis has to be that low: one wrong measurement is no fall [s]."""


class FallWatch:
    """Fall detection by the height of the pelvis over the lowest sole, on any ground.

    Robots with a fixed base, or without soles, do not fall.
    """

    def __init__(self, robot: Robot, ratio: float | None) -> None:
        frames = [robot.frame_id(name) for name in (robot.pelvis, *robot.soles)]
        table = frames_of(robot.model, frames)
        self._joints, self._offsets = table.joints, table.placements[:, 9:].copy()
        self.can_fall = robot.floating_base and bool(robot.soles)
        self.height_ratio = ratio if self.can_fall else None
        data = robot.model.createData()
        pin.forwardKinematics(robot.model, data, robot.q_home)
        self._home = self._height(motion_of(robot.model, data))
        self.reset()

    def reset(self) -> None:
        """Assume that the robot stands."""
        self._low_since, self._now = math.nan, self._home

    def sees_fall(self, dynamics: Dynamics) -> bool:
        """Return True once the robot has lain for a while."""
        if self.height_ratio is None:
            return False
        self._now = self._height(dynamics.motion)
        if self._now > self.height_ratio * self._home:
            self._low_since = math.nan
            return False
        time = dynamics.state.time
        # A clock that jumped back restarts the count.
        if not self._low_since <= time:
            self._low_since = time
        return time - self._low_since >= _PATIENCE

    def describe(self) -> str:
        """Describe the fall."""
        return (
            f"the pelvis is {self._now:.2f} m over the lowest sole, {self._home:.2f} m at home:"
            " the robot has fallen"
        )

    def _height(self, motion: Motion) -> float:
        return _pelvis_over_soles(motion.placements, self._joints, self._offsets)


@compiled
def _pelvis_over_soles(
    placements: Float64[np.ndarray, "joints 12"],
    joints: Int64[np.ndarray, " frames"],
    offsets: Float64[np.ndarray, "frames 3"],
) -> float:
    """Return the height of the first frame over the lowest of the others [m]; 0 without others."""
    pelvis = lowest = 0.0
    for k in range(len(joints)):
        place = placements[joints[k]]
        # The third row of world_R_joint, which stands column by column, and the origin.
        x, y, z = offsets[k]
        height = place[2] * x + place[5] * y + place[8] * z + place[11]
        if k == 0:
            pelvis = lowest = height
        else:
            lowest = height if k == 1 else min(lowest, height)
    return pelvis - lowest


def is_usable(state: object, robot: Robot) -> bool:
    """Check kinds and sizes, finite and sane numbers, and the norm of the base quaternion."""
    if not isinstance(state, RobotState):
        return False
    q, v = state.q, state.v
    if not (is_array(q, robot.nq) and is_array(v, robot.nv) and is_time(state.time)):
        return False
    if not _is_payload(state.payload):
        return False
    return _is_sane(laid_out(q), laid_out(v), robot.floating_base)


def fault_of(state: object, robot: Robot) -> str:
    """Describe the fault of a state; "" for one that is usable."""
    if is_usable(state, robot):
        return ""
    if not isinstance(state, RobotState):
        return f"the state is of kind {type(state).__name__}, wanted RobotState"
    for name, value, size in (("q", state.q, robot.nq), ("v", state.v, robot.nv)):
        if not is_array(value, size):
            return f"{name} is {_kind(value)}, wanted {size} numbers"
    if not is_time(state.time):
        return f"the time is {state.time!r}, wanted seconds"
    if not _is_payload(state.payload):
        return f"the payload is of kind {type(state.payload).__name__}, wanted PayloadEstimate"
    for name, value, entries in (
        ("q", state.q, _entries(robot, robot.nq)),
        ("v", state.v, _entries(robot, robot.nv)),
    ):
        bad = np.flatnonzero(~(np.abs(value) <= LARGEST)).tolist()
        if bad:
            named = ", ".join(f"{entries[i]} is {value[i]:g}" for i in bad[:3])
            more = len(bad) - 3
            return f"in {name}, {named}" + (f" and {more} more" if more > 0 else "")
    norm = float(np.linalg.norm(state.q[3:7]))
    return f"the base quaternion q[3:7] has length {norm:g}, wanted 1"


@compiled
def _is_sane(
    q: Float64[np.ndarray, " nq"], v: Float64[np.ndarray, " nv"], floating_base: bool
) -> bool:
    """Check size and quaternion; NaN fails every comparison."""
    for numbers in (q, v):
        for i in range(len(numbers)):
            if not abs(numbers[i]) <= LARGEST:
                return False
    if not floating_base:
        return True
    square = q[3] * q[3] + q[4] * q[4] + q[5] * q[5] + q[6] * q[6]
    return abs(square - 1.0) < 2.0 * UNIT_TOLERANCE


def _kind(value: object) -> str:
    """Describe a value that is no vector."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and type {value.dtype}"
    return f"of kind {type(value).__name__}"


def _entries(robot: Robot, size: int) -> list[str]:
    """Name the entries of q or v: base by number, joints by name."""
    base = size - robot.nj
    return [f"entry {i} of the base" for i in range(base)] + list(robot.joint_names)


def _is_payload(value: object) -> bool:
    return value is None or isinstance(value, PayloadEstimate)
