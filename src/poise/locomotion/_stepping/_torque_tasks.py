"""`TorqueTasks`: the stack that the step teleoperator leads where torques are commanded."""

import numpy as np
from jaxtyping import Float64

from poise.locomotion._stepping._biped import Biped
from poise.locomotion._stepping._footing import Footing
from poise.locomotion._stepping._tasks import WA, DesiredMotion
from poise.stack import ComTask, FrameTask, PostureTask, Stack, SurfaceContact, Task

_LEVEL = np.eye(3)

_KP_COM, _KP_FOOT, _KP_BODY = 100.0, 300.0, 100.0
"""Stiffness of the COM's height, of the foot in the air, of pelvis and torso [1/s^2]."""

_BODY_WEIGHT = 1.0
"""Of pelvis and torso beside the balance: it may lean, and comes back."""

_POSTURE_WEIGHT = 0.03

_FOLLOWED = 5.0
"""How fast the reference of the COM's height leaks into what is measured [1/s]."""

_FARTHEST = 0.03
"""How far the reference of the foot in the air may be from the foot [m]."""

_UNLOAD, _LOAD = 0.03, 0.08
"""How long a foot takes to give up its load, and to take it [s]."""


class TorqueTasks:
    """Balance by forces: references of the step teleoperator as accelerations of tasks.

    The first level has the COM, both feet and, lightly, pelvis and torso upright; the second the
    posture. Feet on the ground are contacts: nothing levels them, so they lie as the ground does.

    Args:
        biped: the robot.
        dt: length of a tick [s].

    Attributes:
        stack: to be solved for torques.
    """

    def __init__(self, biped: Biped, dt: float) -> None:
        robot = biped.robot
        self._biped, self._dt = biped, dt
        self._com = ComTask(kp=_KP_COM, weight=1.0)
        self._feet = [FrameTask(s, kp=_KP_FOOT, name=f"{s} foot") for s in biped.soles]
        upright = [FrameTask(robot.pelvis, "orientation", kp=_KP_BODY, name="pelvis")]
        frames = robot.model.frames
        pelvis, torso = (frames[robot.frame_id(f)].parentJoint for f in (robot.pelvis, robot.torso))
        if torso != pelvis:
            upright.append(FrameTask(robot.torso, "orientation", kp=_KP_BODY, name="torso"))
        for task in upright:
            task.set_weight(_BODY_WEIGHT)
            task.set_target(rotation=_LEVEL)
        posture = PostureTask()
        posture.set_weight(_POSTURE_WEIGHT)
        self._contacts = [SurfaceContact(sole) for sole in biped.soles]
        levels: list[list[Task]] = [[self._com], [*self._feet, *upright, posture]]
        self.stack = Stack(contacts=self._contacts, levels=levels)
        self.stack.bind(robot)
        self.reset()

    def reset(self) -> None:
        """Both feet carry."""
        self._swing: int | None = None
        self._height: float | None = None
        self._place: Float64[np.ndarray, "3"] = np.zeros(3)
        for contact in self._contacts:
            contact.engage(0.0)

    def ask(self, footing: Footing, desired: DesiredMotion, weights: WA) -> None:
        """Sets contacts and references for a tick.

        Args:
            footing: of the tick.
            desired: of body and feet.
            weights: of the velocity level; not used.
        """
        del weights
        self._stand(footing)
        self._move_com(footing, desired)
        if self._swing is not None:
            self._move_foot(self._swing, footing, desired.foot)

    def _stand(self, footing: Footing) -> None:
        """A foot that is to be lifted gives up its load; one that has landed takes it."""
        swing = footing.other if footing.mode.single else None
        if swing == self._swing:
            return
        if self._swing is not None:
            self._contacts[self._swing].engage(_LOAD)
        if swing is not None:
            self._contacts[swing].release(_UNLOAD)
            self._place = footing.sole(swing).copy()
        self._swing = swing

    def _move_com(self, footing: Footing, desired: DesiredMotion) -> None:
        com, velocity = footing.dynamics.com, footing.dynamics.com_velocity
        height, speed = float(com[2]), float(desired.com[2])
        before = height if self._height is None else self._height
        self._height = before + self._dt * (speed + _FOLLOWED * (height - before))
        lift = _KP_COM * (self._height - height)
        lift += 2.0 * _KP_COM**0.5 * (speed - float(velocity[2]))
        self._com.set_target([com[0], com[1], self._height], [*velocity[:2], speed])
        self._com.set_acceleration(np.array([*desired.com_acceleration, lift]))

    def _move_foot(self, foot: int, footing: Footing, velocity: Float64[np.ndarray, "3"]) -> None:
        here = footing.sole(foot)
        place = self._place + self._dt * velocity
        gap = place - here
        far = float(np.linalg.norm(gap))
        self._place = here + gap * (_FARTHEST / far) if far > _FARTHEST else place
        self._feet[foot].set_target(self._place, _LEVEL, np.array([*velocity, 0.0, 0.0, 0.0]))
