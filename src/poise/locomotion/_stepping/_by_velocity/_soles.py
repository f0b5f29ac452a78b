"""`SoleGrounds`: how the ground lies under each sole, told by the sole and not by a level.

`SoleYield`: the foot that carries beside the stance gives way to what squeezes it.
"""

import math

import numpy as np
import pinocchio as pin

from poise.dynamics import rotation_vector
from poise.locomotion._stepping._stance import LEVEL, Footing
from poise.locomotion._support import Rotation, Vector2, Vector3
from poise.locomotion._walking import LOADED

_FOLLOW, _CORRECT = 5.0, 20.0
"""Rates at which the tilt of a ground follows that of a sole which lies flat on it, and that of a
sole which could not be tilted as it is otherwise [1/s]."""

_ON_EDGE, _FLAT = 0.9, 0.6
"""Distance of the centre of pressure from the sole's, over half the sole: beyond the first the sole
may be on its edge, within the second it lies flat."""

_SEEK = 0.5
"""Angular velocity of a sole on its edge that has not lain flat yet [rad/s]."""


class SoleGrounds:
    """The tilt of the ground under each foot, as the inertial unit has it."""

    # A sole pressed well inside lies flat. One pressed at an edge may be raised on the other side,
    # but not tilted the other way. Ground that no sole has lain flat on since landing is unknown.

    def __init__(self, dt: float) -> None:
        self._follow, self._correct = dt * _FOLLOW, dt * _CORRECT
        self.reset()

    def reset(self) -> None:
        """Nothing is known of the ground."""
        self._tilts = [np.zeros(3), np.zeros(3)]
        self._known = [[False, False], [False, False]]

    def update(self, footing: Footing) -> None:
        """Takes one tick."""
        for foot in (0, 1):
            if footing.mode.single and foot == footing.other:
                # It will land on what the other stands on, for all that is known.
                self._tilts[foot] = self._tilts[1 - foot].copy()
                self._known[foot] = [False, False]
                continue
            pressed = _pressed(footing, foot)
            if pressed is None:
                continue
            off = _sole_tilt(footing, foot) - self._tilts[foot]
            for axis, part in enumerate(pressed):
                self._tilts[foot][axis] += self._believed(foot, axis, float(off[axis]), part)

    def _believed(self, foot: int, axis: int, off: float, pressed: float) -> float:
        """Return the part of a difference of tilts about an axis that is the ground's [rad]."""
        if not self._known[foot][axis]:
            self._known[foot][axis] = abs(pressed) < _ON_EDGE
            return off
        edge = min(1.0, max(0.0, (abs(pressed) - _FLAT) / (_ON_EDGE - _FLAT)))
        # On the lowered edge a sole may be tilted, with the raised one down it cannot be.
        impossible = edge if off * pressed < 0.0 else 0.0
        return (self._follow * (1.0 - edge) + self._correct * impossible) * off

    def rotation(self, foot: int) -> Rotation:
        """Return world_R_ground under a foot."""
        return pin.exp3(self._tilts[foot])

    def seeking(self, footing: Footing, foot: int) -> Vector3:
        """Angular velocity of a sole on an edge whose ground is not known, its free edge down."""
        rate, pressed = np.zeros(3), _pressed(footing, foot)
        if pressed is not None:
            for axis, part in enumerate(pressed):
                if not self._known[foot][axis]:
                    rate[axis] = -math.copysign(_SEEK, part)
        return rate

    def righting(self, footing: Footing, foot: int, gain: float) -> Vector3:
        """Angular velocity with which a sole that carries is turned onto its ground."""
        lift = _sole_tilt(footing, foot) - self._tilts[foot]
        return self.seeking(footing, foot) - gain * lift


def _sole_tilt(footing: Footing, foot: int) -> Vector3:
    """Return the tilt of a sole from level, horizontal axis times angle [rad]."""
    _, rotation = footing.dynamics.placement(footing.biped.frames[foot])
    tilt = rotation_vector(rotation, LEVEL)
    tilt[2] = 0.0
    return tilt


def _pressed(footing: Footing, foot: int) -> tuple[float, float] | None:
    """Return the centre of pressure over half the sole, by turns about x and y that lower it."""
    centre = footing.sense.centres[foot]
    if centre is None:
        return None
    length, width = footing.biped.sizes[foot]
    return -2.0 * centre[1] / width, 2.0 * centre[0] / length


_ROLL_OFF = 0.3
"""Angular velocity of a sole over the distance of its centre of pressure from its goal
[rad/s per m]; servos are stiff: ten times as much makes feet shake."""

_GIVE = (0.15, 0.15, 0.03)
"""Velocity of a foot over a force that squeezes, over the weight [m/s]; legs are stiffest
along their length."""


class SoleYield:
    """Two feet on the ground are a closed chain: one gives way to forces that only squeeze."""

    # It turns until its centre of pressure is as far ahead as the other's and in the middle across
    # the line between the feet, moves with what its pull exceeds the share of its load, and rises
    # or sinks until it bears the load that the ZMP asks for.

    def __init__(self, dt: float) -> None:
        self._settle = dt * _FOLLOW

    def turn(self, footing: Footing) -> Vector2 | None:
        """Angular velocity of the other sole, x and y; None while it carries nothing [rad/s]."""
        sense, other = footing.sense, footing.other
        here, there = sense.centres[other], sense.centres[footing.stance]
        if here is None or there is None:
            return None
        along = _between(footing)
        along /= np.linalg.norm(along)
        aim = np.array(there)
        off_x, off_y = (np.array(here) - aim + along * along.dot(aim)).tolist()
        _, rotation = footing.dynamics.placement(footing.biped.frames[other])
        share = min(1.0, 2.0 * float(sense.loads[other]) / footing.biped.weight)
        return _ROLL_OFF * share * rotation[:2, :2].dot(np.array([off_y, -off_x]))

    def move(self, footing: Footing, velocity: Vector3, zmp: Vector2) -> Vector3:
        """Velocity of the other foot; its anchor settles where it stands [m/s]."""
        sense, other = footing.sense, footing.other
        total, weight = float(sense.loads.sum()), footing.biped.weight
        if sense.centres[other] is None or total < LOADED * weight:
            return velocity
        part = float(sense.loads[other]) / total
        pull, counter = (
            np.array((sense.wrenches[foot] or (0.0, 0.0))[:2]) for foot in (other, footing.stance)
        )
        squeeze = (1.0 - part) * pull - part * counter
        give = np.array([*squeeze, (part - self._part(footing, zmp)) * total])
        share = min(1.0, 2.0 * part)
        anchor = footing.anchors[other]
        anchor += self._settle * share * (footing.sole(other) - anchor)
        return (1.0 - share) * velocity + share / weight * np.array(_GIVE) * give

    @staticmethod
    def _part(footing: Footing, zmp: Vector2) -> float:
        """Part of the load that is the other foot's with the ZMP at a place."""
        along = _between(footing)
        from_stance = zmp - footing.sole(footing.stance)[:2]
        return min(1.0, max(0.0, float(from_stance.dot(along) / along.dot(along))))


def _between(footing: Footing) -> Vector2:
    """From the stance to the other foot, along the ground [m]."""
    return (footing.sole(footing.other) - footing.sole(footing.stance))[:2]
