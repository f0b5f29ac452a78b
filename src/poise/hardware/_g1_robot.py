"""`G1Robot`: the robot's end of a Unitree G1's topics, for a simulated robot."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from poise.errors import ConfigurationError
from poise.hardware._g1_sdk import MODE_MACHINES, MotorOrder, open_sdk
from poise.hardware._link import MotorCommand, MotorState

_COUNTS = 1000  # states until the voltages repeat, which nothing simulates: 2 s at 500 Hz


class G1Robot:
    """Robot's end of a G1's topics on loopback, one in a process, with no motion mode active.

    Args:
        joints: names of the joints, in the order of all arrays.
        motors: names of the joints that the messages' motors move, in their order.
        mode_machine: number of the robot, of `MODE_MACHINES`.
        tag: that of the `G1Link`.

    Attributes:
        received: commands that differed from the one before. The SDK does not tell a command that
            comes again from one that has stopped coming.

    Raises:
        ConfigurationError: there are not 29 motors, or no robot has that number.
        PoiseError: as of `G1Link`, of the SDK, DDS and joints.
    """

    def __init__(
        self, joints: Sequence[str], motors: Sequence[str], *, mode_machine: int, tag: str = ""
    ) -> None:
        if mode_machine not in MODE_MACHINES.values():
            wanted = f"one of {tuple(MODE_MACHINES.values())}"
            raise ConfigurationError("mode_machine of a G1", got=mode_machine, wanted=wanted)
        self._order, self.received, self._published = MotorOrder(joints, motors), 0, 0
        sdk, self._robot = open_sdk("lo", tag)
        self._robot.enable_motion_switcher_responder()
        self._raw = sdk.LowState(len(motors))
        self._raw.mode_machine = mode_machine
        self._numbers: Any = ([0.0] * len(motors),) * 5
        self._command = MotorCommand.damping(np.zeros(len(joints)))

    def publish(self, state: MotorState) -> None:
        """Send a state; torques and temperatures that are not measured are sent as zero.

        Args:
            state: measurements; the messages have no wrenches, and times are left out.
        """
        self._published += 1
        raw, spread = self._raw, self._order.spread
        motor, imu, (x, y, z, w) = raw.motor, raw.imu, state.quaternion.tolist()
        motor.q, motor.dq = spread(state.q), spread(state.dq)
        motor.tau_est = spread(np.nan_to_num(state.tau))
        motor.temperature = list(map(int, spread(np.nan_to_num(state.temperature))))
        # In mV, so that a link sees a state that repeats the last as new.
        motor.voltage = [0.001 * (self._published % _COUNTS)] * len(motor.q)
        imu.quat, imu.omega = [w, x, y, z], state.gyro.tolist()
        imu.accel = state.acceleration.tolist()
        raw.tick = self._published
        self._robot.publish_low_state(raw)

    def read(self) -> MotorCommand:
        """Return the newest command; zero gains and torques before the first."""
        raw = self._robot.read_incoming_command()
        numbers = raw.q_target, raw.dq_target, raw.kp, raw.kd, raw.tau_ff
        if numbers != self._numbers:
            q, dq, kp, kd, tau = map(self._order.pick, numbers)
            self._numbers, self.received = numbers, self.received + 1
            self._command = MotorCommand(q=q, dq=dq, kp=kp, kd=kd, tau=tau)
        return self._command
