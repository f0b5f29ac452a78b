"""`Takes`: every live run on the disk, from reset to reset, within the quota of its folder."""

import math
import re
import shutil
import time as clock
from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from poise.apps.teleoperation import RecordedPush, TeleopRecorder
from poise.errors import ConfigurationError, PoiseError
from poise.locomotion import StepTeleoperator
from poise.sim import AnyController, LeadFunction, Plant, Recorder, RecorderConfig, Tick, finish_log
from poise.stack import Leader

# The writer's thread takes the interpreter from the robot: at 50 Hz a tick cost a fifth more
LIVE_CONFIG = RecorderConfig(record_dt=0.05, scene_dt=0.1, keep=False)
MOST_BYTES = 1 << 30  # of the files of live runs in a folder: some ten hours
# Time from one look into the folder to the next [s]; a run writes some 20 kB in a second
_LOOK_EVERY = 10.0


class Takes:
    """The observer that records live runs into numbered files of a folder, from reset to reset.

    A run beyond the quota of the folder, or whose file cannot be written, goes on unrecorded.
    """

    def __init__(self, folder: Path, kind: str = "take", *, most_bytes: int = MOST_BYTES) -> None:
        self.folder, self._kind, self._most = folder, kind, most_bytes
        self._used, self._looked_at, self._problem = 0, -math.inf, ""
        self.path = folder
        self._make: Callable[[Path], Recorder] | None = None
        self._recorder: Recorder | None = None
        self._pushes: list[RecordedPush] = []

    @property
    def is_full(self) -> bool:
        """True when nothing more is recorded; the folder is measured now and then."""
        if clock.monotonic() - self._looked_at >= _LOOK_EVERY:
            self._has_room()
        return bool(self._problem) or self._used >= self._most

    def _has_room(self, more: int = 0) -> bool:
        """Measure the folder; return whether so many bytes more fit."""
        self._looked_at = clock.monotonic()
        try:
            self._used = sum(map(_size, self.folder.iterdir()))
        except OSError as error:
            self._give_up(error)
        return not self._problem and self._used + more <= self._most

    def _give_up(self, error: Exception) -> None:
        """Record nothing more until the next run."""
        self._problem = f"not recorded: {error}"

    @property
    def files(self) -> list[str]:
        """Names of the recordings that are there."""
        return sorted(path.name for path in self.folder.glob("*.mcap"))

    @property
    def name(self) -> str:
        """Name of the run's file, or why it has none."""
        size = f"{self._most / 2**20:.0f} MiB"
        full = self._problem or f"not recorded: {self.folder} is full ({size})"
        return full if self.is_full else self.path.name

    def open(self) -> None:
        """Make the folder if it is not there."""
        self.folder.mkdir(parents=True, exist_ok=True)

    def expect(self, make: Callable[[Path], Recorder]) -> None:
        """Set the recorder of the next run, and finish the one before."""
        self.end()
        self.path = self._next(self._kind)
        self._problem = ""  # It may have been of one file.
        self._has_room()
        self._pushes.clear()
        self._make = None if self.is_full else make

    def begin(
        self, plant: Plant, controller: AnyController, leader: Leader | LeadFunction | None
    ) -> None:
        self._cast = plant, controller, leader

    def observe(self, tick: Tick) -> None:
        """Record a tick; of a step teleoperator from its first sample or push on."""
        if self._make is not None and (self._pushes or not self._idle()):
            recorder, self._make = self._make(self.path), None
            try:
                recorder.begin(*self._cast)
                self._recorder = recorder
            except PoiseError as error:
                self._give_up(error)
        recorder = self._recorder
        if isinstance(recorder, TeleopRecorder):
            for push in self._pushes:
                recorder.push(push)
        self._pushes.clear()
        if recorder is not None:
            recorder.observe(tick)

    def _idle(self) -> bool:
        """A step teleoperator without a sample."""
        leader = self._cast[2]
        status = leader.status if isinstance(leader, StepTeleoperator) else None
        return isinstance(leader, StepTeleoperator) and (status is None or status.sample is None)

    def push(self, tick: int, force: Float64[np.ndarray, "3"], duration: float) -> None:
        """Note a push on the torso [N], [s] that begins before a tick."""
        x, y, z = force.tolist()
        self._pushes.append(RecordedPush(tick, (x, y, z), duration))

    def flush(self) -> None:
        """Hand what was recorded so far to the writer; end a recording that cannot go on."""
        recorder = self._recorder
        if recorder is not None:
            recorder.flush()
            if recorder.failure is not None:
                self._give_up(recorder.failure)
        if self.is_full:
            self.end()

    def end(self) -> None:
        """Finish the file, if there is one; the run is not recorded any more."""
        self._make = None
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            try:
                recorder.end()
            except PoiseError as error:
                self._give_up(error)

    def keep(self) -> Path:
        """Write a finished copy of what is on the disk of the take; it may be a flush behind."""
        if self._recorder is None or self.is_full:
            raise ConfigurationError(f"no copy is kept: {self.name}")
        path = self._next("kept")
        try:
            if not self._has_room(self.path.stat().st_size):
                raise PoiseError("the folder has no room for it")
            shutil.copyfile(self.path, path)
            finish_log(path)
        except (OSError, PoiseError) as error:
            raise ConfigurationError(f"no copy is kept: {error}") from error
        return path

    def _next(self, kind: str) -> Path:
        """The file after the last one of a kind, of whatever version that is."""
        names = (path.name for path in self.folder.glob(f"{kind}-*"))
        found = (re.fullmatch(rf"{kind}-(\d+)\.\w+", name) for name in names)
        number = 1 + max((int(match[1]) for match in found if match), default=0)
        return self.folder / f"{kind}-{number:03}.mcap"


def _size(path: Path) -> int:
    """Bytes of a file; none of one that is gone by now, or of a link to nothing."""
    try:
        return path.stat().st_size
    except OSError:
        return 0
