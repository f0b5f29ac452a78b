"""`bench_keys`: from a key in a browser to the velocity that the driven robot is asked for."""

import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.commands import Bench
from benchmarks.recording import Progress
from benchmarks.result import Figure, Result
from poise.apps.live import LiveSession
from poise.errors import ConfigurationError, MissingExtraError, PoiseError
from poise.robots import load_robot

BOUND_MS = 50.0
"""From key to changed command at most, on a machine with nothing else to do [ms]."""

_BROWSERS = ("chromium", "chromium-browser", "google-chrome")

_SOFTWARE = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader")
"""What a browser without a screen draws the robot with."""

_WARM_UP, _PATIENCE, _HELD, _LOOK = 2, 60.0, 0.25, 2e-4
"""Presses before those that count; how long anything is waited for, how long a key is held or left,
and how often the command is looked at [s]."""

_ANSWER, _STALLS = 2.0, 10
"""How long a key's answer is waited for [s]; presses that may be lost to stalls of the machine."""


@dataclass(frozen=True, kw_only=True)
class KeysBench(Bench):
    """Press a key in a browser without a screen, and time how soon the commanded velocity changes.

    example: python -m benchmarks keys --presses 20
    """

    robot: str = "g1"  # name or path of a humanoid
    presses: int = 40  # of a key that count; each is let go again, which counts, too

    def __post_init__(self) -> None:
        if self.presses < 1:
            raise ConfigurationError("nothing to time", got=self.presses, wanted="presses >= 1")

    def act(self) -> int:
        """Time and print."""
        return self.show(bench_keys, keys_figures, unit=" presses")


@dataclass(frozen=True, kw_only=True)
class KeysResult(Result):
    """Delays of keys."""

    robot: str  # name of the robot
    event: str  # "pressed" or "let go"
    p50_ms: float  # median [ms]
    p99_ms: float  # 99th percentile [ms]
    max_ms: float  # longest [ms]
    presses: int  # how many
    # Presses made again, since the machine stood still for so long that the operator counted as
    # gone and the key with them
    stalls: int
    # Robot time over clock time: below 1 the machine is too slow for the robot
    real_time_factor: float


def bench_keys(plan: KeysBench, progress: Progress | None = None) -> list[KeysResult]:
    """Drives a robot by a key in a real browser without a screen.

    Time runs from before the browser is told of the key until the walker is asked for another
    velocity, so the way to the browser counts, too.
    """
    robot = load_robot(plan.robot)
    spans = np.zeros((plan.presses, 2))
    with (
        tempfile.TemporaryDirectory() as folder,
        LiveSession(robot, folder, by="velocity") as session,
    ):
        loop = session.loop

        def velocity() -> tuple[float, ...]:
            return tuple(loop.lead.leader.walker.commands.velocity)

        with _Page(session.front.drive_url) as page:
            _wait(lambda: page.ask("newest !== null && newest.device === 'OK'"), 0.1)
            began, first = time.monotonic(), loop.plant.time
            k, stalls = -_WARM_UP, 0
            while k < plan.presses:
                # Keys come at any time of a tick and of a beat.
                held = _HELD * (1.0 + 0.1 * ((7 * k) % 10))
                span = _press(page, velocity, held)
                if span is None:
                    stalls += 1
                    if stalls > _STALLS:
                        raise PoiseError("the page or the robot does not answer")
                    continue
                if k >= 0:
                    spans[k] = span
                k += 1
                if progress is not None:
                    progress(float(k + _WARM_UP), float(plan.presses + _WARM_UP))
            factor = (loop.plant.time - first) / (time.monotonic() - began)
    return [
        KeysResult(
            robot=robot.name,
            event=event,
            p50_ms=float(np.median(span)),
            p99_ms=float(np.percentile(span, 99.0)),
            max_ms=float(span.max()),
            presses=plan.presses,
            stalls=stalls,
            real_time_factor=factor,
        )
        for event, span in zip(("pressed", "let go"), 1e3 * spans.T, strict=True)
    ]


def keys_figures(results: Sequence[KeysResult]) -> list[Figure]:
    """What must hold of them."""
    return [
        Figure.at_most(f"key {r.event} to changed command, {r.robot}: {what} [ms]", ours, BOUND_MS)
        for r in results
        for what, ours in (("median", r.p50_ms), ("99th percentile", r.p99_ms))
    ]


class _Page:
    """The page of `poise drive` in a browser without a screen."""

    def __init__(self, url: str) -> None:
        self._url = url

    def __enter__(self) -> "_Page":
        browser = next((path for name in _BROWSERS if (path := shutil.which(name))), None)
        if browser is None:
            raise PoiseError(f"keys are pressed in a browser; install one of {_BROWSERS}")
        try:
            from playwright.sync_api import sync_playwright
        except ImportError as e:
            raise MissingExtraError("playwright", "dev", "timing keys") from e
        self._play: Any = sync_playwright().start()
        self._browser = self._play.chromium.launch(executable_path=browser, args=[*_SOFTWARE])
        self._page = self._browser.new_page()
        self._page.goto(self._url)
        return self

    def __exit__(self, *_: object) -> None:
        self._browser.close()
        self._play.stop()

    def ask(self, script: str) -> Any:
        """What a script of the page says."""
        return self._page.evaluate(script)

    def press(self) -> None:
        """The key for walking ahead."""
        self._page.keyboard.down("w")

    def let_go(self) -> None:
        """Of it."""
        self._page.keyboard.up("w")


def _press(
    page: _Page, velocity: Callable[[], tuple[float, ...]], held: float
) -> tuple[float, float] | None:
    """Times until a key that is pressed, and let go, changes the command [s].

    None where the machine stalled meanwhile: who is silent counts as gone, and the robot comes to
    rest whatever is pressed.
    """
    rest = velocity()
    start = time.monotonic()
    page.press()
    pressed = _changed(velocity, rest, start)
    time.sleep(held)
    led = velocity()
    start = time.monotonic()
    page.let_go()
    let_go = _changed(velocity, led, start) if led != rest else None
    time.sleep(held)
    return None if pressed is None or let_go is None else (pressed, let_go)


def _changed(
    velocity: Callable[[], tuple[float, ...]], now: tuple[float, ...], start: float
) -> float | None:
    while velocity() == now:
        if time.monotonic() - start > _ANSWER:
            return None
        time.sleep(_LOOK)
    return time.monotonic() - start


def _wait(there: Callable[[], bool], every: float) -> None:
    end = time.monotonic() + _PATIENCE
    while not there():
        if time.monotonic() > end:
            raise PoiseError("the page or the robot does not answer")
        time.sleep(every)
