"""`LiveLoop`: a rollout against the clock, in a thread of its own."""

import math
import threading
import time as clock
from bisect import insort
from collections import deque
from collections.abc import Generator
from dataclasses import dataclass, fields
from enum import Enum
from typing import Any, Literal

import numpy as np
from jaxtyping import Float64
from msgspec import Struct
from pydantic.alias_generators import to_camel

from poise.apps.deployment import LinkedPlant
from poise.apps.live._leads import Lead
from poise.apps.live._log import Takes
from poise.apps.teleoperation import RecordedPush
from poise.locomotion import (
    DeviceStatus,
    HandStatus,
    Mode,
    along_ahead,
    signed_margin,
    soles_outline,
    yaw_of,
)
from poise.sim import Plant, Tick, rollout

STATUS_PERIOD = 0.04  # of the state that pages get [s]


class Order(Struct, forbid_unknown_fields=True, tag_field="do", tag=str.lower):
    """Message of an operator's page beside `OperatorSample`, by the name of its class."""


class PushOrder(Order, tag="push"):
    """Push on the torso, with its direction in the robot's heading frame."""

    value: Literal["left", "right", "forward", "back"]


class Pause(Order):
    """Stop time, or let it go on."""

    value: bool


class Slow(Order):
    """Slow motion, or real time."""

    value: bool


class Reset(Order):
    """Reset the robot to its start, and restart."""


class Stop(Order):
    """Emergency stop: damp a robot behind a link, or stop the time of a simulated one."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Snapshot:
    """State of a live run at one time; positions in the simulator's world."""

    time: float  # of the robot [s]
    mode: Mode
    mode_text: str
    device: DeviceStatus
    zmp: Float64[np.ndarray, "2"]  # measured [m]
    zmp_reference: Float64[np.ndarray, "2"]  # [m]
    com: Float64[np.ndarray, "3"]  # [m]
    soles: Float64[np.ndarray, "2 3"]  # left and right [m]
    handles: Float64[np.ndarray, "2 3"]  # where the operator holds the feet [m]
    target: Float64[np.ndarray, "3"] | None = None  # of the swing foot [m]
    polygon: Float64[np.ndarray, "h 2"]  # corners of the support polygon, counter-clockwise [m]
    margin: float  # of the ZMP to its nearest edge, negative outside [m]
    loads: Float64[np.ndarray, "2"]  # on the soles [N]
    landings: int  # of feet that had been in the air; none of a walk
    tilt: float  # of the torso [rad]
    heading: float  # of the torso, to the left of the world's x axis [rad]
    hands: Float64[np.ndarray, "k 3"]  # targets, left and right [m]
    hands_do: tuple[HandStatus, ...]
    hand_turns: tuple[Float64[np.ndarray, "9"] | None, ...]  # world_R_hand of targets, by rows
    gaze: HandStatus | None  # None where nothing can turn it
    bodies: Float64[np.ndarray, " b"]  # positions of the simulator's bodies [m]
    turns: Float64[np.ndarray, " t"]  # their quaternions (w, x, y, z)
    fallen: bool
    stopped: str  # trouble for which a robot behind a link is damped; "" for none
    paused: bool
    speed: float  # commanded robot time over wall-clock time
    real_time_factor: float  # part of that speed reached in the last second
    take: str  # name of the recording, or why there is none

    def message(self) -> dict[str, Any]:
        """Return the members of the status that a page gets."""
        told = {to_camel(f.name): _plain(getattr(self, f.name)) for f in fields(self)}
        return told | {"deviceText": self.device.value}


def _plain(value: Any) -> Any:
    """A value as JSON, rounded to displayed precision."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    if isinstance(value, np.ndarray):
        return value.round(4).tolist()
    return round(value, 4) if isinstance(value, float) else value


class LiveLoop:
    """Real-time loop of a simulated robot, with orders from any thread between ticks."""

    def __init__(self, lead: Lead, takes: Takes, plant: Plant | None = None) -> None:
        self.lead, self.takes = lead, takes
        self.plant = Plant(lead.robot, lead.plant, seed=lead.seed) if plant is None else plant
        self.linked = isinstance(self.plant, LinkedPlant)
        self.error: Exception | None = None
        self.snapshot: Snapshot | None = None
        self._ticks = self._rollout()
        self._orders: dict[type[Order], Order] = {}
        self._ordering = threading.Lock()
        self._pushed_until = 0.0
        self._stop = threading.Event()
        self._paused, self._speed = False, 1.0
        self._show_at = self._flush_at = 0.0
        self._progress: deque[tuple[float, float]] = deque()
        self._thread = threading.Thread(target=self._run, name="poise live loop", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self.takes.open()
        self.takes.expect(self.lead)
        self._thread.start()

    def stop(self) -> None:
        """End the thread; the recording is finished when this returns."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        self._ticks.close()
        if isinstance(self.plant, LinkedPlant):
            self.plant.body.close()

    @property
    def running(self) -> bool:
        """True while the thread is alive."""
        return self._thread.is_alive()

    def order(self, order: Order) -> None:
        """Carry out an order after the tick; of each kind only the newest waits."""
        with self._ordering:
            # The newest is the last one to be carried out, too.
            self._orders.pop(type(order), None)
            self._orders[type(order)] = order

    def _carry_out(self) -> None:
        with self._ordering:
            orders, self._orders = self._orders, {}
        for order in orders.values():
            match order:
                case PushOrder():
                    self._push(order.value)
                case Pause():
                    self._paused = order.value
                case Slow():
                    self._speed = 0.25 if order.value else 1.0
                case Stop() if isinstance(self.plant, LinkedPlant):
                    self.plant.body.watchdog.stop()
                case Stop():
                    self._paused = True
                case _:
                    self._restart()

    # The thread ----------------------------------------------------------------------------------

    def _rollout(self) -> Generator[Tick]:
        """A run from now on, with the pushes of a recording."""
        lead, plant = self.lead, self.plant
        for push in lead.pushes:
            start = push.tick * plant.control_dt
            plant.push(lead.robot.torso, push.force, push.duration, start)
        leader, estimator = lead.leader, lead.estimator
        if isinstance(plant, LinkedPlant):
            leader, estimator = plant.body.follow(leader), plant.watch(estimator)
        return rollout(plant, lead.controller(), leader, [self.takes], estimator=estimator)

    def _restart(self) -> None:
        self._ticks.close()
        self._paused, self._pushed_until = False, 0.0
        self.plant.reset()
        self.lead.begin()
        self.takes.expect(self.lead)
        self._ticks = self._rollout()

    def _run(self) -> None:
        try:
            self._keep_time()
        except Exception as error:  # Whatever it is, who waits for the run has to see it.
            self.error = error
            self._ticks.close()

    def _keep_time(self, *, late: float = 0.1) -> None:
        """Take turns when they are due; farther behind the clock, give up catching up."""
        due = clock.perf_counter()
        while not self._stop.is_set():
            if self.turn(clock.perf_counter()):
                due += self.plant.control_dt / self._speed
            else:
                due = clock.perf_counter() + 0.01
            ahead = due - clock.perf_counter()
            if self.linked:  # Its steps wait for the robot's states.
                due = clock.perf_counter()
            elif ahead > 0.0:
                clock.sleep(ahead)
            elif ahead < -late:
                due = clock.perf_counter()

    def turn(self, now: float, *, flush_every: float = 0.25) -> bool:
        """Carry out orders, run a tick and show it at a time [s]; return False in standstill."""
        self._carry_out()
        moves = not (self._paused or self.plant.fallen)
        if moves:
            self._tick()
        else:
            self._progress.clear()
        if now >= self._show_at:
            if moves:
                self._measure(now)
            if self.plant.time > 0.0:
                self.snapshot = self._picture()
            self._show_at = max(self._show_at + STATUS_PERIOD, now)
        if now >= self._flush_at:
            self.takes.flush()
            self._flush_at = now + flush_every
        return moves

    def _tick(self) -> None:
        begin, tick = clock.monotonic(), next(self._ticks)
        # The command was there before the plant's step.
        spent = tick.estimator_seconds + tick.leader_seconds + tick.controller_seconds
        self.lead.inputs.commanded(begin + spent)
        self.lead.take_in(tick, self.plant)

    def _push(self, way: str, *, speed: float = 0.08, seconds: float = 0.1) -> None:
        """Change the robot's velocity [m/s] within a time [s], which passes thrice between two."""
        lead, plant = self.lead, self.plant
        if plant.fallen or plant.time < self._pushed_until:
            return
        self._pushed_until = plant.time + 3.0 * seconds
        direction = (
            float(way == "forward") - float(way == "back"),
            float(way == "left") - float(way == "right"),
            0.0,
        )
        strength = lead.robot.mass * speed / seconds
        ahead = yaw_of(self._site(lead.robot.pelvis)[1])
        x, y, z = (strength * along_ahead(direction, ahead)).tolist()
        push = RecordedPush(round(plant.time / plant.control_dt), (x, y, z), seconds)
        insort(lead.pushes, push)
        plant.push(lead.robot.torso, push.force, push.duration)

    # The picture ---------------------------------------------------------------------------------

    def _site(self, name: str) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3 3"]]:
        site = self.plant.data.site(name)
        return site.xpos.copy(), site.xmat.reshape(3, 3).copy()

    def _picture(self) -> Snapshot:
        lead, plant, shown = self.lead, self.plant, self.lead.shown()
        mode: Mode = shown["mode"]
        soles = {name: self._site(name) for name in lead.robot.soles}
        swing = 1 - mode.support if mode.single and mode.support is not None else None
        standing = {name: at for foot, (name, at) in enumerate(soles.items()) if foot != swing}
        polygon = soles_outline(lead.robot, standing)
        zmp = plant.zmp(max(place[2] for place, _ in standing.values()))
        if not np.isfinite(zmp).all():
            # Nothing presses: it is drawn at its reference.
            zmp = shown["zmp_reference"]
        contacts = plant.true_state().contacts
        places = np.array([place for place, _ in soles.values()])
        shown.setdefault("handles", places)
        torso = self._site(lead.robot.torso)
        return Snapshot(
            **shown,
            time=plant.time,
            zmp=zmp,
            com=plant.com,
            soles=places,
            polygon=polygon,
            margin=float(signed_margin(zmp[None], polygon)[0]),
            loads=np.array([contacts[name][2] for name in soles]),
            landings=lead.landings,
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
            stopped=plant.trouble if self.linked else "",
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
