"""`BalanceLimit`: keeps the robot where its feet can still balance it, whatever the tasks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import Numbers, checked_kind, checked_number
from poise._compiled import part
from poise.dynamics import KINEMATICS, StateNumbers, momentum_rate, place_frame, turn_to_world
from poise.errors import ConfigurationError
from poise.robots import Robot, once_a_robot
from poise.stack._axes import checked_target
from poise.stack._bound_once import Limit
from poise.stack._contact import Contact
from poise.stack._joint_limit import viable_bounds
from poise.stack._owner import Owner
from poise.stack._points import clear, distance_motion, vector, write_distance
from poise.stack._support import (
    BASE,
    NEXT_STEP,
    TORQUES,
    BalanceSettings,
    balance_settings,
    edge_of,
    nearest_inside,
    outline_support,
)
from poise.stack._tables import WORK, Line, Rows, StackNumbers

MOST_EDGES = 12
"""Rows for edges of the support: two soles and a foothold have no more."""

FIRST_LEG = MOST_EDGES + 3
"""Rows of the edges, and of the angular momentum about the three axes."""

_STEP_DECAY = 60.0
"""Least decay while a step is announced [1/s]: a step takes the component to the next foothold at
its full speed, and the ZMP goes over to it within a tenth of a second."""

_COMEBACK = 12.0
"""Least rate at which the component comes back from beyond an edge [1/s]: a vertical that is off by
an angle pushes it out there by h angle omega / rate."""

_LOWEST = 0.1
"""Least height of the CoM over the contacts that is reckoned with [m]."""

_LEAST_ARM, _CATCHING, _MOST_ARM = 0.3, 10.0, 1.4
"""Part of the moment that remains where the component is on the edge; how much more there is, as an
arm, by how far it is outside, for hips need it to catch; and how much there is at most."""


class BalanceLimit(Limit):
    """Bounds that keep the DCM of a standing robot recoverable, whatever the tasks.

    At a height z over the feet, with omega^2 = g / z, the divergent component of motion
    xi = c + cdot / omega of the CoM c moves away from where the contacts press, p:

        xi_dot = cdot + cddot / omega = omega (xi - p)      while the angular momentum is constant

    p stays in the outline of the soles, as far as the legs' torques hold the weight there: a corner
    at which a leg cannot carry all of it counts as near to the sole's middle as it can, and with as
    much of the weight as it can while the next sole carries the rest (R. Orsolino et al. 2020,
    "Feasible region: an actuation-aware extension of the support region"); and as far as the next
    sole carries its least load meanwhile. So a robot is lost once xi has left it for good, and what
    moves the CoM moves xi. In every tick xi_dot, linear in the accelerations, is bounded. With
    n x <= h the edges of where the component is caught, the outline of the soles that carry,
    `margin` inside, and of the foothold that `expect_step` announces,

        n xi_dot <= max(d (h - n xi), omega n (xi - r))            for each edge

        r = P_soles(xi + e / omega (xi - P_caught(xi)))            P: the nearest point of a polygon

    with d = decay inside and d = e, 12 /s or decay, beyond. Inside, xi may approach an edge as
    fast as would bring it there in 1 / decay, and at an edge not move out. Beyond, it has to come
    back at the rate e, as far as the soles can make it. A vertical that is off by an angle puts the
    ZMP off by z times that, 1 cm at 0.6 m and 1 degree: xi then rests z angle omega / e beyond an
    edge, and `margin` is what the soles have left to hold it there.

    These bounds are never infeasible for the soles: p = r lies in them and meets all edges at once,
    for n xi_dot = omega n (xi - r) is then the second term of each. And they are exact: inside,
    r = xi, so that rest is allowed everywhere; where p has nothing left, on the outermost edge of
    the soles, the least that it can do, xi_dot = 0, is the most that is allowed. They hold for xi
    as it is measured, whatever moved it.

    Angular momentum L about the CoM moves p as well, and only the soles can take it away again:
    a lean to one side by a force beyond the component on that side, with a moment of m g a at most,
    where a is how far the edges are from xi there. So

        |L_dot| <= m g a (1 - |L| / (m g a stop_time))      for each axis and sense of L, with its a

    lets arms and trunk be thrown as hard as the soles can bear, and no farther than they can stop
    within `stop_time`. a is at most how far the edges are from the middle, which it is about the
    vertical, and 0.3 of that at least. Outside it grows with the way back, up to 1.4 times, for
    then hips catch the robot. L_dot = 0 always meets it.

    Each sole's leg is kept between a least and a largest distance of hip and ankle, by the
    viability bounds that `JointLimit` has: a straight knee lifts nothing any more, and what is
    folded deeper hardly comes up again.

    The rows are a level of inequalities of their own, below contacts and joint limits and above all
    tasks; where joints or torques at their limits leave a row unmet, it is missed by as little as
    can be. A robot that is not on the ground, or leans on a wall, or whose contacts make no area,
    has rows for its legs alone; one with a fixed base has none. Its settings are read-only:
    construct a new controller for another limit.

    Args:
        enabled: False takes the limit away.
        margin: distance kept from the edges that the centre of pressure can reach, at most half of
            what there is [m].
        decay: how fast the distance to an edge may be used up [1/s].
        stop_time: in which the soles could stop the angular momentum that is allowed [s].
        leg_min: least distance of hip and ankle, by that of a straight leg.
        leg_max: largest distance of hip and ankle, by that of a straight leg; home is always
            allowed.
        braking: deceleration with which a leg plans to stop before its bounds [m/s^2].

    Attributes:
        name: what reports call it.
        enabled: True where the limit has rows.
        margin: distance kept from the edges that the centre of pressure can reach [m].
        decay: largest rate at which the distance to an edge is used up [1/s].
        stop_time: in which the soles could stop the angular momentum that is allowed [s].
        leg_min: least distance of hip and ankle, by that of a straight leg.
        leg_max: largest distance of hip and ankle, by that of a straight leg.
        parameters: what the compiled rows read; the array stays the same.
    """

    enabled: bool
    margin: float
    decay: float
    stop_time: float
    leg_min: float
    leg_max: float
    parameters: Float64[np.ndarray, " p"]

    def __init__(
        self,
        *,
        enabled: bool = True,
        margin: float = 0.02,
        decay: float = 4.0,
        stop_time: float = 0.15,
        leg_min: float = 0.75,
        leg_max: float = 0.99,
        braking: float = 3.0,
    ) -> None:
        name = "balance limit"
        self._braking = checked_number(braking, f"braking of the {name} [m/s^2]", above=0.0)
        self._set(
            name=name,
            enabled=checked_kind(enabled, bool, f"enabled of the {name}"),
            margin=checked_number(margin, f"margin of the {name} [m]"),
            decay=checked_number(decay, f"decay of the {name} [1/s]", above=0.0),
            stop_time=checked_number(stop_time, f"stop_time of the {name} [s]", above=0.0),
            leg_min=checked_number(leg_min, f"leg_min of the {name}", above=0.0),
            leg_max=checked_number(leg_max, f"leg_max of the {name}", above=leg_min),
        )
        if self.leg_max > 1.0:
            raise ConfigurationError(
                f"leg_max of the {name} is beyond a straight leg", got=leg_max, wanted="<= 1"
            )

    def _bind(self, robot: Robot) -> None:
        legs = _legs_of(robot)
        self._legs = {leg.sole: leg for leg in legs}
        # A contact counts that may carry half the weight; legs have the horizon of the joints.
        settings = BalanceSettings(
            decay=self.decay,
            margin=self.margin,
            least_load=0.5 * robot.weight,
            braking=self._braking,
            horizon=0.02,
            stop_time=self.stop_time,
        )
        no_step = [np.nan] * (TORQUES - NEXT_STEP)
        bounds = [x for leg in legs for x in leg.bounds(self.leg_min, self.leg_max)]
        self._set(parameters=np.array([*settings, *no_step, *robot.tau_max, *bounds]))

    def expect_step(self, corners: Numbers | None) -> None:
        """Set the next foothold, towards which the component may leave the soles.

        A walk lets the robot fall from one foot to the next on purpose. Its leader sets where
        it is caught, from the tick in which a foot is unloaded until the next one carries, and
        again whenever the foothold moves.

        Args:
            corners: x and y of the four corners of the foothold in the world, in any order [m];
                None where no step is under way, as at first.

        Raises:
            TargetError: wrong shape, NaN or infinite.
            ConfigurationError: the limit serves no robot yet.
        """
        _ = self.robot  # it may serve none yet, and this says so
        place = self.parameters[NEXT_STEP:TORQUES]
        if corners is None:
            place[:] = np.nan
        else:
            what = "corners of the next foothold [m]"
            place[:] = checked_target(np.ravel(np.asarray(corners, dtype=float)), 8, what)

    def reset(self) -> None:
        """Forget the next foothold."""
        if self._robot is not None:
            self.expect_step(None)

    def rows_for(self, contacts: Sequence[Contact]) -> "BalanceRows | None":
        """The rows for a set of active contacts; None where there is nothing to keep.

        Args:
            contacts: bound to the robot that the limit serves.
        """
        stands = self._robot is not None and self._robot.floating_base
        if not (self.enabled and stands and contacts):
            return None
        legs = [self._legs[c.frame] for c in contacts if c.frame in self._legs]
        return BalanceRows(self, legs, len(contacts))


class BalanceRows(Owner):
    """The rows of a balance limit for a set of active contacts: edges, angular momentum, legs.

    Attributes:
        name: what reports call them.
        labels: names of the rows.
        edge_distances: of the divergent component from each edge, infinite where there is none
            [m]; a view that the next evaluation overwrites.
    """

    def __init__(self, limit: BalanceLimit, legs: Sequence["_Leg"], contacts: int) -> None:
        self.name, self.parameters = limit.name, limit.parameters
        self.dim = FIRST_LEG + len(legs)
        self.labels = [(f"{limit.name}: edge of the support", MOST_EDGES)]
        self.labels += [(f"{limit.name}: angular momentum", FIRST_LEG - MOST_EDGES)]
        self.labels += [(f"{limit.name}: leg of {leg.sole}", 1) for leg in legs]
        self.room = WORK + 2 * contacts
        self.frame_ids = tuple(i for leg in legs for i in leg.frame_ids)
        self.chosen = np.array([leg.index for leg in legs], dtype=np.int64)
        self.edge_distances: Float64[np.ndarray, " edges"] = np.full(MOST_EDGES, np.inf)

    def view(self, rows: Rows, own: slice, nv: int) -> None:
        """Take views of its rows as its attributes."""
        super().view(rows, own, nv)
        self.edge_distances = rows.error[own][:MOST_EDGES]


@dataclass(frozen=True)
class _Leg:
    """Hip and ankle of a sole's leg: frames and distances [m]."""

    sole: str
    index: int
    frame_ids: tuple[int, int]
    home: float
    # The farthest that any one joint of the leg takes the ankle, the others as at home.
    straight: float

    def bounds(self, shortest: float, longest: float) -> tuple[float, float]:
        """Bounds of the distance of hip and ankle, within which home always lies [m]."""
        return min(shortest * self.straight, self.home), max(longest * self.straight, self.home)


@once_a_robot
def _legs_of(robot: Robot) -> tuple[_Leg, ...]:
    """The legs of a robot's soles that can shorten; none where the base is fixed."""
    legs: list[_Leg] = []
    for sole in robot.soles if robot.floating_base else ():
        leg = _measure(robot, sole, len(legs))
        if leg is not None:
            legs.append(leg)
    return tuple(legs)


def _measure(robot: Robot, sole: str, index: int) -> _Leg | None:
    """A leg; None where no joint changes the distance of hip and ankle."""
    model, data = robot.model, robot.model.createData()
    parent = model.frames[robot.frame_id(sole)].parentJoint
    joints = [j for j in model.supports[parent].tolist() if j > 1]
    if not joints:
        return None
    ends = joints[0], joints[-1]

    def length(q: Float64[np.ndarray, " nq"]) -> float:
        pin.forwardKinematics(model, data, q)
        hip, ankle = (data.oMi[j].translation for j in ends)
        return float(np.linalg.norm(hip - ankle))

    def lengths(joint: int, angles: int = 61) -> Iterator[float]:
        k, q = model.joints[joint].idx_q, robot.q_home.copy()
        i = k - (robot.nq - robot.nj)
        for q[k] in np.linspace(robot.q_min[i], robot.q_max[i], angles):
            yield length(q)

    hip, ankle = (model.getFrameId(model.names[j], pin.FrameType.JOINT) for j in ends)
    reached = [distance for joint in joints for distance in lengths(joint)]
    straight = max(reached)
    # What is less is rounding of the coordinates.
    if straight - min(reached) < 1e-9:
        return None
    return _Leg(sole, index, (hip, ankle), length(robot.q_home), straight)


@part
def bound_balance(state: StateNumbers, assembly: StackNumbers, line: Line) -> None:
    """Bounds of the rows: edges of the support, angular momentum, then one row for each leg."""
    clear(assembly, line.first, line.dim, len(state.v))
    _bound_edges(state, assembly, line)
    for leg in range(line.dim - FIRST_LEG):
        _bound_leg(state, assembly, line, leg)


@part
def _bound_edges(state: StateNumbers, assembly: StackNumbers, line: Line) -> None:
    v, motion, owners, rows = state.v, state.motion, assembly.owners, assembly.rows
    outer, height = outline_support(state, assembly, line, 0)
    inner, _ = outline_support(state, assembly, line, 1)
    if min(len(outer), len(inner)) < 3:
        return
    height = max(motion.com[2] - height, _LOWEST)
    decay = balance_settings(owners.parameters, line.start).decay
    if not np.isnan(owners.parameters[line.start + NEXT_STEP]):
        decay = max(decay, _STEP_DECAY)
    omega = sqrt(-motion.gravity[2] / height)
    speed_x = speed_y = 0.0
    for k in range(len(v)):
        speed_x += motion.momentum[k, 0] * v[k] / motion.mass[0]
        speed_y += motion.momentum[k, 1] * v[k] / motion.mass[0]
    xi_x, xi_y = motion.com[0] + speed_x / omega, motion.com[1] + speed_y / omega
    near_x, near_y = nearest_inside(inner, xi_x, xi_y)
    comeback = max(decay, _COMEBACK)
    back = comeback / omega
    zmp_x, zmp_y = nearest_inside(
        outer, xi_x + back * (xi_x - near_x), xi_y + back * (xi_y - near_y)
    )
    work = assembly.work
    momentum_rate(motion, work, 0)
    for i in range(len(inner)):
        nx, ny, h = edge_of(inner, i)
        left = h - nx * xi_x - ny * xi_y
        place = _rank_among_nearest(inner, i, left, xi_x, xi_y)
        if place >= MOST_EDGES:
            continue
        # The component may approach the edge, or do what the ZMP cannot keep it from.
        rate = decay * left if left > 0.0 else comeback * left
        rate = max(rate, omega * (nx * (xi_x - zmp_x) + ny * (xi_y - zmp_y)))
        row = line.first + place
        reference = omega * (rate - nx * speed_x - ny * speed_y)
        drift = (nx * work[0] + ny * work[1]) / motion.mass[0]
        rows.upper[row] = reference - drift
        rows.reference[row], rows.drift[row], rows.error[row] = reference, drift, left
        for k in range(len(v)):
            rows.matrix[rows.first + row, k] = (
                nx * motion.momentum[k, 0] + ny * motion.momentum[k, 1]
            ) / motion.mass[0]
    _bound_momentum(state, assembly, line, inner, (xi_x, xi_y), height)


@part
def _rank_among_nearest(
    hull: Float64[np.ndarray, "k 2"], edge: int, left: float, x: float, y: float
) -> int:
    """The place of an edge: its own, or that in the order of distance where there are too many."""
    if len(hull) <= MOST_EDGES:
        return edge
    nearer = 0
    for i in range(len(hull)):
        nx, ny, h = edge_of(hull, i)
        other = h - nx * x - ny * y
        if other < left or (other == left and i < edge):
            nearer += 1
    return nearer


@part
def _bound_momentum(
    state: StateNumbers,
    assembly: StackNumbers,
    line: Line,
    hull: Float64[np.ndarray, "k 2"],
    xi: tuple[float, float],
    height: float,
) -> None:
    """The angular momentum about the CoM, as the acceleration that as much force gave it."""
    v, motion, rows, work = state.v, state.motion, assembly.rows, assembly.work
    mx = my = 0.0
    for i in range(len(hull)):
        mx += hull[i, 0] / len(hull)
        my += hull[i, 1] / len(hull)
    arm = np.inf
    # The least distance of an edge from the middle of the corners.
    for i in range(len(hull)):
        nx, ny, h = edge_of(hull, i)
        arm = min(arm, h - nx * mx - ny * my)
    weight = -motion.mass[0] * motion.gravity[2]
    stop = balance_settings(assembly.owners.parameters, line.start).stop_time
    scale = 1.0 / (motion.mass[0] * height)
    for i in range(3):
        row = line.first + MOST_EDGES + i
        momentum = 0.0
        for k in range(len(v)):
            momentum += motion.momentum[k, 3 + i] * v[k]
            rows.matrix[rows.first + row, k] = scale * motion.momentum[k, 3 + i]
        up = down = weight * arm
        if i < 2:
            # A lean to the left, about -x, is stopped by pressing to the left of the component.
            x, y = (0.0, -1.0) if i == 0 else (1.0, 0.0)
            up = weight * _stopping_arm(hull, xi, (x, y), arm)
            down = weight * _stopping_arm(hull, xi, (-x, -y), arm)
        rows.upper[row] = scale * (up * max(1.0 - momentum / (up * stop), 0.0) - work[3 + i])
        rows.target[row] = scale * (-down * max(1.0 + momentum / (down * stop), 0.0) - work[3 + i])


@part
def _stopping_arm(
    hull: Float64[np.ndarray, "k 2"],
    xi: tuple[float, float],
    way: tuple[float, float],
    most: float,
) -> float:
    """Reach of the soles beyond the component, one way, which stops a lean that way [m].

    Where the component is outside, a lean in that direction returns it.
    """
    least = np.inf
    for i in range(len(hull)):
        nx, ny, h = edge_of(hull, i)
        along = nx * way[0] + ny * way[1]
        # Edges along the way, but for rounding, are never met.
        if along > 1e-9:
            least = min(least, (h - nx * xi[0] - ny * xi[1]) / along)
    if least < 0.0:
        return min(_MOST_ARM * most, _LEAST_ARM * most - _CATCHING * least)
    return min(most, max(least, _LEAST_ARM * most))


@part
def _bound_leg(state: StateNumbers, assembly: StackNumbers, line: Line, leg: int) -> None:
    """The distance of a hip from its ankle, by its acceleration along the line between them."""
    motion, owners, rows, work = state.motion, assembly.owners, assembly.rows, assembly.work
    parameters, frames = owners.parameters, (line.frame + 2 * leg, line.frame + 2 * leg + 1)
    for side in range(2):
        place_frame(motion, owners.frames, frames[side], work, side * KINEMATICS)
        turn_to_world(work, side * KINEMATICS)
    points = (vector(work, 0), vector(work, KINEMATICS))
    length, n, _, speed, drift = distance_motion(work, (0, KINEMATICS), points)
    torques = len(motion.columns) - BASE
    limits = line.start + TORQUES + torques + 2 * owners.chosen[line.chosen + leg]
    settings = balance_settings(parameters, line.start)
    lowest, highest = viable_bounds(
        length - float(parameters[limits]),
        float(parameters[limits + 1]) - length,
        speed,
        np.inf,
        (np.inf, settings.horizon, settings.braking),
    )
    row = line.first + FIRST_LEG + leg
    rows.drift[row] = drift
    rows.target[row], rows.upper[row] = lowest - drift, highest - drift
    write_distance(state, assembly, row, frames, points, n)
