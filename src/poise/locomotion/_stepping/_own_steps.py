"""`OwnSteps`: steps that nobody commands, so that a robot which torques move does not fall.

`find_landing`: where a foot in the air comes down so that both soles hold the robot.
"""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from poise.dynamics import RobotState
from poise.locomotion._stepping._biped import Biped
from poise.locomotion._stepping._footing import Footing
from poise.locomotion._stepping._modes import Mode
from poise.locomotion._stepping._parameters import TeleopParameters
from poise.locomotion._stepping._reach import FootRange
from poise.locomotion._stepping._samples import DeviceStatus
from poise.locomotion._stepping._torque_tasks import TorqueTasks
from poise.locomotion._support import SolePart, SupportPolygon, sole_rectangle
from poise.locomotion._walking import Walker, WalkSettings
from poise.robots import Robot

_REST = 0.3
"""So long the robot stands still, its divergent component inside its soles, before it is given back
[s]."""

_PUSH, _INWARDS = 0.2, 0.5
"""A push outwards that one sole shall hold [m/s], and how far beside the middle of the sole the ZMP
may be for that, over half its width."""


def room_outwards(biped: Biped, omega: float, margin: float) -> float:
    """How far inwards from the middle of the foot that carries alone the ZMP should be [m].

    Pushed inwards, the foot in the air comes down where it is and holds the robot; pushed outwards
    it would have to cross the other leg. So room is worth more on the outer side: as much as a push
    of 0.2 m/s takes, but for soles so narrow that too little would be left on the inner one.

    Args:
        biped: the robot.
        omega: sqrt(g / H) [1/s].
        margin: how far from the soles' edges support ends [m].
    """
    half = 0.5 * min(width for _, width in biped.sizes)
    return min(max(_PUSH / omega + margin - half, 0.0), _INWARDS * half)


_CAUGHT_MARGIN = 0.005
"""How far inside the soles' edges the ZMP stays in order not to fall [m]."""

_SURE = 0.01
"""How far inside both soles the divergent component shall be when the foot is down [m]."""

_LATER = 0.05
"""How much later than by its speed a foot lands that was moved otherwise before [s]."""

_CANDIDATES = 6
"""Places between the foot and the divergent component that are looked at."""


def find_landing(
    footing: Footing, reach: FootRange, parameters: TeleopParameters
) -> Float64[np.ndarray, "3"] | None:
    """The nearest place where a foot that comes down at once holds the robot, with the other one.

    Until it is down the ZMP r stays as near to the divergent component xi as the other sole lets
    it, and xi goes to r + (xi - r) e^{omega tau}. The place is looked for on the straight way.

    Args:
        footing: of the tick, on one foot.
        reach: of the legs.
        parameters: speeds.

    Returns:
        Where the sole comes down, at the height of the ground [m]; None where no place is good.
    """
    dynamics, swing, omega = footing.dynamics, footing.other, footing.omega
    here, rotation = dynamics.placement(footing.biped.frames[swing])
    (x, y, z), ground = here.tolist(), footing.ground
    time = max(z - ground, 0.0) / parameters.v_lim + _LATER
    xi_x, xi_y = (dynamics.com[:2] + dynamics.com_velocity[:2] / omega).tolist()
    zmp_x, zmp_y = footing.support.nearest((xi_x, xi_y))
    growth = math.exp(omega * time)
    then = (zmp_x + growth * (xi_x - zmp_x), zmp_y + growth * (xi_y - zmp_y))
    far = math.dist(then, (x, y))
    most = min(1.0, parameters.v_lim * time / max(far, 1e-9))
    hip, stance = reach.hip(swing, dynamics), footing.anchors[footing.stance]
    standing = sole_rectangle(
        *dynamics.placement(footing.biped.frames[footing.stance]),
        footing.biped.sizes[footing.stance],
    )
    for ratio in np.linspace(0.0, most, _CANDIDATES).tolist():
        place = np.array([x + ratio * (then[0] - x), y + ratio * (then[1] - y), ground])
        place = reach.bring_back(swing, place, stance, hip, footing.heading)
        corners = standing + sole_rectangle(place, rotation, footing.biped.sizes[swing])
        if SupportPolygon(corners, footing.margin).depth(then) > _SURE:
            return place
    return None


class OwnSteps:
    """Catches the robot with its own steps where the feet as they are led cannot hold it.

    Once the divergent component has left what carries, no ZMP brings it back: only a foot somewhere
    else does. One that is in the air comes down at once, where both then hold the robot, if there
    is such a place. Otherwise a `Walker` on the same stack chooses where and when, foot
    after foot, until both hold the robot at rest. It also walks with a velocity that the operator
    asks for, and comes back to rest, feet side by side, when that is zero again.

    Args:
        robot: a biped.
        tasks: those of COM and feet, and contacts, are the walker's meanwhile.
        q_start: how the robot stands at the start.
        reach: of the legs.
        parameters: speeds, and length of a tick.

    Attributes:
        acting: whether the feet are led by it, and not by the operator.
    """

    def __init__(
        self,
        robot: Robot,
        tasks: TorqueTasks,
        q_start: Float64[np.ndarray, " nq"],
        reach: FootRange,
        parameters: TeleopParameters,
    ) -> None:
        # Trunk and arms stay whose they are.
        settings = WalkSettings(zmp_margin=_CAUGHT_MARGIN)
        self._walker = Walker(robot, tasks.stack, settings=settings, q=q_start, carry=())
        self._tasks = tasks
        self._reach, self._parameters = reach, parameters
        self.reset()

    def reset(self) -> None:
        """The operator leads."""
        self.acting, self._rested = False, 0.0
        self._velocity, self._driven = (0.0, 0.0, 0.0), False

    @property
    def status(self) -> DeviceStatus:
        """Why the operator's devices hold no foot meanwhile."""
        return DeviceStatus.WALKING if self._driven else DeviceStatus.OVERRULED

    @property
    def mode(self) -> Mode:
        """Which feet carry the robot."""
        lifting = self._walker.lifting
        if lifting is None or not lifting[1]:
            return Mode.D
        return Mode.SR if lifting[0] == 0 else Mode.SL

    @property
    def zmp(self) -> Float64[np.ndarray, "2"]:
        """Where the ZMP should be [m]."""
        return self._walker.zmp

    @property
    def target(self) -> Float64[np.ndarray, "3"]:
        """Where the foot in the air comes down; not a number with both on the ground [m]."""
        place = self._walker.landing
        return np.full(3, np.nan) if place is None else np.array(place.position)

    def drive(self, velocity: tuple[float, float, float]) -> None:
        """Says with which velocity the robot shall walk.

        Args:
            velocity: ahead, to the left [m/s], turning to the left [rad/s]; all zero for not.
        """
        self._velocity = velocity
        self._driven = self._driven or any(velocity)
        if self.acting and self._driven:
            self._walker.set_velocity(*velocity)

    def feel(self, state: RobotState, mode: Mode) -> None:
        """Learns what the soles carry on, while the operator leads and both stand.

        Args:
            state: of the robot.
            mode: which feet carry the robot.
        """
        if mode.single:
            self._walker.forget()
        else:
            self._walker.feel(state)

    @property
    def parts(self) -> Sequence[SolePart | None]:
        """What of each sole carries, left then right; None for all of it."""
        return self._walker.parts

    def takes_over(self, footing: Footing, state: RobotState) -> bool:
        """Begins to act if it shall walk, or the feet do not hold the robot as they are.

        Args:
            footing: of the tick.
            state: of the robot.
        """
        held = footing.capture_depth >= 0.0 or self.landing(footing) is not None
        airborne = footing.other if footing.mode.single else self._walker.hanging
        # One that is about to be lifted may hang.
        hangs = airborne is not None and footing.mode.support in (None, airborne)
        if held and not any(self._velocity) and not hangs:
            return False
        self._walker.take_over(state, airborne)
        self.acting, self._rested = True, 0.0
        self.drive(self._velocity)
        return True

    def landing(self, footing: Footing) -> Float64[np.ndarray, "3"] | None:
        """Where a foot in the air comes down to hold the robot; None for nowhere [m].

        Args:
            footing: of the tick.
        """
        return find_landing(footing, self._reach, self._parameters) if footing.mode.single else None

    def lead(self, state: RobotState) -> None:
        """Sets COM, feet and their contacts for a tick.

        Args:
            state: of the robot.
        """
        self._walker.lead(state)

    def accompany(self, footing: Footing) -> None:
        """Sets the trunk; gives the robot back once it has come to rest.

        Args:
            footing: of the tick.
        """
        self._tasks.accompany(footing)
        rests = self._walker.held and self._walker.status.ok
        rests = rests and footing.capture_depth > 0.0 and not any(self._velocity)
        self._rested = self._rested + self._parameters.dt if rests else 0.0
        if self._rested > _REST:
            self._walker.forget()
            self.reset()
