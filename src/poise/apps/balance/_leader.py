"""`BalanceLeader`: a walker by velocities, with arms and neck by another program's targets."""

import numpy as np

from poise._checks import checked_number
from poise.apps.balance._limb_target import LimbTarget
from poise.apps.balance._messages import Targets, check_targets
from poise.control import WholeBodyController, is_usable
from poise.dynamics import RobotState
from poise.errors import PoiseError
from poise.locomotion import (
    GazeLeader,
    HandLeader,
    OperatorGuard,
    OperatorSample,
    SampleClock,
    Walker,
    rotation_of,
    walking_stack,
)
from poise.robots import Robot


class BalanceLeader:
    """Stand and walk by velocities while arms and neck follow targets; a `poise.stack.Leader`.

    The newest message counts, if it is later than the one before and no more than `LATE` late
    (`SampleClock`). Targets of limbs are interpolated (`LimbTarget`), and followed by a kinematic
    model of the limbs (`LimbTracking`) that bounds their speed and acceleration, keeps joints off
    their limits and links off each other; it begins where the arms are. The stack has its own
    self-collision limit, against the measured posture. Velocities pass the `OperatorGuard` and the
    limits of the walker. Without a message for `LOST_AFTER` the walk stops; a limb holds its last
    target for `HELD_FOR` and then eases back to rest.

    Args:
        robot: a humanoid on two soles.
        dt: control period [s].

    Attributes:
        robot: the robot.
        stack: of the controller.
        dt: control period [s].
        walker: leader of the legs.
        limbs: names of the joints of each limb, by its frame.
        news: message for the next tick; None for none.
        refused: number of messages that did not count.
        reason: fault of the last of them; "" while there was none.

    Raises:
        ConfigurationError: the period is not positive, or the robot cannot walk.
    """

    def __init__(self, robot: Robot, *, dt: float) -> None:
        self.robot, self.dt = robot, checked_number(dt, "dt of the leader [s]", above=0.0)
        hands, gaze = HandLeader(robot, dt=dt), GazeLeader(robot, dt=dt)
        self._parts = (hands.arms, gaze.neck)
        self.limbs = {
            name: tuple(robot.joint_names[j] for j in part.index[limb.own])
            for part in self._parts
            for name, limb in zip(part.names, part.limbs, strict=True)
        }
        self._targets = {name: LimbTarget() for name in self.limbs}
        self.stack = walking_stack(robot, hands.task, gaze.task)
        self.walker = Walker(robot, self.stack)
        self._clock, self._guard = SampleClock(), OperatorGuard(dt=dt)
        self.news: Targets | None = None
        self._started, self.refused, self.reason = False, 0, ""
        self._time = 0.0

    def controller(self) -> WholeBodyController:
        """Return a controller of torques for the stack."""
        return WholeBodyController(self.robot, self.stack)

    @property
    def lost(self) -> bool:
        """True without a message for `LOST_AFTER`."""
        return self._clock.is_lost(self._time)

    def take(self, targets: Targets) -> bool:
        """Take a message for the next tick, in place of one that waits.

        Args:
            targets: the message.

        Returns:
            False where it cannot count: `reason` has the fault.
        """
        try:
            check_targets(targets, self.limbs, self.robot)
        except PoiseError as error:
            self.refuse(str(error))
            return False
        self.news = targets
        return True

    def refuse(self, reason: str) -> None:
        """Count a message that cannot count.

        Args:
            reason: its fault.
        """
        self.refused, self.reason = self.refused + 1, reason

    def lead(self, state: RobotState) -> None:
        """Set targets of the next tick; a state that cannot be used changes nothing.

        Args:
            state: of the robot, as estimated.
        """
        if not is_usable(state, self.robot):
            return
        self._time = time = state.time
        if not self._started:
            self._started = True
            for part in self._parts:
                part.start(state.q)
        self._guard.check(self._sample(time), time)
        self.walker.set_velocity(*self._guard.velocity)
        self.walker.lead(state)
        for part in self._parts:
            part.follow([self._targets[name].goal(time) for name in part.names], state.q)

    def pause(self, state: RobotState) -> None:
        """Lead without the other program: come to rest.

        Args:
            state: of the robot, as estimated.
        """
        self.news = None
        self.lead(state)

    def signals(self) -> dict[str, np.ndarray | float | str]:
        """Signals of the last tick for a recorder."""
        return {**self.walker.signals(), "refused": float(self.refused)}

    def _sample(self, time: float) -> OperatorSample | None:
        """Take the message that waits; return its velocity as a sample of the guard."""
        news, self.news = self.news, None
        if news is None:
            return None
        if not self._clock.accepts(news.time, time):
            self.refuse(f"the message of {news.time:g} s is too late, or no later than another")
            return None
        self._aim(news, time)
        return OperatorSample(time=news.time, velocity=news.velocity)

    def _aim(self, news: Targets, time: float) -> None:
        """Set the targets of all limbs that a message names."""
        for part in self._parts:
            for name, limb in zip(part.names, part.limbs, strict=True):
                target, hand = self._targets[name], news.hands.get(name)
                if hand is not None:
                    rotation = rotation_of(hand.orientation)
                    place = np.array(hand.position, dtype=np.float64)
                    target.take(place, news.time, time, rotation=rotation, by_joints=False)
                elif any(joint in news.joints for joint in self.limbs[name]):
                    kept = target.last()
                    kept = part.q[limb.own] if kept is None else kept
                    pairs = zip(self.limbs[name], kept.tolist(), strict=True)
                    joints = np.array([news.joints.get(joint, at) for joint, at in pairs])
                    target.take(joints, news.time, time, by_joints=True)
