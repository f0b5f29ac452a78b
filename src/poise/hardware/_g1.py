"""`G1Link`: a Unitree G1, by the SDK's DDS topics `rt/lowstate` and `rt/lowcmd`."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from poise._checks import checked_number
from poise.errors import RobotError
from poise.hardware._g1_mode import end_mode
from poise.hardware._g1_sdk import MODE_MACHINES, PEERS, MotorOrder, open_sdk, silence
from poise.hardware._link import STATE_FIELDS, LinkInfo, LinkStatus, MotorCommand, MotorState

RATE = 500.0  # of states and commands: the SDK's thread sends each 2 ms [1/s]
_TIMEOUT = 5.0  # ten times what discovery takes on loopback, measured [s]
_CABLE = "rt/lowstate: check power, cable, the interface's address (192.168.123.x) and firewall"
_LISTEN = 0.5  # for commanders: discovery once more, and 250 of their periods [s]


class G1Link:
    """Link to a Unitree G1, one in a process.

        motors = JointOrder.unitree_dds("g1").names
        modes = (MODE_MACHINES["g1_29dof_rev_1_0"],)
        make = partial(G1Link, robot.joint_names, motors, interface="eth0", mode_machines=modes)
        link = ProcessLink(make, check)

    The robot must have no motion mode active, in which it commands its motors itself; a robot that
    stands falls when its mode ends. Nothing is sent before the first `write`. From then on a thread
    of the SDK sends the newest command every 2 ms, even while Python hangs, until `close` or the
    end of the process. Motors without a joint of the link get zero gains and torques.

    The SDK does not pass on the robot's clock or a count: a state is new if its numbers differ from
    those before, and its time is that of its arrival in `read`. It also stores motors and inertial
    unit one after the other, so that in a rare state the latter is of the message before.

    Args:
        joints: names of the joints, in the order of all arrays.
        motors: names of the joints that the messages' motors move, in their order.
        mode_machines: numbers of the robots that are right, of `MODE_MACHINES`.
        interface: network interface; "lo" for a simulated robot.
        tag: participants with different ones do not see each other, such as simulated robots on
            one machine; a real robot has none.
        release: release the motion mode, as the remote control's debug mode does.
        timeout: longest wait for the first state, and for the end of the mode [s].

    Raises:
        MissingExtraError: the SDK is not installed.
        ConfigurationError: the SDK has another version, or there are not 29 motors.
        UnknownNameError: there is no such network interface, or a joint has no motor.
        RobotError: DDS does not start, no state arrives, the robot is another one, a motion mode is
            active, or another process commands the robot.
    """

    def __init__(
        self,
        joints: Sequence[str],
        motors: Sequence[str],
        *,
        mode_machines: Sequence[int],
        interface: str,
        tag: str = "",
        release: bool = False,
        timeout: float = _TIMEOUT,
    ) -> None:
        timeout = checked_number(timeout, "longest wait for the first state [s]", above=0.0)
        self._order = MotorOrder(joints, motors)
        self.info = LinkInfo(name=f"Unitree G1 on {interface}", rate=RATE, joints=tuple(joints))
        self.status, self.refused, self.reason = LinkStatus.OK, 0, ""
        self._robot: Any = None
        self._open(interface, tag, timeout)
        self._check_robot(mode_machines)
        if end_mode(self._sdk, release, timeout):
            self._forget()
            self._open(interface, tag, timeout)  # without the last command of the mode
        time.sleep(_LISTEN)
        self._check_commander()
        self._command = self._sdk.MotorCommand(len(motors))
        self._numbers: Any = None
        self._state = self.read()

    def clock(self) -> float:
        """Return `time.monotonic()` [s]."""
        return time.monotonic()

    def read(self) -> MotorState:
        """Return the newest state; the last one for ever after `close`."""
        if self._robot is None:
            return self._state
        raw = self._robot.read_low_state()
        motor, imu = raw.motor, raw.imu
        measured = motor.q, motor.dq, motor.tau_est, motor.temperature
        numbers = (*measured, motor.voltage, imu.quat, imu.omega, imu.accel)
        if numbers == self._numbers:
            return self._state
        self._numbers, now, (w, x, y, z) = numbers, self.clock(), imu.quat
        base = np.array([x, y, z, w]), np.array(imu.omega), np.array(imu.accel), np.zeros((0, 6))
        values: tuple[Any, ...] = (now, now, *map(self._order.pick, measured), *base)
        self._state = MotorState(**dict(zip(STATE_FIELDS, values, strict=True)))
        return self._state

    def write(self, command: MotorCommand) -> None:
        """Replace the command that the SDK's thread sends.

        Args:
            command: set-points of all joints.
        """
        if self._robot is None:
            return
        sent, spread = self._command, self._order.spread
        sent.q_target, sent.dq_target = spread(command.q), spread(command.dq)
        sent.kp, sent.kd, sent.tau_ff = map(spread, (command.kp, command.kd, command.tau))
        self._robot.write_low_command(sent)

    def close(self) -> None:
        """End the SDK's thread, which is the only way to stop its messages.

        The last command has gone out by then: damping, from a `ProcessLink`.
        """
        if self._robot is not None:
            time.sleep(2.0 / RATE)
            self._forget()
            self.status = LinkStatus.LOST

    def _forget(self) -> None:
        silence(self._sdk)
        self._robot = None

    def _open(self, interface: str, tag: str, timeout: float) -> None:
        """Open the topics, and wait for the first state."""
        self._sdk, self._robot = open_sdk(interface, tag)
        end, heard = time.monotonic() + timeout, False
        while not heard:
            if time.monotonic() > end:
                got, wanted = f"nothing in {timeout:g} s on {interface}", f"{_CABLE}; {PEERS}"
                raise RobotError("no state of a G1 arrives", got=got, wanted=wanted)
            heard = any(self._robot.read_low_state().imu.quat)
            time.sleep(1.0 / RATE)  # also for mode_machine, which the SDK stores last

    def _check_robot(self, mode_machines: Sequence[int]) -> None:
        names = {mode: f"{mode} ({name})" for name, mode in MODE_MACHINES.items()}
        mode = int(self._robot.read_low_state().mode_machine)
        if mode not in mode_machines:
            got = names.get(mode, f"{mode}, which no model has")
            wanted = ", ".join(names.get(right, str(right)) for right in mode_machines)
            raise RobotError("mode_machine is not that of the model", got=got, wanted=wanted)

    def _check_commander(self) -> None:
        found = self._robot.read_incoming_command()
        if any(map(any, (found.kp, found.kd, found.tau_ff))):
            got = f"rt/lowcmd with kp up to {max(found.kp):g}, kd up to {max(found.kd):g}"
            raise RobotError("another process commands the G1", got=got, wanted="it to be ended")
