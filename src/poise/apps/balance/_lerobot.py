"""`LeRobotController`: the balance service as a whole-body controller of LeRobot's Unitree G1."""

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.apps.balance._leader import BalanceLeader
from poise.apps.balance._messages import Targets
from poise.errors import ConfigurationError
from poise.estimation import StateEstimator
from poise.hardware import LinkInfo, MotorState, robot_state
from poise.locomotion import SILENT_AFTER, Vector, VelocityLimits
from poise.robots import Robot

_AXES = ("remote.lx", "remote.ly", "remote.rx")

_SHARE, _AT_REST = 0.85, 0.05
"""Part of its limits that a stick commands, and deflection that counts as none, as of
`poise drive`."""

_LEGS = ((150.0, 2.0), (150.0, 2.0), (150.0, 2.0), (300.0, 4.0), (40.0, 2.0), (40.0, 2.0))
_WAIST = ((250.0, 5.0),) * 3
_ARM = ((50.0, 3.0),) * 2 + ((80.0, 3.0),) * 2 + ((40.0, 1.5),) * 3
_GAINS = np.array((*_LEGS, *_LEGS, *_WAIST, *_ARM, *_ARM))
"""Stiffness [N m/rad] and damping [N m s/rad] of the motors, as of LeRobot's `UnitreeG1Config`."""


class LeRobotController:
    """A controller of `lerobot.robots.unitree_g1`, in its shape; it imports nothing of LeRobot.

    LeRobot publishes positions q_d alone, for drives with tau = kp (q_d - q) - kd dq. The torque
    tau of the controller goes out as

        q_d = q + (tau + kd dq) / kp

    at the state that it answers. While q_d rests for a period T the drives add damping of
    kp (T / 2 + delay): shorter periods follow the torque more closely. Sticks command velocities:
    `remote.ly` ahead, -`remote.lx` to the left, -`remote.rx` a turn to the left, after they have
    been at rest once; `<joint>.q` of arms are targets, joints named as in LeRobot
    (`kLeftElbow` for left_elbow_joint). The state is estimated without load cells. The usual period
    is that at which LeRobot reads states.

    LeRobot's `send_action` publishes positions of arms by itself, too, unbounded, until the next
    step of this controller replaces them.

    Args:
        robot: G1 with 29 joints, in the order of its motors.
        control_dt: period of `run_step` [s].
        clock: time of a step [s].

    Attributes:
        control_dt: period of `run_step` [s].
        kp: stiffness of the motors [N m/rad].
        kd: damping of the motors [N m s/rad].
        default_angles: posture to begin in: home [rad].
        leader: of the robot.

    Raises:
        ConfigurationError: the robot has another number of joints, or the period is not positive.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        control_dt: float = 0.004,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if robot.nj != len(_GAINS):
            raise ConfigurationError("joints of G1", got=robot.nj, wanted=str(len(_GAINS)))
        self.control_dt, self._robot, self._clock = control_dt, robot, clock
        self.kp, self.kd = _GAINS[:, 0].copy(), _GAINS[:, 1].copy()
        self.default_angles = robot.q_home[-robot.nj :].copy()
        self._info = LinkInfo(name="LeRobot", rate=1.0 / control_dt, joints=robot.joint_names)
        self._keys = [f"{_name_of(joint)}.q" for joint in robot.joint_names]
        self._estimator = StateEstimator(robot)
        self.reset()

    def reset(self) -> None:
        """Begin anew, at rest where the robot is."""
        self.leader = BalanceLeader(self._robot, dt=self.control_dt)
        self._controller = self.leader.controller()
        self._estimator.reset()
        arms = {joint for own in self.leader.limbs.values() for joint in own}
        pairs = zip(self._keys, self._robot.joint_names, strict=True)
        self._arms = {key: joint for key, joint in pairs if joint in arms}
        self._last: dict[str, float] = {}
        self._sent: dict[str, float] = {}
        self._sent_at = -math.inf
        self._seen: Any = None

    def run_step(self, action: Mapping[str, Any], lowstate: Any) -> dict[str, float]:
        """Return position targets by `<joint>.q`; without a new, good state those before.

        Args:
            action: sticks from -1 to 1, and positions of joints [rad].
            lowstate: of the robot, another object for each state; None for none yet.
        """
        if lowstate is None or lowstate is self._seen:
            return self._last
        self._seen = lowstate
        measured = self._measured(lowstate)
        self.leader.take(self._targets(action, measured.time))
        state = self._estimator.update(robot_state(self._robot, self._info, measured))
        self.leader.lead(state)
        torque = self._controller.step(state).torque
        if torque is not None:
            torque = np.clip(torque, -self._robot.tau_max, self._robot.tau_max)
            q = measured.q + (torque + self.kd * measured.dq) / self.kp
            if np.isfinite(q).all():
                self._last = dict(zip(self._keys, q.tolist(), strict=True))
        return self._last

    def _measured(self, lowstate: Any) -> MotorState:
        motors, unit = lowstate.motor_state, lowstate.imu_state
        now, joints = self._clock(), range(self._robot.nj)
        w, x, y, z = _numbers(unit.quaternion, 4)
        return MotorState(
            time=now,
            arrived=now,
            q=_numbers([motors[j].q for j in joints], len(joints)),
            dq=_numbers([motors[j].dq for j in joints], len(joints)),
            tau=_numbers([motors[j].tau_est for j in joints], len(joints)),
            temperature=np.full(len(joints), np.nan),
            quaternion=np.array([x, y, z, w]),
            gyro=_numbers(unit.gyroscope, 3),
            acceleration=_numbers(unit.accelerometer, 3),
            wrenches=np.zeros((0, 6)),
        )

    def _targets(self, action: Mapping[str, Any], now: float) -> Targets:
        """Targets of a step: the action stays between those of a client, so joints are sent once.

        They are sent again before they count as silent.
        """
        given = {joint: action[key] for key, joint in self._arms.items() if key in action}
        joints = {joint: _number(q) for joint, q in given.items() if q is not None}
        if joints == self._sent and now - self._sent_at < SILENT_AFTER:
            joints = {}
        else:
            self._sent, self._sent_at = joints, now
        velocity = _velocity(action, self.leader.walker.limits)
        return Targets(time=now, velocity=velocity, joints=joints)


def _name_of(joint: str) -> str:
    """Name of a joint in LeRobot."""
    return "k" + "".join(word.capitalize() for word in joint.removesuffix("_joint").split("_"))


def _numbers(values: Any, count: int) -> Float64[np.ndarray, " n"]:
    """A message's numbers, NaN where they are missing."""
    found = np.full(count, np.nan)
    if values is not None and len(values) == count:
        found[:] = [_number(value) for value in values]
    return found


def _number(value: Any) -> float:
    """A message's number, NaN for what is none."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def _velocity(action: Mapping[str, Any], limits: VelocityLimits) -> Vector:
    """Velocity that the sticks command."""
    sticks = (_number(action.get(axis, 0.0)) for axis in _AXES)
    x, y, turn = (0.0 if abs(stick) <= _AT_REST else stick for stick in sticks)
    return (
        _SHARE * y * (limits.ahead if y > 0.0 else limits.back),
        -_SHARE * x * limits.sideways,
        -_SHARE * turn * limits.turn,
    )
