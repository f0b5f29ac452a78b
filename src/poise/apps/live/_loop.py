"""`LiveLoop`: a rollout against the clock, in a thread of its own."""

import math
import threading
import time as clock
from collections import deque
from collections.abc import Callable, Generator

import numpy as np
from jaxtyping import Float64

from poise.apps.live._gamepad import Landings
from poise.apps.live._leads import Lead
from poise.apps.live._log import Takes
from poise.apps.live._snapshot import Snapshot
from poise.locomotion import along_ahead, signed_margin, soles_outline, yaw_of
from poise.sim import Plant, Tick, rollout

FRAMES_PER_SECOND = 25.0
SLOW = 0.25  # speed of slow motion
# Directions of pushes: ahead, left and up of the robot
PUSHES = {
    "left": (0.0, 1.0, 0.0),
    "right": (0.0, -1.0, 0.0),
    "forward": (1.0, 0.0, 0.0),
    "back": (-1.0, 0.0, 0.0),
}
_PUSH_SPEED, _PUSH_TIME = 0.08, 0.1  # change of the robot's velocity [m/s], within this time [s]
_PUSH_EVERY = 0.3  # least robot time from push to push [s]
_LATE = 0.1  # farther behind the clock the loop gives up catching up [s]
_FLUSH_EVERY = 0.25  # [s]


class LiveLoop:
    """Real-time loop of a simulated robot.

    Orders (`push`, `pause`, ...) come from any thread and are carried out between ticks. Of each
    kind only the newest waits, and a push during a push is dropped: however many orders come, they
    cost the robot no time. An error ends the thread, finishes the recording and stays in `error`.
    """

    def __init__(self, lead: Lead, takes: Takes) -> None:
        self.lead, self.takes = lead, takes
        self.plant = Plant(lead.robot, lead.plant, seed=lead.seed)
        self.error: Exception | None = None
        self.snapshot: Snapshot | None = None
        self._ticks: Generator[Tick] | None = None
        self._begun = False
        self._landings = Landings()
        self._orders: dict[str, Callable[[], None]] = {}
        self._ordering = threading.Lock()
        self._pushed_until = 0.0
        self._stop = threading.Event()
        self._paused, self._speed = False, 1.0
        self._progress: deque[tuple[float, float]] = deque()
        self._thread = threading.Thread(target=self._run, name="poise live loop", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self.takes.open()
        self._begin()
        self._thread.start()

    def stop(self) -> None:
        """End the thread; the recording is finished when this returns."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        self._finish()

    @property
    def running(self) -> bool:
        """True while the thread is alive."""
        return self._thread.is_alive()

    def landings(self) -> int:
        """Return the number of landings of feet that the operator leads."""
        return 0 if self.snapshot is None else self.snapshot.landings

    def push(self, direction: str) -> None:
        """Push the torso as the robot faces."""
        self._order("push", lambda: self._push_towards(np.array(PUSHES[direction])))

    def pause(self, on: bool) -> None:
        """Stop time, or let it go on."""
        self._order("pause", lambda: setattr(self, "_paused", on))

    def slow(self, on: bool) -> None:
        """Switch between slow motion and real time."""
        self._order("slow", lambda: setattr(self, "_speed", SLOW if on else 1.0))

    def reset(self) -> None:
        """Put the robot back to its start, and begin anew."""
        self._order("reset", self._begin)

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

    def _begin(self) -> None:
        lead = self.lead
        if self._ticks is not None:
            self._finish()
            self._paused, self._pushed_until, self._begun = False, 0.0, False
            self.plant.reset()
            lead.begin()
        self.takes.expect(lead.recorder)
        self._ticks = rollout(
            self.plant, lead.controller(), lead.leader, [self.takes], estimator=lead.estimator
        )

    def _finish(self) -> None:
        if self._ticks is not None:
            self._ticks.close()

    def _run(self) -> None:
        try:
            self._keep_time()
        except Exception as error:  # Whatever it is, who waits for the run has to see it.
            self.error = error
            self._finish()

    def _keep_time(self) -> None:
        due = show = flush = clock.perf_counter()
        while not self._stop.is_set():
            self._carry_out()
            still = self._paused or self.plant.fallen
            if not still:
                self._tick()
            now = clock.perf_counter()
            if now >= show:
                self._measure(now)
                if self._begun:
                    self.snapshot = self._picture()
                show = max(show + 1.0 / FRAMES_PER_SECOND, now)
            if now >= flush:
                self.takes.flush()
                flush = now + _FLUSH_EVERY
            if still:
                self._progress.clear()
                due = clock.perf_counter() + 0.01
            else:
                due += self.plant.control_dt / self._speed
            ahead = due - clock.perf_counter()
            if ahead > 0.0:
                clock.sleep(ahead)
            elif ahead < -_LATE:
                due = clock.perf_counter()

    def _tick(self) -> None:
        lead, plant = self.lead, self.plant
        while lead.pushes and lead.pushes[0].tick <= round(plant.time / plant.control_dt):
            push = lead.pushes.popleft()
            self._push(np.array(push.force), push.duration)
        begin = clock.monotonic()
        tick = None if self._ticks is None else next(self._ticks, None)
        if tick is not None:
            # The command was there before the plant's step.
            spent = tick.estimator_seconds + tick.leader_seconds + tick.controller_seconds
            lead.inputs.commanded(begin + spent)
            lead.take_in(tick, plant)
            self._begun = True

    def _push_towards(self, direction: Float64[np.ndarray, "3"]) -> None:
        if self.plant.time >= self._pushed_until:
            self._pushed_until = self.plant.time + _PUSH_EVERY
            force = self.lead.robot.mass * _PUSH_SPEED / _PUSH_TIME * direction
            ahead = yaw_of(self._site(self.lead.robot.pelvis)[1])
            self._push(along_ahead(force.tolist(), ahead), _PUSH_TIME)

    def _push(self, force: Float64[np.ndarray, "3"], duration: float) -> None:
        """Push the torso by a force in the world [N] for a while [s]."""
        if not self.plant.fallen:
            self.takes.push(round(self.plant.time / self.plant.control_dt), force, duration)
            x, y, z = force.tolist()
            self.plant.push(self.lead.robot.torso, (x, y, z), duration)

    # The picture ---------------------------------------------------------------------------------

    def _site(self, name: str) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3 3"]]:
        site = self.plant.data.site(name)
        return site.xpos.copy(), site.xmat.reshape(3, 3).copy()

    def _picture(self) -> Snapshot:
        lead, plant, now = self.lead, self.plant, self.lead.outcome()
        soles = {name: self._site(name) for name in lead.robot.soles}
        swing = 1 - now.mode.support if now.mode.single and now.mode.support is not None else None
        standing = {name: at for foot, (name, at) in enumerate(soles.items()) if foot != swing}
        polygon = soles_outline(lead.robot, standing)
        zmp = plant.zmp(max(place[2] for place, _ in standing.values()))
        if not np.isfinite(zmp).all():
            # Nothing presses: it is drawn at its reference.
            zmp = now.zmp_reference
        contacts = plant.true_state().contacts
        loads = [float(contacts[name][2]) for name in soles]
        places, torso = (
            np.array([place for place, _ in soles.values()]),
            self._site(lead.robot.torso),
        )
        return Snapshot(
            time=plant.time,
            mode=now.mode,
            mode_text=now.mode_text,
            device=now.device,
            zmp=zmp,
            zmp_reference=now.zmp_reference,
            com=plant.com,
            soles=places,
            handles=places if now.handles is None else now.handles,
            target=now.target,
            polygon=polygon,
            margin=float(signed_margin(zmp[None], polygon)[0]),
            loads=np.array(loads),
            landings=0
            if lead.forces is None
            else self._landings.count(loads, now.mode, plant.time),
            tilt=math.acos(max(-1.0, min(1.0, torso[1][2, 2]))),
            heading=yaw_of(torso[1]),
            hands=np.array(lead.hands.targets(*torso)).reshape(-1, 3),
            hands_do=tuple(lead.hands.status),
            hand_turns=tuple(
                None if turn is None else turn.ravel() for turn in lead.hands.orientations(torso[1])
            ),
            gaze=lead.gaze.status,
            bodies=plant.data.xpos.ravel().copy(),
            turns=plant.data.xquat.ravel().copy(),
            fallen=plant.fallen,
            paused=self._paused,
            speed=self._speed,
            real_time_factor=self._factor,
            take=self.takes.name,
        )

    def _measure(self, now: float) -> None:
        """Keep a second's worth of progress."""
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
