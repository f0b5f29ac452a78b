"""`RealTimeLoop`: a simulated robot against the clock, in a thread of its own."""

import threading
import time as clock
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable

import numpy as np
from jaxtyping import Float64

from poise.apps.live._integrator import BodyLimits
from poise.apps.live._snapshot import Snapshot
from poise.locomotion import BodyCommand, along_ahead, yaw_of
from poise.robots import Robot
from poise.sim import Plant, PlantConfig, Tick

FRAMES_PER_SECOND = 25.0
SLOW = 0.25
"""Speed of slow motion."""

PUSHES = {
    "left": (0.0, 1.0, 0.0),
    "right": (0.0, -1.0, 0.0),
    "forward": (1.0, 0.0, 0.0),
    "back": (-1.0, 0.0, 0.0),
}
"""Where a push goes: ahead, left and up of the robot."""

_PUSH_SPEED, _PUSH_TIME = 0.08, 0.1
"""A push changes the robot's velocity by this [m/s] within this time [s]."""

_PUSH_EVERY = 0.3
"""Robot time from one push to the next at least [s]."""

_LATE = 0.1
"""Further behind the clock than this [s] the loop gives up catching up."""

_FLUSH_EVERY = 0.25


def command_time(begin: float, tick: Tick) -> float:
    """When a tick's command was there, which is before the plant's step."""
    return begin + tick.estimator_seconds + tick.leader_seconds + tick.controller_seconds


class RealTimeLoop(ABC):
    """Runs the robot against the clock and never waits for anybody who looks.

    Orders (`push`, `pause`, ...) are carried out between ticks. Of each kind only the newest waits
    for that, and a push that comes while the robot is being pushed is dropped: however many orders
    come, they cost the robot no time. An error ends the thread, finishes what is recorded and stays
    in `error`.

    Attributes:
        robot: the robot.
        plant: the simulated one.
        snapshot: the newest picture of the run; None before the first tick.
        error: what ended the thread, if anything went wrong.
        forces: of the ground on the left and the right foot in the last tick, forward, left and up
            [N], for a device that lets the operator feel them; None where nobody leads feet.
        limits: how far the operator can send height, torso and feet.
        asked: body as commanded by the operator.
    """

    def __init__(self, robot: Robot, plant: PlantConfig, seed: int) -> None:
        self.robot = robot
        self.plant = Plant(robot, plant, seed=seed)
        self._dt = plant.control_dt
        self.error: Exception | None = None
        self.snapshot: Snapshot | None = None
        self.forces: list[list[float]] | None = None
        self.limits, self.asked = BodyLimits(), BodyCommand()
        self._orders: dict[str, Callable[[], None]] = {}
        self._ordering = threading.Lock()
        self._pushed_until = 0.0
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
        """Pushes the torso for a while [s], by a force in the world [N]."""
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
        """Pushes the torso as the robot faces; not while it is pushed, or has only just been."""
        force = self.robot.mass * _PUSH_SPEED / _PUSH_TIME * np.array(PUSHES[direction])

        def act() -> None:
            if self.plant.time >= self._pushed_until:
                self._pushed_until = self.plant.time + _PUSH_EVERY
                self._push(along_ahead(force.tolist(), self._ahead()), _PUSH_TIME)

        self._order("push", act)

    def pause(self, on: bool) -> None:
        """Lets time stand still, or go on."""

        def act() -> None:
            self._paused = on

        self._order("pause", act)

    def slow(self, on: bool) -> None:
        """Slow motion, or real time."""

        def act() -> None:
            self._speed = SLOW if on else 1.0

        self._order("slow", act)

    def reset(self) -> None:
        """Puts the robot back to its start, and begins anew."""

        def act() -> None:
            self._paused, self._pushed_until = False, 0.0
            self.plant.reset()
            self._begin()

        self._order("reset", act)

    def _ahead(self) -> float:
        """Where the robot faces, to the left of the world's x axis [rad]."""
        return yaw_of(self.plant.data.site(self.robot.pelvis).xmat.reshape(3, 3))

    def _order(self, kind: str, act: Callable[[], None]) -> None:
        with self._ordering:
            # The newest is the last one to be carried out, too.
            self._orders.pop(kind, None)
            self._orders[kind] = act

    def _carry_out(self) -> None:
        with self._ordering:
            orders, self._orders = self._orders, {}
        for act in orders.values():
            act()

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
            self._carry_out()
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
