"""`LiveLoop`: a rollout in real time, in a thread of its own, led by whoever is at the controls."""

import time as clock
from collections import deque
from collections.abc import Generator, Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise.apps.live._inputs import OperatorInputs
from poise.apps.live._integrator import LiveFeet
from poise.apps.live._log import LIVE_CONFIG, Takes
from poise.apps.live._odometry import Odometry
from poise.apps.live._real_time import RealTimeLoop, command_time
from poise.apps.live._snapshot import Snapshot
from poise.apps.teleoperation import (
    TORQUE_TELEOP_PLANT,
    RecordedPush,
    Recording,
    TeleopRecorder,
    TeleopSetup,
    foot_forces,
)
from poise.locomotion import (
    Mode,
    StepEnd,
    StepTeleoperator,
    TeleopParameters,
    TeleopStatus,
    signed_margin,
    soles_outline,
    yaw_of,
)
from poise.robots import Robot
from poise.sim import PlantConfig, Tick, check_period, rollout


def support_polygon(
    teleoperator: StepTeleoperator, status: TeleopStatus
) -> Float64[np.ndarray, "h 2"]:
    """The corners of what the robot stands on, in the teleoperator's world."""
    robot, placement = teleoperator.robot, teleoperator.estimator.dynamics.placement
    names = teleoperator.soles
    if status.mode.single and status.mode.support is not None:
        names = names[status.mode.support : status.mode.support + 1]
    return soles_outline(robot, {name: placement(robot.frame_id(name)) for name in names})


def _mode_text(status: TeleopStatus) -> str:
    """What the robot does; why a step did not end as it should, until the next one."""
    ended = status.ended if status.mode is Mode.D else None
    return status.mode.value if ended in (None, StepEnd.LANDED) else ended.value


class _LiveTeleoperator(StepTeleoperator):
    """A teleoperator whose signals are in the simulator's world, as the rest of the log is.

    Attributes:
        odometry: of the simulator's world.
    """

    odometry = Odometry()

    def signals(self) -> Mapping[str, np.ndarray | float | str]:
        """Those of a teleoperator, moved."""
        told = dict(super().signals())
        for name, value in told.items():
            if name in _PLACES or name.startswith("target/"):
                told[name] = self.odometry.drawn(np.asarray(value))
        return told


_PLACES = (
    "zmp_reference", "estimate/zmp", "estimate/cart_table_zmp", "estimate/com", "estimate/soles",
    "foot_target",
)  # fmt: skip
"""Signals of a teleoperator that are points."""


class _Making(NamedTuple):
    """What a run is made with: the plant's seed, and what `StepTeleoperator` has."""

    seed: int
    parameters: TeleopParameters | None
    rotator: bool
    solved_by: str | None


def _made_with(
    recording: Recording | None, robot: Robot, actuation: str, asked: _Making
) -> _Making:
    """Settings of a recording that the robot can repeat, but for those that are asked for."""
    made = None if recording is None else recording.setup_for(robot, actuation)
    if made is None:
        return asked
    parameters, solved_by = asked.parameters or made.parameters, asked.solved_by or made.solved_by
    return _Making(made.seed, parameters, made.rotator, solved_by)


class LiveLoop(RealTimeLoop):
    """Real-time loop of a biped with step teleoperation."""

    def __init__(
        self,
        robot: Robot,
        inputs: OperatorInputs,
        takes: Takes,
        *,
        recording: Recording | None = None,
        plant: PlantConfig = TORQUE_TELEOP_PLANT,
        seed: int = 0,
        parameters: TeleopParameters | None = None,
        solved_by: str | None = None,
    ) -> None:
        asked = _Making(seed, parameters, True, solved_by)
        self._making = _made_with(recording, robot, plant.actuation, asked)
        super().__init__(robot, plant, self._making.seed)
        self.takes = takes
        self._inputs, self._recording = inputs, recording
        self._config, self._torso = plant, robot.frame_id(robot.torso)
        self._ticks: Generator[Tick] | None = None
        self._start()

    def start(self) -> None:
        """Starts the thread."""
        self.takes.room.open()
        super().start()

    # The thread ----------------------------------------------------------------------------------

    def _tick(self) -> None:
        while self._pushes and self._pushes[0].tick <= round(self.plant.time / self._dt):
            push = self._pushes.popleft()
            self._push(np.array(push.force), push.duration)
        begin = clock.monotonic()
        done = None if self._ticks is None else next(self._ticks, None)
        if done is not None:
            self._inputs.commanded(command_time(begin, done))
            self.forces, self.asked = foot_forces(self.teleoperator), self._feet.body

    def _push(self, force: Float64[np.ndarray, "3"], duration: float) -> None:
        if not self.plant.fallen:
            self.takes.push(round(self.plant.time / self._dt), force, duration)
        super()._push(force, duration)

    def _start(self) -> None:
        """Teleoperator and device as at the beginning."""
        self._end_rollout()
        self.teleoperator = _LiveTeleoperator(
            self.robot,
            actuation=self._config.commanded,
            parameters=self._making.parameters,
            rotator=self._making.rotator,
            solved_by=self._making.solved_by,
            servo_gains=(self._config.servo.stiffness, self._config.servo.damping),
        )
        check_period(self.teleoperator, self._dt)
        self.teleoperator.odometry = self._odometry = Odometry()
        self._feet = LiveFeet(self._inputs, self.teleoperator, self._odometry)
        self.limits = self._feet.limits
        self.teleoperator.device, self._pushes = self._feet, deque[RecordedPush]()
        if self._recording is not None:
            self.teleoperator.device = device = self._recording.device(self.teleoperator)
            self._pushes.extend(device.pushes)

    def _begin(self) -> None:
        if self._ticks is not None:
            self._start()
        teleoperator, making = self.teleoperator, self._making
        setup = TeleopSetup.of(teleoperator, self._config, seed=making.seed, rotator=making.rotator)
        about = {"controller": "step teleoperation"}
        self.takes.expect(
            lambda path: TeleopRecorder(
                path, teleoperator, setup, config=LIVE_CONFIG, metadata=about
            )
        )
        self._ticks = rollout(
            self.plant,
            self.teleoperator.controller(),
            self.teleoperator,
            [self.takes],
            estimator=self.teleoperator.estimator,
        )

    def _flush(self) -> None:
        self.takes.flush()

    def _finish(self) -> None:
        self._end_rollout()

    def _end_rollout(self) -> None:
        if self._ticks is not None:
            self._ticks.close()

    # What is shown -------------------------------------------------------------------------------

    def _picture(self) -> Snapshot | None:
        teleoperator, plant = self.teleoperator, self.plant
        status = teleoperator.status
        if status is None:
            return self.snapshot
        self._compare()
        drawn = self._odometry.drawn
        polygon = support_polygon(teleoperator, status)
        return Snapshot(
            time=plant.time,
            mode=status.mode,
            device=status.device,
            zmp=drawn(status.zmp),
            zmp_reference=drawn(status.zmp_reference),
            com=drawn(status.com),
            soles=drawn(np.array(status.soles)),
            handles=drawn(np.array(self._feet.places)),
            target=None if status.target is None else drawn(status.target),
            polygon=drawn(polygon),
            margin=float(signed_margin(status.zmp[None], polygon)[0]),
            loads=status.loads.copy(),
            tilt=status.tilt,
            bodies=plant.data.xpos.copy(),
            turns=plant.data.xquat.copy(),
            fallen=plant.fallen,
            paused=self._paused,
            speed=self._speed,
            real_time_factor=self._factor,
            take=self.takes.name,
            heading=yaw_of(teleoperator.estimator.dynamics.placement(self._torso)[1]),
            hands=drawn(np.array(status.hand_targets).reshape(-1, 3)),
            hands_do=status.hands,
            hand_turns=status.hand_rotations,
            gaze=status.gaze,
            text=_mode_text(status),
        )

    def _compare(self) -> None:
        """Compare the teleoperator's dead reckoning with the plant's truth, at the stance sole."""
        stance = self.teleoperator.estimator.stance
        site = self.plant.data.site(self.teleoperator.soles[stance])
        self._odometry.measure(site.xpos, self.teleoperator.estimator.sole(stance))
