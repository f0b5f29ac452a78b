"""`simulate`: a simulated robot behind the robot's end of a bus, in real time."""

import time as clock
from typing import Protocol, runtime_checkable

import numpy as np

from poise.apps.deployment._faults import FaultPlan, Faults
from poise.hardware import COMMAND_FIELDS, MotorCommand, MotorState, PlantLink
from poise.sim import HoistedPlant, Recorder, garbage_frozen


@runtime_checkable
class RobotEnd(Protocol):
    """Robot's end of a bus, such as `poise.hardware.G1Robot`."""

    def publish(self, state: MotorState) -> None:
        """Send a state."""

    def read(self) -> MotorCommand:
        """Return the newest command."""
        ...


class SimulatedRobot:
    """Plant with motors behind the robot's end of a bus.

    It hangs in a hoist until it is commanded stiffness or torque, and is then lowered onto its
    feet. The motors have no watchdog: they hold the last command.

    Args:
        plant: the robot; its control period is that of the bus.
        end: the robot's end of the bus.
        faults: of the bus and its devices.
        seed: of the faults.

    Attributes:
        plant: the robot.
        late: ticks that ended more than half a period late.
        worst: largest lateness of a tick [s].
    """

    def __init__(
        self,
        plant: HoistedPlant,
        end: RobotEnd,
        faults: FaultPlan | None = None,
        *,
        seed: int = 0,
    ) -> None:
        self.plant, self._end = plant, end
        self._link = PlantLink(plant, load_cells=False)
        self._faults = Faults(
            faults or FaultPlan(), plant.robot.joint_names, period=plant.control_dt, seed=seed
        )
        self.late, self.worst = 0, 0.0

    def tick(self) -> MotorCommand:
        """Publish the state, and advance under the newest command; return it."""
        time = self.plant.time
        for state in self._faults.states(self._link.read(), time):
            self._end.publish(state)
        command = self._faults.command(self._end.read(), time)
        self.plant.drive(command)
        return command

    def run(
        self,
        seconds: float = np.inf,
        *,
        recorder: Recorder | None = None,
    ) -> None:
        """Tick in real time.

        Args:
            seconds: length of the run [s].
            recorder: of the truth and the commands.
        """
        if recorder is not None:
            recorder.begin(self.plant)
        try:
            with garbage_frozen():
                self._keep_time(seconds, recorder)
        finally:
            if recorder is not None:
                recorder.end()

    def _keep_time(self, seconds: float, recorder: Recorder | None) -> None:
        plant, period, due = self.plant, self.plant.control_dt, clock.monotonic()
        while plant.time < seconds:
            command = self.tick()
            if recorder is not None:
                recorder.look()
                got = {f"received/{n}": getattr(command, n) for n in COMMAND_FIELDS}
                recorder.sample(plant.time, **got)
            due += period
            now = clock.monotonic()
            self.late += now > due + 0.5 * period
            self.worst = max(self.worst, now - due)
            # A robot's states never come faster than its rate: time that is lost stays lost.
            if now > due + period:
                due = now
            clock.sleep(max(0.0, due - now))
