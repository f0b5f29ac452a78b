"""`DriveLoop`: a robot that walks with the velocity that somebody asks for, in real time."""

import math
import time as clock
from collections.abc import Generator
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from poise.apps.live._inputs import OperatorInputs
from poise.apps.live._integrator import Integrator
from poise.apps.live._log import LIVE_CONFIG, Takes
from poise.apps.live._odometry import Odometry
from poise.apps.live._real_time import RealTimeLoop, command_time
from poise.apps.live._snapshot import Snapshot
from poise.control import WholeBodyController, is_usable
from poise.dynamics import RobotState
from poise.estimation import PayloadEstimator, StateEstimator
from poise.locomotion import (
    DeviceStatus,
    GazeLeader,
    HandLeader,
    Mode,
    OperatorGuard,
    Walker,
    signed_margin,
    soles_outline,
    walking_stack,
)
from poise.robots import Robot
from poise.sim import PlantConfig, Recorder, Tick, rollout
from poise.stack import Stack

DRIVE_PLANT = PlantConfig(control_dt=0.002, self_contact=True)
"""What a driven robot is simulated by: its links touch, for a person may lead hands into it."""

_STEP_MODES = ((Mode.TR, Mode.SR), (Mode.TL, Mode.SL))
"""What a robot does that is about to lift a foot, and that has lifted it, by the foot."""


class _Driver:
    """The leader: walker, arms and neck follow the operator."""

    def __init__(self, robot: Robot, inputs: OperatorInputs, dt: float) -> None:
        self.hands = HandLeader(robot, dt=dt)
        self.gaze = GazeLeader(robot, dt=dt)
        self.stack: Stack = walking_stack(robot, self.hands.task, self.gaze.task)
        self.walker = Walker(robot, self.stack)
        self._device, self._robot = Integrator(inputs, dt, velocities=self.walker.limits), robot
        self.guard, self.odometry = OperatorGuard(dt=dt), Odometry()

    def lead(self, state: RobotState) -> None:
        """Sets what the next tick should do; a state that cannot be used changes nothing."""
        if not is_usable(state, self._robot):
            return
        self.guard.check(self.guard.read(self._device, state.time), state.time)
        self.walker.set_velocity(*self.guard.velocity)
        self.walker.lead(state)
        self.hands.lead(self.guard, state)
        self.gaze.lead(self.guard)

    @property
    def zmp(self) -> Float64[np.ndarray, "2"]:
        """Where the ZMP should be, in the simulator's world [m]."""
        return self.odometry.drawn(self.walker.zmp)

    def signals(self) -> dict[str, np.ndarray | float | str]:
        """What the log should know, in the simulator's world as the rest of it."""
        return {**self.walker.signals(), "zmp_reference": self.zmp}


class DriveLoop(RealTimeLoop):
    """A humanoid that somebody drives.

    Attributes:
        takes: where each run is logged.
    """

    def __init__(
        self,
        robot: Robot,
        inputs: OperatorInputs,
        folder: Path,
        *,
        plant: PlantConfig = DRIVE_PLANT,
        seed: int = 0,
    ) -> None:
        super().__init__(robot, plant, seed)
        self._inputs, self.takes = inputs, Takes(folder, "drive")
        self._ticks: Generator[Tick] | None = None
        self._driver = _Driver(robot, inputs, plant.control_dt)

    @property
    def walker(self) -> Walker:
        """What leads the feet in the present run."""
        return self._driver.walker

    def start(self) -> None:
        """Starts the thread."""
        self.takes.room.open()
        super().start()

    def _begin(self) -> None:
        self._finish()
        self._driver = _Driver(self.robot, self._inputs, self.plant.config.control_dt)
        about = {"controller": "whole_body"}
        self.takes.expect(lambda path: Recorder(path, config=LIVE_CONFIG, metadata=about))
        controller = WholeBodyController(self.robot, self._driver.stack)
        estimator = StateEstimator(self.robot, payload=PayloadEstimator(self.robot))
        self._ticks = rollout(
            self.plant, controller, self._driver, [self.takes], estimator=estimator
        )

    def _tick(self) -> None:
        begin = clock.monotonic()
        done = None if self._ticks is None else next(self._ticks, None)
        if done is not None:
            self._inputs.commanded(command_time(begin, done))
            self._driver.odometry.measure(done.truth.q[:3], done.estimate.q[:3])

    def _flush(self) -> None:
        self.takes.flush()

    def _finish(self) -> None:
        if self._ticks is not None:
            self._ticks.close()
            self._ticks = None

    def _picture(self) -> Snapshot:
        plant, walker, data = self.plant, self.walker, self.plant.data
        truth = plant.true_state()
        names = list(self.robot.soles)
        soles = np.array([data.site(name).xpos for name in names])
        loads = np.array([truth.contacts[name][2] for name in names])
        zmp, polygon = plant.zmp(), self._polygon(names)
        if not np.isfinite(zmp).all():
            # Nothing presses: it is drawn where it should be.
            zmp = self._driver.zmp
        lifted, lost = walker.lifting, self._driver.guard.status is DeviceStatus.LOST
        return Snapshot(
            time=plant.time,
            mode=Mode.D if lifted is None else _STEP_MODES[lifted[0]][lifted[1]],
            device=DeviceStatus.LOST if lost else DeviceStatus.OK,
            zmp=zmp,
            zmp_reference=self._driver.zmp,
            com=plant.com,
            soles=soles,
            handles=soles,
            target=None,
            polygon=polygon,
            margin=float(signed_margin(zmp[None], polygon)[0]),
            loads=loads,
            tilt=float(np.arccos(np.clip(1.0 - 2.0 * (truth.q[3:5] @ truth.q[3:5]), -1.0, 1.0))),
            bodies=data.xpos.copy(),
            turns=data.xquat.copy(),
            fallen=plant.fallen,
            paused=self._paused,
            speed=self._speed,
            real_time_factor=self._factor,
            take=self.takes.name,
            heading=self._heading(),
            hands=self._hands(),
            hands_do=tuple(self._driver.hands.status),
            hand_turns=self._driver.hands.orientations(self._torso()[1]),
            gaze=self._driver.gaze.status,
            text=self._text(),
        )

    def _heading(self) -> float:
        x, y, _ = self._torso()[1][:, 0].tolist()
        return math.atan2(y, x)

    def _hands(self) -> np.ndarray:
        """Where the hands are led to [m]."""
        return np.array(self._driver.hands.targets(*self._torso())).reshape(-1, 3)

    def _torso(self) -> tuple[np.ndarray, np.ndarray]:
        site = self.plant.data.site(self.robot.torso)
        return site.xpos, site.xmat.reshape(3, 3)

    def _polygon(self, names: list[str]) -> np.ndarray:
        """Corners of what the robot stands on [m]."""
        lifted = self.walker.lifting
        sites = {
            name: self.plant.data.site(name)
            for foot, name in enumerate(names)
            if lifted != (foot, True)
        }
        return soles_outline(
            self.robot, {name: (s.xpos, s.xmat.reshape(3, 3)) for name, s in sites.items()}
        )

    def _text(self) -> str:
        """How the walk stands, with which velocity, and what was cut of it."""
        ahead, left, turn = self.walker.commands.velocity
        said = f"{self.walker.status.value}: {ahead:.2f} m/s ahead, {left:.2f} m/s to the left, "
        said += f"{turn:.2f} rad/s"
        return f"{said}; {self.walker.notice}" if self.walker.notice else said
