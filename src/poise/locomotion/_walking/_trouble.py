"""Faults of a walk and the responses to them, in one table."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from poise.dynamics import RobotState
from poise.locomotion._support import Point
from poise.locomotion._walking._body import BodyMotion
from poise.locomotion._walking._flight import HeldFlight
from poise.locomotion._walking._sense import IDLE, UNLOADED, WalkSense
from poise.locomotion._walking._settings import WalkSettings, WalkStatus
from poise.locomotion._walking._tasks import WalkTasks
from poise.robots import GRAVITY
from poise.stack import Contact


class Response(NamedTuple):
    pace: float = 1.0  # part of the commanded velocity that is followed
    lands: bool = False  # the swing foot comes straight down
    # no contact is loaded and no foot lifted: targets move with the robot as it hangs or lies,
    # until its feet are loaded again; then the walk restarts
    hangs: bool = False
    lasts: float = 0.0  # how long after the last sign of it [s]
    noticed: float = 0.0  # time that a sign has to last: feet bounce, readings have noise [s]


NO_RESPONSE = Response()

RESPONSES: Mapping[WalkStatus, Response] = {
    WalkStatus.FALLEN: Response(pace=0.0, hangs=True, lasts=0.3),
    WalkStatus.LIFTED: Response(pace=0.0, hangs=True, lasts=0.05, noticed=0.15),
    WalkStatus.FOOT_LOST: Response(pace=0.0),
    WalkStatus.FOOT_CAUGHT: Response(lands=True),
    WalkStatus.COM_LOST: Response(pace=0.0),
    WalkStatus.SLIPPING: Response(pace=0.5, lasts=1.0, noticed=0.06),
}
"""Troubles, the worst first: of several at a time this one counts."""

_LOST = 0.4
"""Distance of the DCM from its reference, over the CoM's height, beyond which the CoM is lost."""

_FALLEN = 0.5
"""A CoM lower over the lower sole than this part of its height has fallen."""

_CAUGHT = 0.06
"""A swing foot this far beside where it should be [m] is held by something if its sole is loaded:
without that it is the robot that is elsewhere."""

_SLIP_SPEED, _LOADED = 0.2, 0.3
"""A sole that is faster [m/s] and carries more than this part of the weight slips."""

_FREE_FALL = (0.0, 0.0, -GRAVITY)
"""Acceleration of all tasks while no foot carries [m/s^2]: that of the model without contacts, so
no level has an error that would soften it."""

_STOOD_ON = 0.1
"""Time of the load ramp of feet on which a robot has been put down [s]."""


class TroubleWatch:
    def __init__(self, sense: WalkSense, settings: WalkSettings, height: float) -> None:
        self._sense, self._settings, self._height = sense, settings, height
        self._since = dict.fromkeys(RESPONSES, 0.0)  # for how long a sign has lasted [s]
        self._left = dict.fromkeys(RESPONSES, 0.0)  # for how long it still counts [s]
        self._calm = True

    def look(self, flight: HeldFlight | None, error: float, dt: float) -> WalkStatus | None:
        """Return the worst trouble there is; None for none."""
        sense, settings, height = self._sense, self._settings, self._height
        lowest = min(sense.positions[0][2], sense.positions[1][2])
        flying = None if flight is None else flight.foot
        loads = [sense.load(foot, stands=flying != foot) for foot in (0, 1)]
        # In the order of the signs.
        seen = (
            sense.com[2] - lowest < _FALLEN * height,
            # A hoist or hands have most of it.
            sum(loads) < 0.5,
            flight is not None and flight.waited > settings.patience,
            flight is not None and self._is_caught(flight),
            error > _LOST * height,
            self._slips(0, loads[0]) or self._slips(1, loads[1]),
        )
        if self._calm and not any(seen):
            return None
        since, left = self._since, self._left
        for (status, response), is_seen in zip(RESPONSES.items(), seen, strict=True):
            since[status] = since[status] + dt if is_seen else 0.0
            left[status] = max(left[status] - dt, 0.0)
            if is_seen and (left[status] > 0.0 or since[status] >= response.noticed):
                left[status] = response.lasts + dt
        worst = next((status for status in RESPONSES if left[status] > 0.0), None)
        self._calm = worst is None and not any(seen)
        return worst

    def _is_caught(self, flight: HeldFlight) -> bool:
        (x, y, _), (to_x, to_y, _) = self._sense.positions[flight.foot], flight.position.tolist()
        away = math.hypot(x - to_x, y - to_y) > _CAUGHT
        return away and math.hypot(*self._sense.relative_force(flight.foot)) > UNLOADED

    def _slips(self, foot: int, load: float) -> bool:
        if load < _LOADED:
            return False
        x, y, *_ = self._sense.velocities[foot]
        return x * x + y * y > _SLIP_SPEED * _SLIP_SPEED


_IDLE_TIME = 0.05
"""Time after which a stance foot that carries nothing hangs beside one that carries [s]."""

_NOISE = 5.0
"""Weight of a moment with a load over one without: noise, too, is a load at times."""


class HangWatch:
    """Looks for a foot that should stand, and hangs in the air."""

    def __init__(self, sense: WalkSense, contacts: Sequence[Contact]) -> None:
        self._sense, self._contacts = sense, contacts
        self._idle = [0.0, 0.0]
        self.foot: int | None = None  # which hangs, 0 for the left one; None for none

    def update(self, dt: float) -> None:
        """Update by the loads of the feet."""
        for foot, contact in enumerate(self._contacts):
            idle = self._sense.load(foot) < IDLE and contact.active
            if idle or self._idle[foot] > 0.0:
                change = dt if idle else -_NOISE * dt
                # Remembered for twice the time: a foot that carries again counts within 10 ms.
                self._idle[foot] = min(max(self._idle[foot] + change, 0.0), 2.0 * _IDLE_TIME)
        left, right = self._idle
        self.foot = None
        if max(left, right) > _IDLE_TIME and min(left, right) == 0.0:
            self.foot = 0 if left > right else 1


class Hanging:
    """Targets of a robot that no foot carries: its posture, in free fall from where it is."""

    def __init__(self, state: RobotState, sense: WalkSense, tasks: WalkTasks) -> None:
        self._sense, self._tasks = sense, tasks
        self._frames = [*tasks.feet, *(carried.task for carried in tasks.carried.values())]
        base = pin.XYZQUATToSE3(state.q[:7])
        self._base_M_frames = [base.actInv(pose) for pose in sense.frames(self._frames)]
        for contact in tasks.contacts:
            contact.release(0.0)

    def follow(self, state: RobotState, body: BodyMotion, mass: Point) -> None:
        """Take all targets to where the robot has been taken."""
        base, twist = pin.XYZQUATToSE3(state.q[:7]), pin.Motion(state.v[:6])
        for task, base_M_frame in zip(self._frames, self._base_M_frames, strict=True):
            pose, target = base.act(base_M_frame), task.overwrite_target()
            along_base = twist.linear + np.cross(twist.angular, base_M_frame.translation)
            target[0], target[1:4] = pose.translation, pose.rotation
            target[4], target[5] = base.rotation @ along_base, base.rotation @ twist.angular
            target[6], target[7] = _FREE_FALL, 0.0
        com = (tuple(self._sense.com), tuple(self._sense.com_velocity), _FREE_FALL)
        body.begin(mass, self._sense.com[2], body.heading[0])
        self._tasks.lead_com(self._sense, com, (0.0, 0.0))

    def end(self) -> None:
        """The feet carry the robot again."""
        for contact in self._tasks.contacts:
            contact.engage(_STOOD_ON)
