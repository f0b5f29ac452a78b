"""`HABITS`: operators who do one thing, over and over, well or badly.

`HabitualOperator`: a device that is led by one of them.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64

from poise.locomotion import BodyCommand, OperatorSample, StepTeleoperator, TrackedPose

Place = Float64[np.ndarray, "3"]

_BEGIN = 0.5
"""Until then the devices rest at the feet [s]."""

_OUT, _FRAME_TIME = (1.0, -1.0), 0.02
"""To which side of the robot each foot is; how often a hand that follows a curve is moved [s]."""


@dataclass(frozen=True, kw_only=True)
class Move:
    """What the hands do next.

    Attributes:
        seconds: how long it takes [s].
        left: where the left device goes, straight and evenly; None where it stays [m].
        right: likewise [m].
        silent: whether nothing is sent meanwhile.
        velocity: of the stick, ahead, to the left [m/s], to the left [rad/s].
        body: what is commanded of the body.
    """

    seconds: float
    left: Place | None = None
    right: Place | None = None
    silent: bool = False
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    body: BodyCommand = field(default_factory=BodyCommand)


@dataclass(frozen=True, kw_only=True)
class Sight:
    """What an operator sees and draws from.

    Attributes:
        teleoperator: whose feet and pelvis they look at.
        size: height of the COM over the soles: lengths of a habit are parts of it [m].
        rng: all that is random.
    """

    teleoperator: StepTeleoperator
    size: float
    rng: np.random.Generator

    def sole(self, foot: int) -> Place:
        """Where a sole is taken to be [m]."""
        status = self.teleoperator.status
        soles = self.teleoperator.estimator.anchors if status is None else status.soles
        return soles[foot].copy()

    def ahead(self, x: float, y: float = 0.0, z: float = 0.0) -> Place:
        """A way along the robot's heading, to its left, and up, in parts of `size` [m]."""
        status = self.teleoperator.status
        yaw = 0.0 if status is None else status.heading
        c, s = np.cos(yaw), np.sin(yaw)
        return self.size * np.array([c * x - s * y, s * x + c * y, z])


Habit = Callable[[Sight], Iterator[Move]]
"""Says again and again what the hands do next."""


def _lead(foot: int, place: Place, seconds: float) -> Move:
    """One device goes somewhere."""
    return Move(seconds=seconds, left=place) if foot == 0 else Move(seconds=seconds, right=place)


def _put_down(sight: Sight, foot: int, seconds: float, depth: float = 0.02) -> Iterator[Move]:
    """The device goes straight down from its foot to somewhat below the other one's ground."""
    place = sight.sole(foot)
    place[2] = sight.sole(1 - foot)[2] - depth
    yield _lead(foot, place, seconds)


def _steps(
    ahead: float, aside: float, height: float, seconds: float, pause: float
) -> Callable[[Sight], Iterator[Move]]:
    """Feet in turn, each lifted, led past the other one, and put down.

    Args:
        ahead: how far a foot comes down ahead of the other one, over `Sight.size`.
        aside: how far the feet go to the left with each step, likewise.
        height: of the lift, likewise.
        seconds: for each of the three.
        pause: until the next step [s].
    """

    def habit(sight: Sight) -> Iterator[Move]:
        width = abs(float((sight.sole(0) - sight.sole(1))[1])) / sight.size
        foot = 1
        while True:
            out = _OUT[foot]
            yield _lead(foot, sight.sole(foot) + sight.ahead(0.0, 0.0, height), seconds)
            there = sight.sole(1 - foot) + sight.ahead(ahead, out * width + aside, height)
            yield _lead(foot, there, seconds)
            yield from _put_down(sight, foot, seconds)
            yield Move(seconds=pause)
            foot = 1 - foot

    return habit


def _stork(sight: Sight) -> Iterator[Move]:
    """One foot is held high for seconds, then the other."""
    foot = int(sight.rng.integers(2))
    while True:
        yield _lead(foot, sight.sole(foot) + sight.ahead(0.05, 0.0, 0.25), 1.0)
        yield Move(seconds=float(sight.rng.uniform(3.0, 8.0)))
        yield from _put_down(sight, foot, 0.8)
        yield Move(seconds=0.5)
        foot = 1 - foot


def _circles(sight: Sight) -> Iterator[Move]:
    """A foot is led round in circles, once a second."""
    foot = int(sight.rng.integers(2))
    while True:
        middle = sight.sole(foot) + sight.ahead(0.0, _OUT[foot] * 0.05, 0.12)
        yield _lead(foot, middle + sight.ahead(0.12), 0.6)
        for k in range(int(4.0 / _FRAME_TIME)):
            angle = 2.0 * np.pi * k * _FRAME_TIME
            way = sight.ahead(0.12 * np.cos(angle), 0.12 * np.sin(angle))
            yield _lead(foot, middle + way, _FRAME_TIME)
        yield from _put_down(sight, foot, 0.5)
        yield Move(seconds=0.6)
        foot = 1 - foot


def _kick(sight: Sight) -> Iterator[Move]:
    """A foot is swung ahead and back as fast as an arm goes."""
    foot = int(sight.rng.integers(2))
    while True:
        middle = sight.sole(foot) + sight.ahead(0.0, 0.0, 0.12)
        yield _lead(foot, middle, 0.5)
        for _ in range(3):
            yield _lead(foot, middle + sight.ahead(0.35), 0.25)
            yield _lead(foot, middle - sight.ahead(0.25), 0.3)
        yield from _put_down(sight, foot, 0.3)
        yield Move(seconds=0.4)
        foot = 1 - foot


def _drum(sight: Sight) -> Iterator[Move]:
    """Feet are lifted a little in turn, before the weight can have shifted."""
    foot = 0
    while True:
        yield _lead(foot, sight.sole(foot) + sight.ahead(0.0, 0.0, 0.08), 0.12)
        yield from _put_down(sight, foot, 0.12, depth=0.05)
        foot = 1 - foot


def _hover(sight: Sight) -> Iterator[Move]:
    """Both devices are about as high as a foot begins to lift at, and never still."""
    while True:
        for foot in (0, 1):
            place = sight.sole(foot)
            place[2] += sight.rng.uniform(-0.01, 0.04)
            yield _lead(foot, place, float(sight.rng.uniform(0.05, 0.3)))


def _both(sight: Sight) -> Iterator[Move]:
    """Both devices are up, and are put down in any order."""
    while True:
        up = [sight.sole(foot) + sight.ahead(0.0, 0.0, 0.3) for foot in (0, 1)]
        yield Move(seconds=0.4, left=up[0], right=up[1])
        yield Move(seconds=float(sight.rng.uniform(0.2, 2.5)))
        first = int(sight.rng.integers(2))
        for foot in (first, 1 - first):
            yield from _put_down(sight, foot, 0.3)
            yield Move(seconds=float(sight.rng.uniform(0.1, 1.0)))


def _cycle(sight: Sight) -> Iterator[Move]:
    """Hands go round as feet on pedals do, however the robot keeps up."""
    start, time = [sight.sole(0), sight.sole(1)], 0.0
    while True:
        time += _FRAME_TIME
        left, right = (
            start[foot] + sight.ahead(0.15 * np.cos(angle), 0.0, 0.15 * np.sin(angle))
            for foot, angle in enumerate((np.pi * time, np.pi * (time + 1.0)))
        )
        yield Move(seconds=_FRAME_TIME, left=left, right=right)


def _teleport(sight: Sight) -> Iterator[Move]:
    """Tracking that finds the hands somewhere else again and again."""
    while True:
        foot = int(sight.rng.integers(2))
        way = sight.size * sight.rng.uniform((-0.4, -0.4, -0.1), (0.4, 0.4, 0.4))
        yield _lead(foot, sight.sole(foot) + way, 1e-3)
        yield Move(seconds=float(sight.rng.uniform(0.1, 0.6)))


def _stamp(sight: Sight) -> Iterator[Move]:
    """Feet are lifted high and slammed far below the ground."""
    foot = 0
    while True:
        yield _lead(foot, sight.sole(foot) + sight.ahead(0.1, 0.0, 0.25), 0.7)
        yield from _put_down(sight, foot, 0.05, depth=0.3)
        yield Move(seconds=0.5)
        foot = 1 - foot


def _split(sight: Sight) -> Iterator[Move]:
    """Feet are led as far apart as they go, any way, and together again."""
    while True:
        foot = int(sight.rng.integers(2))
        ahead, aside = sight.rng.choice([-0.6, 0.0, 0.6]), sight.rng.choice([0.3, 0.8])
        for way in (sight.ahead(float(ahead), _OUT[foot] * float(aside)), None):
            if way is None:
                way = sight.ahead(0.0, _OUT[foot] * 0.2)
            there = sight.sole(1 - foot) + way
            yield _lead(foot, sight.sole(foot) + sight.ahead(0.0, 0.0, 0.12), 0.6)
            there[2] = sight.sole(foot)[2]
            yield _lead(foot, there, 0.8)
            yield from _put_down(sight, foot, 0.5)
            yield Move(seconds=0.5)


def _cross(sight: Sight) -> Iterator[Move]:
    """A foot is to go across the one that stands, in front of it and behind it."""
    foot = 0
    while True:
        yield _lead(foot, sight.sole(foot) + sight.ahead(0.0, 0.0, 0.12), 0.5)
        ahead = float(sight.rng.choice([-0.25, 0.0, 0.25]))
        there = sight.sole(1 - foot) + sight.ahead(ahead, -_OUT[foot] * 0.2, 0.1)
        yield _lead(foot, there, 0.5)
        yield from _put_down(sight, foot, 0.4)
        yield Move(seconds=0.4)
        foot = 1 - foot


def _drunk(sight: Sight) -> Iterator[Move]:
    """Both hands sway and drift, up and down, too."""
    sway = np.zeros((2, 3))
    while True:
        kick = sight.rng.normal(size=(2, 3)) * np.array([0.25, 0.15, 0.25])
        sway += _FRAME_TIME * (-sway / 0.6) + np.sqrt(_FRAME_TIME) * sight.size * kick
        left, right = (sight.sole(foot) + sway[foot] for foot in (0, 1))
        yield Move(seconds=_FRAME_TIME, left=left, right=right)


def _sleep(sight: Sight) -> Iterator[Move]:
    """A step, in whose middle nothing is sent for a while, and hands that are elsewhere then."""
    foot = 0
    while True:
        yield _lead(foot, sight.sole(foot) + sight.ahead(0.0, 0.0, 0.15), 0.5)
        yield _lead(foot, sight.sole(foot) + sight.ahead(0.15), 0.3)
        yield Move(seconds=float(sight.rng.uniform(0.1, 3.0)), silent=True)
        way = sight.size * sight.rng.uniform(-0.5, 0.5, 3)
        yield _lead(foot, sight.sole(foot) + way, 0.02)
        yield from _put_down(sight, foot, 0.4)
        yield Move(seconds=0.4)
        foot = 1 - foot


def _ride(sight: Sight) -> Iterator[Move]:
    """Walks by the stick, lets it go, steps by hand, and takes the stick in mid-step."""
    while True:
        ahead, aside, turn = sight.rng.uniform((-0.3, -0.15, -0.4), (0.4, 0.15, 0.4)).tolist()
        yield Move(seconds=float(sight.rng.uniform(0.5, 3.0)), velocity=(ahead, aside, turn))
        yield Move(seconds=float(sight.rng.uniform(0.2, 2.0)))
        foot = int(sight.rng.integers(2))
        yield from _put_down(sight, foot, 0.1)
        yield _lead(foot, sight.sole(foot) + sight.ahead(0.0, 0.0, 0.15), 0.5)
        yield _lead(foot, sight.sole(foot) + sight.ahead(0.1), 0.5)


def _bow(sight: Sight) -> Iterator[Move]:
    """Steps with a body that is commanded up and down, to lean, and to turn."""
    foot = 0
    while True:
        height = sight.size * float(sight.rng.uniform(-0.15, 0.05))
        roll, pitch, yaw = sight.rng.uniform((-0.3, -0.3, -0.5), (0.3, 0.4, 0.5)).tolist()
        left, right = sight.rng.uniform(-0.4, 0.4, 2).tolist()
        body = BodyCommand(height=height, torso=(roll, pitch, yaw), turns=(left, right))
        up = sight.sole(foot) + sight.ahead(0.0, 0.0, 0.15)
        down = sight.sole(foot) + sight.ahead(0.08, 0.0, -0.03)
        for place in (up, down):
            yield replace(_lead(foot, place, 0.8), body=body)
        yield Move(seconds=0.4, body=body)
        foot = 1 - foot


HABITS: Mapping[str, Habit] = {
    "steps with care": _steps(0.15, 0.0, 0.1, 0.8, 0.6),
    "steps briskly": _steps(0.25, 0.0, 0.12, 0.25, 0.2),
    "steps back": _steps(-0.15, 0.0, 0.1, 0.5, 0.4),
    "steps aside": _steps(0.0, 0.12, 0.1, 0.5, 0.4),
    "stork": _stork,
    "circles": _circles,
    "kicks": _kick,
    "drums": _drum,
    "hovers": _hover,
    "both up": _both,
    "cycles": _cycle,
    "teleports": _teleport,
    "stamps": _stamp,
    "splits": _split,
    "crosses": _cross,
    "drunk": _drunk,
    "falls asleep": _sleep,
    "rides": _ride,
    "bows": _bow,
}
"""By name."""


class HabitualOperator:
    """Two devices that are led by a habit.

    Args:
        teleoperator: whose feet the operator looks at.
        habit: its name, see `HABITS`.
        seed: of everything random.
    """

    def __init__(self, teleoperator: StepTeleoperator, habit: str, seed: int) -> None:
        left, right = teleoperator.estimator.anchors
        height = float(teleoperator.estimator.dynamics.com[2]) - 0.5 * float(left[2] + right[2])
        sight = Sight(teleoperator=teleoperator, size=height, rng=np.random.default_rng(seed))
        self._moves = HABITS[habit](sight)
        self._from, self._hands = [left.copy(), right.copy()], [left.copy(), right.copy()]
        self._begin, self._move = 0.0, Move(seconds=_BEGIN)

    def sample(self, time: float) -> OperatorSample | None:
        """Where the hands are at a time, which goes on from call to call [s]."""
        while time >= self._begin + self._move.seconds:
            self._begin += self._move.seconds
            self._place(1.0)
            self._from = [hand.copy() for hand in self._hands]
            self._move = next(self._moves)
        move = self._move
        self._place((time - self._begin) / move.seconds)
        if move.silent:
            return None
        left, right = (TrackedPose.of(hand) for hand in self._hands)
        return OperatorSample(time, (left, right), velocity=move.velocity, body=move.body)

    def _place(self, way: float) -> None:
        """Puts the hands a part of their way on."""
        for foot, goal in enumerate((self._move.left, self._move.right)):
            if goal is not None:
                begin = self._from[foot]
                self._hands[foot] = begin + way * (goal - begin)
