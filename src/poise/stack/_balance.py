"""`BalanceLimit`: no task takes the robot where its feet can no longer catch it.

`BalanceRows`: its rows for one set of active contacts.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import Numbers, checked_kind, checked_number
from poise.errors import ConfigurationError
from poise.robots import Robot, once_a_robot
from poise.stack._axes import checked_target
from poise.stack._balance_kernels import FIRST_LEG, MOST_EDGES
from poise.stack._contact import Contact
from poise.stack._owner import Owner
from poise.stack._support_kernels import NEXT_STEP, TORQUES
from poise.stack._tables import Kind, Rows

_CARRYING = 0.5
"""A contact counts as soon as it may carry this part of the weight."""

_LEG_HORIZON = 0.02
"""Horizon of the legs' bounds, as of the joints' [s]."""

_SCAN = 61
"""Angles of each joint of a leg that are tried for its longest and shortest."""

_ROUNDING = 1e-9
"""Variation of a distance that is rounding of its coordinates [m]."""


class BalanceLimit:
    """Bounds that keep a robot on its feet catchable, whatever its tasks ask for.

    At a height z over the feet, with omega^2 = g / z, the divergent component of motion
    xi = c + cdot / omega of the COM c moves away from where the contacts press, p:

        xi_dot = cdot + cddot / omega = omega (xi - p)      while the angular momentum is constant

    p stays in the outline of the soles, as far as the legs' torques hold the weight there: a corner
    at which a leg cannot carry all of it counts as near to the sole's middle as it can, and with as
    much of the weight as it can while the next sole carries the rest (R. Orsolino et al. 2020,
    "Feasible region: an actuation-aware extension of the support region"); and as far as the next
    sole carries its least load meanwhile. So a robot is lost once xi has left it for good, and what
    moves the COM moves xi. In every tick xi_dot, linear in the accelerations, is bounded. With
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

    Angular momentum L about the COM moves p as well, and only the soles can take it away again:
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
    has rows for its legs alone; one with a fixed base has none. What it is made of is for reading:
    another limit makes another controller.

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
        parameters: what the compiled rows read; the array stays the same.
    """

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
        self.name = "balance limit"
        self._enabled = checked_kind(enabled, bool, "enabled of the balance limit")
        self._margin = checked_number(margin, "margin of the balance limit [m]")
        self._decay = checked_number(decay, "decay of the balance limit [1/s]", above=0.0)
        self._stop_time = checked_number(stop_time, "stop_time of the balance limit [s]", above=0.0)
        self._braking = checked_number(braking, "braking of the balance limit [m/s^2]", above=0.0)
        self._leg_min = checked_number(leg_min, "leg_min of the balance limit", above=0.0)
        self._leg_max = checked_number(leg_max, "leg_max of the balance limit", above=leg_min)
        if self._leg_max > 1.0:
            raise ConfigurationError(
                "leg_max of the balance limit is beyond a straight leg", got=leg_max, wanted="<= 1"
            )
        self._robot: Robot | None = None
        self.parameters: Float64[np.ndarray, " p"] = np.zeros(0)

    @property
    def enabled(self) -> bool:
        """True where the limit has rows."""
        return self._enabled

    @property
    def margin(self) -> float:
        """Distance kept from the edges that the centre of pressure can reach [m]."""
        return self._margin

    @property
    def decay(self) -> float:
        """Largest rate at which the distance to an edge is used up [1/s]."""
        return self._decay

    @property
    def stop_time(self) -> float:
        """In which the soles could stop the angular momentum that is allowed [s]."""
        return self._stop_time

    @property
    def leg_min(self) -> float:
        """Least distance of hip and ankle, by that of a straight leg."""
        return self._leg_min

    @property
    def leg_max(self) -> float:
        """Largest distance of hip and ankle, by that of a straight leg."""
        return self._leg_max

    def bind(self, robot: Robot) -> None:
        """Measure the legs of a robot; controllers call it before the first tick.

        Raises:
            ConfigurationError: the limit serves another robot.
        """
        if self._robot is robot:
            return
        if self._robot is not None:
            raise ConfigurationError(
                "the balance limit already serves another robot",
                got=robot.name,
                wanted=f"robot {self._robot.name!r}, or a limit of its own",
            )
        self._robot = robot
        legs = _legs_of(robot)
        self._legs = {leg.sole: leg for leg in legs}
        self.parameters = np.array(
            [
                self._decay,
                self._margin,
                _CARRYING * robot.weight,
                self._braking,
                _LEG_HORIZON,
                self._stop_time,
                *[np.nan] * (TORQUES - NEXT_STEP),
                *robot.tau_max,
                *(x for leg in legs for x in leg.bounds(self._leg_min, self._leg_max)),
            ]
        )

    def expect_step(self, corners: Numbers | None) -> None:
        """Announce the next foothold: what leaves the soles towards it will be caught there.

        A walk lets the robot fall from one foot to the next on purpose. Who leads one says where
        it is caught, from the tick in which a foot is unloaded until the next one carries, and
        again whenever the foothold moves.

        Args:
            corners: x and y of the four corners of the foothold in the world, in any order [m];
                None where no step is under way, as at first.

        Raises:
            TargetError: wrong shape, NaN or infinite.
            ConfigurationError: the limit serves no robot yet.
        """
        if self._robot is None:
            raise ConfigurationError(
                "the balance limit serves no robot yet", got=None, wanted="a stack that is bound"
            )
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
        if not (self._enabled and stands and contacts):
            return None
        return BalanceRows(self, [self._legs[c.frame] for c in contacts if c.frame in self._legs])


class BalanceRows(Owner):
    """The rows of a balance limit for a set of active contacts: edges, angular momentum, legs.

    Attributes:
        name: what reports call them.
        labels: names of the rows.
        edge_distances: of the divergent component from each edge, infinite where there is none
            [m]; a view that the next evaluation overwrites.
    """

    kind = Kind.BALANCE

    def __init__(self, limit: BalanceLimit, legs: Sequence["_Leg"]) -> None:
        self.name, self.parameters = limit.name, limit.parameters
        self.dim = FIRST_LEG + len(legs)
        self.labels = [(f"{limit.name}: edge of the support", MOST_EDGES)]
        self.labels += [(f"{limit.name}: angular momentum", FIRST_LEG - MOST_EDGES)]
        self.labels += [(f"{limit.name}: leg of {leg.sole}", 1) for leg in legs]
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

    def lengths(joint: int) -> Iterator[float]:
        k, q = model.joints[joint].idx_q, robot.q_home.copy()
        i = k - (robot.nq - robot.nj)
        for q[k] in np.linspace(robot.q_min[i], robot.q_max[i], _SCAN):
            yield length(q)

    hip, ankle = (model.getFrameId(model.names[j], pin.FrameType.JOINT) for j in ends)
    reached = [distance for joint in joints for distance in lengths(joint)]
    straight = max(reached)
    if straight - min(reached) < _ROUNDING:
        return None
    return _Leg(sole, index, (hip, ankle), length(robot.q_home), straight)
