"""`RealTimeLoop`: a simulated robot against the clock, in a thread of its own."""

import queue
import threading
import time as clock
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable

import numpy as np
from jaxtyping import Float64

from poise.apps.live._snapshot import Snapshot
from poise.robots import Robot
from poise.sim import Plant, PlantConfig

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


class RealTimeLoop(ABC):
    """Runs the robot against the clock and never waits for anybody who looks.

    Orders (`push`, `pause`, ...) are carried out between ticks. An error ends the thread, finishes
    what is recorded and stays in `error`.

    Args:
        robot: the robot.
        plant: what it is simulated by.
        seed: of the sensor noise.

    Attributes:
        robot: the robot.
        plant: the simulated one.
        snapshot: the newest picture of the run; None before the first tick.
        error: what ended the thread, if anything went wrong.
    """

    def __init__(self, robot: Robot, plant: PlantConfig, seed: int) -> None:
        self.robot = robot
        self.plant = Plant(robot, plant, seed=seed)
        self._dt = plant.control_dt
        self.error: Exception | None = None
        self.snapshot: Snapshot | None = None
        self._orders: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._paused, self._speed = False, 1.0
        self._progress: deque[tuple[float, float]] = deque()
        self._thread = threading.Thread(target=self._run, name="poise live loop", daemon=True)

    # What a loop does for its robot ---------------------------------------------------------------

    @abstractmethod
    def _begin(self) -> None:
        """Begins a run with the robot where it starts, and ends the one before."""

    @abstractmethod
    def _tick(self) -> None:
        """One tick."""

    @abstractmethod
    def _picture(self) -> Snapshot | None:
        """How the robot stands."""

    @abstractmethod
    def _flush(self) -> None:
        """Puts on the disk what was recorded so far."""

    @abstractmethod
    def _finish(self) -> None:
        """Ends the run."""

    def _push(self, force: Float64[np.ndarray, "3"], duration: float) -> None:
        """Pushes the torso [N] for a while [s]."""
        if not self.plant.fallen:
            x, y, z = force.tolist()
            self.plant.push(self.robot.torso, (x, y, z), duration)

    # What others may ask for, from any thread ----------------------------------------------------

    def start(self) -> None:
        """Starts the thread."""
        self._begin()
        self._thread.start()

    def stop(self) -> None:
        """Ends the thread; what is recorded is finished when this returns."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        self._finish()

    @property
    def running(self) -> bool:
        """Whether the thread is alive."""
        return self._thread.is_alive()

    def push(self, direction: str) -> None:
        """Pushes the torso.

        Args:
            direction: one of `PUSHES`.
        """
        force = self.robot.mass * _PUSH_SPEED / _PUSH_TIME * np.array(PUSHES[direction])
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
        """Puts the robot back to its start, and begins anew."""

        def act() -> None:
            self._paused = False
            self.plant.reset()
            self._begin()

        self._orders.put(act)

    # The thread ----------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._loop()
        except Exception as error:  # Whatever it is, the one who waits for the run has to see it.
            self.error = error
            self._finish()

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
                self._flush()
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
