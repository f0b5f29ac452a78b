"""`LiveLoop`: a rollout in real time, in a thread of its own, led by whoever is at the controls.

`Snapshot`: how the robot stands, as the page shows it, some 25 times a second.
"""

import queue
import threading
import time as clock
from collections import deque
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.apps.live._inputs import LiveFeet, OperatorInputs
from poise.apps.live._log import LOG_SUFFIX, LiveLog, Takes
from poise.apps.teleoperation import TELEOP_PLANT, teleop_setup
from poise.locomotion import (
    DeviceStatus,
    Mode,
    RecordedPush,
    Recording,
    StepTeleoperator,
    TeleopStatus,
    convex_hull,
    signed_margin,
    sole_rectangle,
)
from poise.robots import Robot
from poise.sim import Plant, PlantConfig, Tick, rollout


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Snapshot:
    """One moment of a live run; positions in the drawn world, which is the simulator's.

    Attributes:
        time: of the robot [s].
        mode: which feet carry the robot.
        device: what became of the operator's last sample.
        zmp: measured, x and y [m].
        zmp_reference: of it [m].
        com: estimated [m].
        soles: left and right [m].
        handles: where the operator holds the left and the right foot [m].
        target: where the foot in the air is sent [m].
        polygon: the support polygon's corners, counter-clockwise [m].
        margin: of the ZMP to the polygon's nearest edge, negative outside [m].
        loads: on the soles, left and right [N].
        tilt: of the torso [rad].
        bodies: where each body of the simulator is [m].
        turns: and how it is turned, (w, x, y, z).
        fallen: whether the robot fell.
        paused: whether time stands still.
        speed: robot time over wall-clock time that is asked for.
        real_time_factor: what the last second reached of that speed.
        take: name of the recording.
    """

    time: float
    mode: Mode
    device: DeviceStatus
    zmp: Float64[np.ndarray, "2"]
    zmp_reference: Float64[np.ndarray, "2"]
    com: Float64[np.ndarray, "3"]
    soles: Float64[np.ndarray, "2 3"]
    handles: Float64[np.ndarray, "2 3"]
    target: Float64[np.ndarray, "3"] | None
    polygon: Float64[np.ndarray, "h 2"]
    margin: float
    loads: Float64[np.ndarray, "2"]
    tilt: float
    bodies: Float64[np.ndarray, "B 3"]
    turns: Float64[np.ndarray, "B 4"]
    fallen: bool
    paused: bool
    speed: float
    real_time_factor: float
    take: str


def support_polygon(
    teleoperator: StepTeleoperator, status: TeleopStatus
) -> Float64[np.ndarray, "h 2"]:
    """The corners of what the robot stands on, in the teleoperator's world.

    Args:
        teleoperator: knows where the soles are and how they are turned.
        status: of the last tick.

    Returns:
        x and y, counter-clockwise [m].
    """
    robot, dynamics = teleoperator.robot, teleoperator.estimator.dynamics
    feet = [status.mode.support] if status.mode.single else [0, 1]
    corners: list[tuple[float, float]] = []
    for foot in feet:
        assert foot is not None
        name = teleoperator.soles[foot]
        frame = dynamics.frame(robot.frame_id(name))
        sole = robot.soles[name]
        corners += sole_rectangle(frame.position, frame.rotation, (sole.length, sole.width))
    return np.array(convex_hull(corners))


FRAMES_PER_SECOND = 25.0
SLOW = 0.25
"""Speed of slow motion."""

PUSHES = {
    "left": (0.0, 1.0, 0.0),
    "right": (0.0, -1.0, 0.0),
    "forward": (1.0, 0.0, 0.0),
    "back": (-1.0, 0.0, 0.0),
}
"""Where a push goes."""

_PUSH_SPEED, _PUSH_TIME = 0.08, 0.1
"""A push changes the robot's velocity by this [m/s] within this time [s]."""

_LATE = 0.1
"""Further behind the clock than this [s] the loop gives up catching up."""

_FLUSH_EVERY = 0.25
_ENDLESS = 1e9
"""Duration of a take that goes on [s]."""


class _LiveTeleoperator(StepTeleoperator):
    """A teleoperator whose signals are in the simulator's world, as the rest of the log is.

    Attributes:
        offset: from the world that it estimates to the simulator's [m].
    """

    offset: Float64[np.ndarray, "3"] = np.zeros(3)

    def signals(self) -> Mapping[str, np.ndarray | float | str]:
        """Those of a teleoperator, moved."""
        told = dict(super().signals())
        for name, value in told.items():
            if name in _PLACES or name.startswith("target/"):
                place = np.asarray(value)
                told[name] = place + self.offset[: place.shape[-1]]
        return told


_PLACES = (
    "zmp_reference", "estimate/zmp", "estimate/cart_table_zmp", "estimate/com", "estimate/soles",
    "foot_target",
)  # fmt: skip
"""Signals of a teleoperator that are points."""


class LiveLoop:
    """Runs the robot against the clock and never waits for anybody who looks.

    Orders (`push`, `pause`, ...) are carried out between ticks. An error ends the thread, finishes
    the recording and stays in `error`.

    Args:
        robot: a biped.
        inputs: what the operator does.
        takes: where the run is recorded.
        recording: plays this in place of a person when given.
        plant: takes what the teleoperator is to command, at its tick.
        seed: of the sensor noise.

    Raises:
        ConfigurationError: the robot cannot be walked.
        RecordingError: the recording is of another robot.

    Attributes:
        snapshot: the newest picture of the run; None before the first tick.
        log: of each take, beside its recording.
        error: what ended the thread, if anything went wrong.
    """

    def __init__(
        self,
        robot: Robot,
        inputs: OperatorInputs,
        takes: Takes,
        *,
        recording: Recording | None = None,
        plant: PlantConfig = TELEOP_PLANT,
        seed: int = 0,
    ) -> None:
        self.robot, self.takes = robot, takes
        self._inputs, self._recording, self._seed = inputs, recording, seed
        self._config, self._dt = plant, plant.control_dt
        self._weight = robot.mass
        self.plant = Plant(robot, plant, seed=seed)
        self.log = LiveLog()
        self.error: Exception | None = None
        self._orders: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._paused, self._speed = False, 1.0
        self._progress: deque[tuple[float, float]] = deque()
        self._ticks: Generator[Tick] | None = None
        self._start()
        self.snapshot: Snapshot | None = None
        self._thread = threading.Thread(target=self._run, name="poise teleop loop", daemon=True)

    # What others may ask for, from any thread ----------------------------------------------------

    def start(self) -> None:
        """Starts the thread."""
        self._begin_take()
        self._thread.start()

    def stop(self) -> None:
        """Ends the thread; the recording is finished when this returns."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        self._finish_take()

    @property
    def running(self) -> bool:
        """Whether the thread is alive."""
        return self._thread.is_alive()

    def push(self, direction: str) -> None:
        """Pushes the torso.

        Args:
            direction: one of `PUSHES`.
        """
        force = self._weight * _PUSH_SPEED / _PUSH_TIME * np.array(PUSHES[direction])
        self._orders.put(lambda: self._push(force, _PUSH_TIME))

    def pause(self, on: bool) -> None:
        """Lets time stand still, or go on."""

        def act() -> None:
            self._paused = on

        self._orders.put(act)

    def slow(self, on: bool) -> None:
        """Slow motion, or real time."""

        def act() -> None:
            self._speed = SLOW if on else 1.0

        self._orders.put(act)

    def reset(self) -> None:
        """Puts the robot back to its start, and begins a new take."""

        def act() -> None:
            self._paused = False
            self._start()
            self._begin_take()

        self._orders.put(act)

    # The thread ----------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._loop()
        except Exception as error:  # Whatever it is, the one who waits for the run has to see it.
            self.error = error
            self._finish_take()

    def _loop(self) -> None:
        due = show = flush = clock.perf_counter()
        while not self._stop.is_set():
            while not self._orders.empty():
                self._orders.get()()
            still = self._paused or self.plant.fallen
            if not still:
                self._tick()
            now = clock.perf_counter()
            if now >= show:
                self._measure(now)
                self.snapshot = self._picture()
                show = max(show + 1.0 / FRAMES_PER_SECOND, now)
            if now >= flush:
                self.takes.flush()
                flush = now + _FLUSH_EVERY
            if still:
                self._progress.clear()
                due = clock.perf_counter() + 0.01
            else:
                due += self._dt / self._speed
            ahead = due - clock.perf_counter()
            if ahead > 0.0:
                clock.sleep(ahead)
            elif ahead < -_LATE:
                due = clock.perf_counter()

    def _tick(self) -> None:
        while self._pushes and self._pushes[0].tick <= round(self.plant.time / self._dt):
            push = self._pushes.popleft()
            self._push(np.array(push.force), push.duration)
        if self._ticks is not None and next(self._ticks, None) is not None:
            status = self.teleoperator.status
            tick = round(self.plant.time / self._dt) - 1
            self.takes.sample(tick, None if status is None else status.sample)
        if self.plant.fallen:
            self.takes.flush()

    def _push(self, force: Float64[np.ndarray, "3"], duration: float) -> None:
        if self.plant.fallen:
            return
        self.takes.push(round(self.plant.time / self._dt), force, duration)
        x, y, z = force.tolist()
        self.plant.push(self.robot.torso, (x, y, z), duration)

    def _start(self) -> None:
        """Robot, teleoperator and device as at the beginning."""
        self._end_rollout()
        self.plant.reset()
        self.teleoperator = _LiveTeleoperator(self.robot, actuation=self._config.actuation)
        self._feet = LiveFeet(self._inputs, self.teleoperator)
        self.teleoperator.device, self._pushes = self._feet, deque[RecordedPush]()
        if self._recording is not None:
            self.teleoperator.device = self._recording.device(robot=self.robot.name, dt=self._dt)
            self._pushes.extend(self._recording.pushes)

    def _begin_take(self) -> None:
        setup = teleop_setup(
            self.teleoperator,
            self._config,
            seed=self._seed,
            duration=_ENDLESS,
        )
        self.takes.begin(setup)
        self.log.expect(self.takes.path.with_suffix(LOG_SUFFIX))
        self._ticks = rollout(
            self.plant,
            self.teleoperator.controller(),
            self.teleoperator,
            [self.log],
            estimator=self.teleoperator.estimator,
        )

    def _finish_take(self) -> None:
        self.takes.finish()
        self._end_rollout()

    def _end_rollout(self) -> None:
        if self._ticks is not None:
            self._ticks.close()

    # What is shown -------------------------------------------------------------------------------

    def _measure(self, now: float) -> None:
        """Keeps a second's worth of progress."""
        self._progress.append((now, self.plant.time))
        while now - self._progress[0][0] > 1.0:
            self._progress.popleft()

    @property
    def _factor(self) -> float:
        if len(self._progress) < 2:
            return 1.0
        (began, first), (now, last) = self._progress[0], self._progress[-1]
        # Negative across a reset.
        return max(0.0, (last - first) / (now - began) / self._speed)

    def _picture(self) -> Snapshot | None:
        teleoperator, plant = self.teleoperator, self.plant
        status = teleoperator.status
        if status is None:
            return self.snapshot
        offset = self._offset()
        self._feet.offset = self.teleoperator.offset = offset
        flat = offset[:2]
        polygon = support_polygon(teleoperator, status)
        return Snapshot(
            time=plant.time,
            mode=status.mode,
            device=status.device,
            zmp=status.zmp + flat,
            zmp_reference=status.zmp_reference + flat,
            com=status.com + offset,
            soles=np.array(status.soles) + offset,
            handles=np.array(self._feet.places) + offset,
            target=None if status.target is None else status.target + offset,
            polygon=polygon + flat,
            margin=float(signed_margin(status.zmp[None], polygon)[0]),
            loads=status.loads.copy(),
            tilt=status.tilt,
            bodies=plant.data.xpos.copy(),
            turns=plant.data.xquat.copy(),
            fallen=plant.fallen,
            paused=self._paused,
            speed=self._speed,
            real_time_factor=self._factor,
            take=self.takes.path.name,
        )

    def _offset(self) -> Float64[np.ndarray, "3"]:
        """From the teleoperator's dead reckoning to the plant's truth, at the stance sole [m]."""
        stance = self.teleoperator.estimator.stance
        site = self.plant.data.site(self.teleoperator.soles[stance])
        return site.xpos - self.teleoperator.estimator.sole(stance)
