"""`Contact`: a place where the robot touches the world and may push against it."""

import math
from abc import ABC, abstractmethod

import numpy as np
from jaxtyping import Float64, Int64

from poise._checks import Numbers, checked_kind, checked_number
from poise._compiled import part
from poise.dynamics import (
    BIAS,
    ROTATION,
    VELOCITY,
    StateNumbers,
    column_at,
    place_frame,
)
from poise.errors import ConfigurationError
from poise.robots import FULL_TILT, Robot
from poise.stack._axes import checked_target, split_rows
from poise.stack._bound_once import BoundOnce
from poise.stack._owner import Owner
from poise.stack._tables import Line, StackNumbers

_ROUNDING = 1e-9
"""Load left that is the sum's rounding, not a tick's part of the ramp."""

MAX_LOAD_FACTOR = 5.0
"""A loaded contact may carry this many times the robot's weight: no bound in practice."""


class Contact(Owner, BoundOnce, ABC):
    """A unilateral frictional contact at a frame whose z axis is the contact normal.

    Wrenches act on the robot, at the frame's origin, along the frame's own axes, so that the cone
    `C F <= 0` is constant; on an edge the origin is there. The contact frame does not accelerate:
    J dv + drift = -damping velocity, equation (2) of Ahn et al. 2024 with a damping that keeps a
    foot from creeping; `set_acceleration` adds an acceleration to the right-hand side.

    Args:
        frame: the frame in contact, such as "left_sole".
        friction: Coulomb coefficient.
        damping: how fast a residual velocity of the contact dies out [1/s].
        min_load: least normal force of a loaded contact, by the robot's weight.
        dim: length of the wrench.
        name: what reports call it.

    Attributes:
        name: what reports call it.
        frame: the frame in contact.
        dim: length of the wrench.
        chosen: which components of the frame's motion and of the wrench these are.
        cone: C, constant, one-sided rows C F <= 0.
        jacobian: maps `v` to the contact's velocity, along the contact's axes.
        drift: its classical acceleration at zero `dv`.
        reference: reference acceleration of the contact.
    """

    def __init__(
        self,
        frame: str,
        *,
        friction: float,
        damping: float,
        min_load: float,
        dim: int,
        name: str | None,
    ) -> None:
        self.frame = checked_kind(frame, str, "frame of a contact")
        self.name = name or frame
        self._friction = checked_number(friction, f"friction of contact {self.name!r}", above=0.0)
        self._min_load = checked_number(min_load, f"min_load of contact {self.name!r}")
        if self._min_load >= 0.5:
            raise ConfigurationError(
                f"min_load of contact {self.name!r} is out of range",
                got=min_load,
                wanted="a fraction of the weight below 0.5",
            )
        self._hold(np.arange(dim), damping)
        # The load moves linearly to its goal, from the first `advance` on.
        self._load = self._goal = 1.0
        self._rate = math.inf
        self._time: float | None = None
        self._bounded_load = math.nan

    def _hold(self, components: Int64[np.ndarray, " dim"], damping: float) -> None:
        """Make room for the rows of some components of the frame's motion and of the wrench."""
        self.chosen, self.dim = components, len(components)
        self.cone: Float64[np.ndarray, "rows dim"] = np.zeros((0, self.dim))
        self.reference: Float64[np.ndarray, " dim"] = np.zeros(self.dim)
        # Damping, lower and upper bounds of the wrench, `pressure_reach`, `edge_distance`, and the
        # acceleration that is asked for.
        self.parameters: Float64[np.ndarray, " p"] = np.zeros(4 + 3 * self.dim)
        self.set_damping(damping)
        self.wrench_lower[:], self.wrench_upper[:] = -np.inf, np.inf
        self.wrench_lower[2] = 0.0

    def _bind(self, robot: Robot) -> None:
        self.frame_ids = (robot.frame_id(self.frame),)
        components = self._held_components(robot)
        if not np.array_equal(components, self.chosen):
            self._hold(components, self.damping)
        self._weight = robot.weight
        self.jacobian: Float64[np.ndarray, "dim nv"] = np.zeros((self.dim, robot.nv))
        self.drift: Float64[np.ndarray, " dim"] = np.zeros(self.dim)
        self.cone = self._make_cone(robot)
        shape = np.shape(self.cone)
        if len(shape) != 2 or shape[0] == 0 or shape[1] != self.dim:
            raise ConfigurationError(
                f"cone of contact {self.name!r} has the wrong shape",
                got=shape,
                wanted=f"(rows, {self.dim}) with at least one row, such as that of f_z >= 0",
            )
        self._whole = self.cone.copy()

    @property
    def _title(self) -> str:
        return f"contact {self.name!r}"

    def __repr__(self) -> str:
        loaded = "loaded" if self.active else "free"
        return f"{type(self).__name__}({self.name!r}, friction={self.friction:g}, {loaded})"

    @property
    def friction(self) -> float:
        """Coulomb coefficient; constant, because the cone is computed from it at construction."""
        return self._friction

    @property
    def min_load(self) -> float:
        """Least normal force of the loaded contact, by the robot's weight."""
        return self._min_load

    @property
    def damping(self) -> float:
        """Decay rate of a residual velocity [1/s]; `set_damping` changes it."""
        return float(self.parameters[0])

    def set_damping(self, damping: float) -> None:
        """Set how fast a residual velocity of the contact dies out, from the next tick.

        Args:
            damping: [1/s].

        Raises:
            ConfigurationError: it is negative or not finite.
        """
        self.parameters[0] = checked_number(damping, f"damping of contact {self.name!r} [1/s]")

    @property
    def wrench_lower(self) -> Float64[np.ndarray, " dim"]:
        """Simple lower bounds on the wrench [N, N m], a view of the solver's."""
        return self.parameters[1 : 1 + self.dim]

    @property
    def wrench_upper(self) -> Float64[np.ndarray, " dim"]:
        """Simple upper bounds on the wrench [N, N m], a view of the solver's."""
        return self.parameters[1 + self.dim : 1 + 2 * self.dim]

    @property
    def pressure_reach(self) -> Float64[np.ndarray, "2"]:
        """Largest distance of the CoP from the frame's origin along its x and y [m].

        Zero for a point; made with the cone, a view of what the balance limit reads.
        """
        return self.parameters[1 + 2 * self.dim : 3 + 2 * self.dim]

    @property
    def edge_distance(self) -> float:
        """From the frame's origin to either of the edges on which a leaning sole stands [m].

        Zero for a contact that does not roll; made with the cone.
        """
        return float(self.parameters[3 + 2 * self.dim])

    @property
    def acceleration(self) -> Float64[np.ndarray, " dim"]:
        """Acceleration beside the damping [m/s^2, rad/s^2]; `set_acceleration` changes it."""
        return self.parameters[4 + 2 * self.dim :].copy()

    def set_acceleration(self, acceleration: Numbers) -> None:
        """Set an acceleration of the contact, from the next tick on.

        J dv + drift = acceleration - damping velocity. A sole that is flat on the ground does not
        follow, at little cost: only the inertia of the foot is accelerated in the model. A lightly
        loaded sole, on an edge or just off the ground, can be turned by it.

        Args:
            acceleration: of the components that the contact holds (`chosen`), along its own axes,
                linear first [m/s^2, rad/s^2].

        Raises:
            TargetError: not so many finite numbers.
        """
        what = f"acceleration of contact {self.name!r} [m/s^2, rad/s^2]"
        self.parameters[4 + 2 * self.dim :] = checked_target(acceleration, self.dim, what)

    @property
    def active(self) -> bool:
        """True where the contact may bear load; an inactive one does not constrain the robot."""
        return self._load > 0.0 or self._goal > 0.0

    @property
    def metric(self) -> Float64[np.ndarray, "dim dim"]:
        """Metric of a wrench by the bounds of the contact: F^T metric F [N^2].

        C^T C, each row of the cone over its bound at unit normal force, over the number of rows: a
        moment counts as the normal force with which it takes the pressure to an edge, of all of the
        surface: where only half of one carries an edge goes through the frame's origin.
        """
        rows = self._whole / -self._whole[:, 2:3]
        return rows.T @ rows / len(rows)

    @property
    def blocks(self) -> tuple[int, ...]:
        """Sizes of the blocks of rows that share a unit: force rows, then moment rows."""
        return split_rows(self.chosen)

    def release(self, duration: float = 0.2) -> None:
        """Unload the contact: its normal force bound ramps to zero, then it turns inactive.

        Args:
            duration: length of the ramp [s].

        Raises:
            ConfigurationError: a negative or non-finite duration.
        """
        self._move_load(0.0, checked_number(duration, "duration of a contact's release [s]"))

    def engage(self, duration: float = 0.2) -> None:
        """Load the contact: it turns active, and its normal force bound ramps up from zero.

        Args:
            duration: length of the ramp [s].

        Raises:
            ConfigurationError: a negative or non-finite duration.
        """
        self._move_load(1.0, checked_number(duration, "duration of a contact's engagement [s]"))

    def _move_load(self, goal: float, duration: float) -> None:
        self._goal, self._time = goal, None
        self._rate = abs(goal - self._load) / duration if duration > 0.0 else math.inf

    def pause(self, time: float) -> None:
        """Hold the load ramp while there is no command; it goes on afterwards.

        Args:
            time: time of the state [s].
        """
        if self._time is not None:
            self._time = max(self._time, time)

    def advance(self, time: float) -> None:
        """Move the load ramp on to a time and sets the bounds of the wrench.

        Args:
            time: time of the state [s].
        """
        left = self._goal - self._load
        if left != 0.0:
            # Time counts forwards only: a clock that jumps back does not stop the ramp.
            elapsed = 0.0 if self._time is None else max(time - self._time, 0.0)
            self._time = time
            if math.isinf(self._rate) or self._rate * elapsed >= abs(left) - _ROUNDING:
                self._load = self._goal
            else:
                self._load += math.copysign(self._rate * elapsed, left)
        if self._load == self._bounded_load:
            return
        self._bounded_load = load = self._load
        # Where it may bear nothing yet, bounds say so of the whole wrench: found by the rows of the
        # cone, of which any five would do, the same answer takes a long search.
        most = np.inf if load > 0.0 else 0.0
        self.wrench_lower[:], self.wrench_upper[:] = -most, most
        # During a ramp the weight is the scale: a foot seldom carries more while it is unloaded.
        factor = MAX_LOAD_FACTOR if load >= 1.0 else load
        self.wrench_upper[2] = factor * self._weight
        # A foot that is asked for no force at all lifts off at the first model error.
        self.wrench_lower[2] = min(load, self._min_load) * self._weight

    def _held_components(self, robot: Robot) -> Int64[np.ndarray, " dim"]:  # noqa: ARG002
        """Components of the frame's motion that the contact holds on a robot."""
        return self.chosen

    @abstractmethod
    def _make_cone(self, robot: Robot) -> Float64[np.ndarray, "rows dim"]:
        """Return the constant rows C of C F <= 0, at least one.

        A contact whose pressure moves over an area fills `pressure_reach`, too; without it the
        balance limit counts one point.
        """


@part
def contact_rows(state: StateNumbers, assembly: StackNumbers, line: Line) -> None:
    """A contact's frame along its own axes, or its edge; parameters as `Contact` lays them out."""
    motion, owners, rows, work, velocities = (
        state.motion,
        assembly.owners,
        assembly.rows,
        assembly.work,
        assembly.velocities,
    )
    frame, first, m = line.frame, line.first, line.dim
    frames, parameters, at = owners.frames, owners.parameters, line.start
    place_frame(motion, frames, frame, work, 0)
    _move_to_edge(parameters, at + 3 + 2 * m, work)
    for k in range(frames.starts[frame], frames.starts[frame + 1]):
        column = int(frames.columns[k])
        x = column_at(motion, column, work[0], work[1], work[2])
        for i in range(m):
            # Linear rows along the frame's axes, then angular ones.
            component = int(owners.chosen[line.chosen + i])
            o, axis = 3 * (component // 3), ROTATION + component % 3
            rows.matrix[rows.first + first + i, column] = (
                work[axis] * x[o] + work[axis + 3] * x[o + 1] + work[axis + 6] * x[o + 2]
            )
    for i in range(m):
        component = int(owners.chosen[line.chosen + i])
        drift, asks = work[BIAS + component], parameters[at + 4 + 2 * m + i]
        reference = asks - parameters[at] * work[VELOCITY + component]
        rows.drift[first + i], rows.reference[first + i] = drift, reference
        asked = 0.0 if velocities else reference - drift
        rows.target[first + i] = rows.upper[first + i] = asked
        rows.wrench_lower[first + i] = parameters[at + 1 + i]
        rows.wrench_upper[first + i] = parameters[at + 1 + m + i]


@part
def _move_to_edge(
    parameters: Float64[np.ndarray, " p"], edge: int, work: Float64[np.ndarray, " work"]
) -> None:
    """Move a frame aside to the lower edge of its sole, along its y, with velocity and bias."""
    tilt = work[ROTATION + 7]
    aside = -parameters[edge] * min(max(tilt / FULL_TILT, -1.0), 1.0)
    for i in range(3):
        work[i] += aside * work[ROTATION + 3 * i + 1]
    wx, wy, wz = work[VELOCITY + 3], work[VELOCITY + 4], work[VELOCITY + 5]
    work[VELOCITY] -= aside * wz
    work[VELOCITY + 2] += aside * wx
    work[BIAS] += aside * (wx * wy - work[BIAS + 5])
    work[BIAS + 1] -= aside * (wx * wx + wz * wz)
    work[BIAS + 2] += aside * (wy * wz + work[BIAS + 3])
