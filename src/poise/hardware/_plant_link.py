"""`PlantLink`: a simulated robot in this process. `robot_state`: from motors to controllers."""

from typing import Any, Protocol, runtime_checkable

import numpy as np

from poise._checks import checked_number
from poise.dynamics import RobotState, SensorReadings
from poise.errors import ConfigurationError
from poise.hardware._last_check import LastCheck
from poise.hardware._link import Joints, LinkInfo, LinkStatus, MotorCommand, MotorState
from poise.robots import Robot


@runtime_checkable
class PlantLike(Protocol):
    """Part of `poise.Plant` that a link uses."""

    robot: Robot

    @property
    def control_dt(self) -> float: ...
    @property
    def time(self) -> float: ...
    def state(self) -> RobotState: ...
    @property
    def applied_torque(self) -> Joints: ...
    def drive(self, set_points: MotorCommand) -> Any: ...


class PlantLink:
    """A plant in this process.

    Each written command lasts for one period of the link, in which it goes to the plant's drives
    (`Plant.drive`) in each control period of the plant. The clock is the plant's.

    Args:
        plant: with torque actuation, as `poise.Plant`.
        check: the last check; None where another link has one.
        period: from one command to the next; the plant's control period if not given [s].
        load_cells: False for soles without.

    Raises:
        ConfigurationError: the check is of another robot, or the period is no multiple of the
            plant's.
    """

    def __init__(
        self,
        plant: PlantLike,
        check: LastCheck | None = None,
        *,
        period: float | None = None,
        load_cells: bool = True,
    ) -> None:
        robot, dt = plant.robot, plant.control_dt
        period = checked_number(dt if period is None else period, "period [s]", above=0.0)
        self._ticks = max(1, round(period / dt))
        if abs(self._ticks * dt - period) > 1e-9:  # the rounding of sums of periods
            wanted = f"a multiple of the plant's control period, {dt:g} s"
            raise ConfigurationError("period of the link [s]", got=period, wanted=wanted)
        if check is not None and check.joints != robot.joint_names:
            message, wanted = "the last check has other joints than the plant", f"{robot.name}'s"
            raise ConfigurationError(message, got=check.joints, wanted=wanted)
        self._plant, self._check = plant, check
        self.status, self.refused, self.reason = LinkStatus.OK, 0, ""
        measured = plant.state().contacts if load_cells else {}
        soles = tuple(name for name in robot.soles if name in measured)
        self.info = LinkInfo(
            name=f"simulated {robot.name}", rate=1.0 / period, joints=robot.joint_names, soles=soles
        )

    def clock(self) -> float:
        """Return the plant's time [s]."""
        return self._plant.time

    def read(self) -> MotorState:
        """Return the newest state; its torques are those that the drives applied last."""
        raw, joints = self._plant.state(), self._plant.robot.nj
        readings, floating = raw.readings, self._plant.robot.floating_base
        return MotorState(
            time=raw.time,
            arrived=self._plant.time,
            q=raw.q[-joints:],
            dq=raw.v[-joints:],
            tau=self._plant.applied_torque if readings is None else readings.torque,
            temperature=np.full(joints, np.nan),
            quaternion=raw.q[3:7] if floating else np.array([0.0, 0.0, 0.0, 1.0]),
            gyro=np.zeros(3) if readings is None else readings.angular_velocity,
            acceleration=np.zeros(3) if readings is None else readings.specific_force,
            wrenches=np.array([raw.contacts[name] for name in self.info.soles]).reshape(-1, 6),
        )

    def write(self, command: MotorCommand) -> None:
        """Apply a command for one period.

        Args:
            command: set-points of all joints.
        """
        if self.status is LinkStatus.LOST:
            return
        if self._check is not None:
            command = self._check.check(command, self.read())
            failed = self._check.refused > self.refused
            self.status = LinkStatus.REFUSED if failed else LinkStatus.OK
            self.refused, self.reason = self._check.refused, self._check.reason
        for _ in range(self._ticks):
            self._plant.drive(command)

    def close(self) -> None:
        """Send damping for one period and disconnect."""
        if self._check is not None:
            self.write(self._check.damping)
        self.status = LinkStatus.LOST


def robot_state(robot: Robot, info: LinkInfo, state: MotorState) -> RobotState:
    """Return what an estimator reads, or, with a fixed base, a controller.

    Of a floating base position and linear velocity are those of the home posture at rest: a
    `StateEstimator` estimates them.

    Args:
        robot: the robot.
        info: of the link that the state comes from.
        state: as read.
    """
    q, v = robot.q_home.copy(), np.zeros(robot.nv)
    if robot.floating_base:
        q[3:7], v[3:6] = state.quaternion, state.gyro
    q[-robot.nj :], v[-robot.nj :] = state.q, state.dq
    torque = state.tau if np.isfinite(state.tau).all() else np.zeros(0)
    readings = SensorReadings(state.gyro, state.acceleration, torque)
    wrenches = dict(zip(info.soles, state.wrenches, strict=True))
    return RobotState(q, v, wrenches, state.time, readings)
