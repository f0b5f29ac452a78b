"""`BadOperator`: random devices. `PoorLink`: samples that are late or lost."""

import math
from bisect import insort
from collections.abc import Callable
from copy import deepcopy
from operator import itemgetter

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_count, checked_kind, checked_number
from poise.errors import ConfigurationError
from poise.locomotion import Device, OperatorSample, StepTeleoperator, TrackedPose


class BadOperator:
    """Two devices moved at random relative to the robot's feet, two to three times a second.

    Lifting, lowering and stepping are drawn twice as often as jumps, taps, jitter and so on.

    Args:
        controller: whose feet the operator looks at.
        seed: of everything random.
    """

    def __init__(self, controller: StepTeleoperator, seed: int) -> None:
        self._controller, self._rng = controller, np.random.default_rng(seed)
        self._hands = [anchor.copy() for anchor in controller.estimator.anchors]
        # From, to, begin and end of the last motion of each
        self._moves = [(hand, hand, 0.0, 0.0) for hand in self._hands]
        self._time, self._next, self._jitter_until, self._jitter = 0.0, 0.5, 0.0, 0.0
        self._silent_until, self._rubbish = 0.0, 0
        self._whims: tuple[Callable[[int], None], ...] = (
            self._lift, self._lift, self._lower, self._lower, self._lower_early, self._step,
            self._step, self._jump, self._shake, self._tap, self._lift_both, self._freeze,
            self._reach_too_far, self._cross, self._send_rubbish,
        )  # fmt: skip

    def sample(self, time: float) -> OperatorSample | None:
        """Draw the devices of a tick; call once a tick."""
        self._time = time
        if time >= self._next:
            whim = self._whims[int(self._rng.integers(len(self._whims)))]
            whim(int(self._rng.integers(2)))
            self._next = time + self._draw(0.05, 0.75)
        for foot, (start, goal, begin, end) in enumerate(self._moves):
            share = 1.0 if time >= end else (time - begin) / (end - begin)
            self._hands[foot] = start + share * (goal - start)
        shake = self._rng.uniform(-1.0, 1.0, (2, 3))
        if time < self._silent_until:
            return None
        left, right = (hand.copy() for hand in self._hands)
        if time < self._jitter_until:
            left, right = left + self._jitter * shake[0], right + self._jitter * shake[1]
        if self._rubbish > 0:
            self._rubbish -= 1
            time, left = time - 1.0, np.full_like(left, np.nan)
        return OperatorSample(time, (TrackedPose.of(left), TrackedPose.of(right)))

    def _draw(self, least: float, most: float) -> float:
        return float(self._rng.uniform(least, most))

    def _go(
        self,
        foot: int,
        place: Float64[np.ndarray, "3"],
        height: tuple[float, float] | None = None,
        seconds: float | None = None,
    ) -> None:
        if height is not None:
            place[2] = self._draw(*height)
        seconds = self._draw(0.1, 0.6) if seconds is None else seconds
        self._moves[foot] = (self._hands[foot].copy(), place, self._time, self._time + seconds)

    def _sole(self, foot: int) -> Float64[np.ndarray, "3"]:
        status = self._controller.status
        return (self._hands[foot] if status is None else status.soles[foot]).copy()

    def _lift(self, foot: int) -> None:
        self._go(foot, self._sole(foot), (0.02, 0.2))

    def _lower(self, foot: int) -> None:
        self._go(foot, self._hands[foot].copy(), (-0.08, 0.0))

    def _lower_early(self, foot: int) -> None:
        """Up, and down again before the foot can have left the ground."""
        self._lift(foot)
        self._hands[foot] = self._moves[foot][1].copy()
        self._lower(foot)

    def _step(self, foot: int) -> None:
        place = self._hands[foot].copy()
        place[:2] += self._rng.normal(0.0, 0.12, 2)
        self._go(foot, place, (0.0, 0.15))

    def _jump(self, foot: int) -> None:
        place = self._hands[foot] + self._rng.uniform(-0.3, 0.3, 3)
        self._go(foot, place, seconds=1e-3)

    def _shake(self, _: int) -> None:
        self._jitter = self._draw(0.005, 0.1)
        self._jitter_until = self._time + self._draw(0.2, 1.5)

    def _tap(self, foot: int) -> None:
        place = self._sole(foot)
        self._hands[foot] = np.array([*place[:2], self._draw(0.02, 0.08)])
        place[2] = -0.01
        self._go(foot, place, seconds=self._draw(0.05, 0.3))

    def _lift_both(self, foot: int) -> None:
        self._lift(foot)
        self._lift(1 - foot)

    def _freeze(self, _: int) -> None:
        self._silent_until = self._time + self._draw(0.1, 2.0)

    def _reach_too_far(self, foot: int) -> None:
        angle, reach = self._draw(0.0, 2.0 * np.pi), self._draw(0.4, 1.0)
        place = self._sole(foot) + reach * np.array([np.cos(angle), np.sin(angle), 0.0])
        self._go(foot, place, (-0.05, 0.4))

    def _cross(self, foot: int) -> None:
        place = self._sole(1 - foot)
        place[1] += (-1.0 if foot == 0 else 1.0) * self._draw(0.0, 0.3)
        self._go(foot, place, (0.0, 0.1))

    def _send_rubbish(self, _: int) -> None:
        self._rubbish = int(self._rng.integers(1, 40))


class PoorLink:
    """A device at the end of a link that delays every sample, loses some, and may break.

    Args:
        device: at the operator.
        latency: least delay of a sample [s].
        loss: probability that one never arrives.
        seed: of losses and delays.
        jitter: largest random addition to the delay [s], by which samples overtake each other.
        cut: when the link breaks for good [s]; never when None.

    Raises:
        ConfigurationError: a device that gives no samples, or a number that cannot be.
    """

    def __init__(
        self,
        device: Device,
        *,
        latency: float,
        loss: float,
        seed: int,
        jitter: float = 0.0,
        cut: float | None = None,
    ) -> None:
        self._device = checked_kind(device, Device, "the device at the end of the link")
        self._latency = checked_number(latency, "latency of the link [s]")
        self._loss = checked_number(loss, "probability of the link's losses")
        if loss > 1.0:
            raise ConfigurationError(
                "the link's losses have no probability", got=loss, wanted="0 to 1"
            )
        self._jitter = checked_number(jitter, "jitter of the link [s]")
        self._cut = math.inf if cut is None else checked_number(cut, "cut of the link [s]")
        self._rng = np.random.default_rng(checked_count(seed, "seed of the link"))
        self._under_way: list[tuple[float, OperatorSample]] = []

    def sample(self, time: float) -> OperatorSample | None:
        """Return the newest sample that has arrived; call once a tick."""
        sent = self._device.sample(time)
        lost = float(self._rng.random()) < self._loss
        late = self._jitter * float(self._rng.random()) if self._jitter > 0.0 else 0.0
        if time >= self._cut:
            return None
        if sent is not None and not lost:
            # A copy: the device may write its next sample into the same arrays.
            arrives = time + self._latency + late
            insort(self._under_way, (arrives, deepcopy(sent)), key=itemgetter(0))
        newest = None
        # Times are sums of decimal fractions, and rounded.
        while self._under_way and self._under_way[0][0] <= time + 1e-9:
            newest = self._under_way.pop(0)[1]
        return newest
