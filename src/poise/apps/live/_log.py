"""`Takes`: every live run on the disk, from reset to reset, while it goes on.

`LiveLog`: the signals of a live run, in a log that Foxglove opens.
`Room`: how much there may be of both.
"""

import math
import re
import threading
import time as clock
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.errors import ConfigurationError, PoiseError
from poise.locomotion import (
    OperatorSample,
    RecordingError,
    RecordingWriter,
    StepTeleoperator,
    read_recording,
)
from poise.sim import AnyController, LeadFunction, Plant, Recorder, RecorderConfig, Tick
from poise.stack import Leader

LOG_SUFFIX = ".mcap"

_CONFIG = RecorderConfig(record_dt=0.05, log_dt=0.0, scene_dt=0.1, on_full="hold", keep=False)
"""The writer's thread takes the interpreter from the robot: at 50 Hz a tick cost a fifth more."""


MOST_BYTES = 1 << 30
"""What the files of live runs in a folder may come to: some ten hours."""

_LOOK_EVERY = 10.0
"""Time from one look into the folder to the next [s]; a run writes some 20 kB in a second."""


class Room:
    """Whether a folder can take more of a run; one that finds no room there goes on unrecorded.

    Args:
        folder: where live runs are kept.
        most: what its files may come to [bytes].
    """

    def __init__(self, folder: Path, most: int = MOST_BYTES) -> None:
        self.folder, self._most = folder, most
        self._looked_at, self._free, self._problem = -math.inf, True, ""
        self._used = 0

    def open(self) -> None:
        """Makes the folder if it is not there.

        Raises:
            OSError: it cannot be made.
        """
        self.folder.mkdir(parents=True, exist_ok=True)

    @property
    def is_full(self) -> bool:
        """Whether nothing more is recorded; looked up now and then."""
        if clock.monotonic() - self._looked_at >= _LOOK_EVERY:
            self.look()
        return not self._free

    def look(self) -> None:
        """Looks at once."""
        self._looked_at = clock.monotonic()
        try:
            paths = [*self.folder.iterdir()]
        except OSError as error:
            self.close(error)
            return
        self._used = 0
        for path in paths:
            # One that is gone by now, or a link to nothing, takes no room.
            with suppress(OSError):
                self._used += path.stat().st_size
        if not self._problem:
            self._free = self._used < self._most

    def holds(self, more: int) -> bool:
        """Whether there is room for so many bytes more; looks at once."""
        self.look()
        return self._free and self._used + more <= self._most

    def reopen(self) -> None:
        """Another try: what could not be written before may have been one file's trouble."""
        self._problem = ""
        self.look()

    def close(self, error: Exception) -> None:
        """Nothing more is recorded: the folder cannot be written.

        Args:
            error: why.
        """
        self._free, self._problem = False, f"not recorded: {error}"

    @property
    def notice(self) -> str:
        """What to tell whoever drives when nothing is recorded."""
        full = f"not recorded: {self.folder} is full ({self._most / 2**20:.0f} MiB)"
        return self._problem or full


class LiveLog:
    """The observer that records live runs: a `Recorder` that is never in the robot's way.

    Nothing is recorded before `expect` says where to.

    It samples twenty times a second and keeps nothing in memory, for a run may last hours. The
    file of a robot whose feet are led is made when somebody leads them. A log that cannot be
    written ends nothing but itself.

    Args:
        controller: what the log says of it.

    Attributes:
        problem: why there is no log, or not all of it; "" where there is.
    """

    def __init__(self, controller: str = "step teleoperation") -> None:
        self.problem = ""
        self._controller, self._tried = controller, True
        self._recorder: Recorder | None = None

    def expect(self, path: Path) -> None:
        """Says which file the next run goes to, overwritten."""
        self._path = path
        self._tried = False

    def begin(
        self, plant: Plant, controller: AnyController, leader: Leader | LeadFunction | None
    ) -> None:
        """The next run begins."""
        self._cast = plant, controller, leader

    def observe(self, tick: Tick) -> None:
        """Records a tick; of feet that are led, from the first one on at which somebody does."""
        if not self._tried and self._is_driven():
            # A file that cannot be made is not tried again at each tick.
            self._tried = True
            self._recorder = self._open()
        if self._recorder is not None:
            self._recorder.observe(tick)

    def end(self) -> None:
        """Finishes the file, if there is one; a run that goes on is not recorded any more."""
        self._tried = True
        recorder, self._recorder = self._recorder, None
        if recorder is None:
            return
        try:
            recorder.end()
        except PoiseError as error:
            self.problem = str(error)

    def _is_driven(self) -> bool:
        leader = self._cast[2]
        if not isinstance(leader, StepTeleoperator):
            return True
        status = leader.status
        return status is not None and status.sample is not None

    def _open(self) -> Recorder | None:
        recorder = Recorder(self._path, config=_CONFIG, metadata={"controller": self._controller})
        try:
            recorder.begin(*self._cast)
        except PoiseError as error:
            self.problem = str(error)
            return None
        return recorder


SUFFIX = ".teleop"


class Takes:
    """Records into numbered files of a folder; what is there already stays.

    It is never in the robot's way: where a file cannot be written the run goes on unrecorded.

    Args:
        folder: where they lie.
        robot: the robot's name.
        dt: length of a tick [s].
        most_bytes: what the files of the folder may come to; the rest of a run is not recorded.

    Attributes:
        room: that there is in the folder.
    """

    def __init__(
        self, folder: Path, *, robot: str, dt: float, most_bytes: int = MOST_BYTES
    ) -> None:
        self.folder, self._robot, self._dt = folder, robot, dt
        self.room = Room(folder, most_bytes)
        self._writer: RecordingWriter | None = None
        # Held while files change hands; noting a sample does not wait for it.
        self._lock = threading.RLock()
        self._setup: dict[str, Any] = {}
        self._ticks = 0
        self.path = folder

    @property
    def files(self) -> list[str]:
        """Names of the recordings that are there."""
        return sorted(p.name for p in self.folder.glob(f"*{SUFFIX}"))

    def begin(self, setup: dict[str, Any]) -> None:
        """Begins the next take and finishes the one before.

        Args:
            setup: what a replay needs, see `teleop_setup`.
        """
        with self._lock:
            self.finish()
            self.path = self.folder / f"take-{self._next('take'):03}{SUFFIX}"
            self._setup, self._ticks = setup, 0
            self.room.reopen()
            if not self.room.is_full:
                with self._writing():
                    self._writer = self._open(self.path, setup)

    def sample(self, tick: int, sample: OperatorSample | None) -> None:
        """Notes a tick, and what came before it."""
        if self._writer is not None:
            with self._writing():
                self._writer.sample(tick, sample)
        # Last: whoever copies meanwhile copies no tick that is only half there.
        self._ticks = tick + 1

    def push(self, tick: int, force: Float64[np.ndarray, "3"], duration: float) -> None:
        """Notes a push on the torso [N], [s]."""
        if self._writer is not None:
            with self._writing():
                self._writer.push(tick, force, duration)

    def flush(self) -> None:
        """Whatever happens to this process, what was noted so far is on the disk."""
        if self._writer is None:
            return
        with self._writing():
            self._writer.flush()
        if self.room.is_full:
            self.finish()

    def finish(self) -> None:
        """Closes the take; one in which nothing happened leaves no file."""
        with self._lock:
            if self._writer is None:
                return
            writer, self._writer = self._writer, None
            # The header was written before anybody knew how long the take would be.
            writer.setup["duration"] = self._ticks * self._dt
            with self._writing():
                writer.close()
                if writer.rows == 0:
                    self.path.unlink(missing_ok=True)

    @contextmanager
    def _writing(self) -> Generator[None]:
        """While a file is written; one that cannot be is given up."""
        try:
            yield
        except (OSError, RecordingError) as error:
            self.room.close(error)
            writer, self._writer = self._writer, None
            if writer is not None:
                with suppress(OSError):
                    writer.close()

    def keep(self) -> Path:
        """Writes a finished copy of the take so far; another thread may go on recording.

        Returns:
            The copy.

        Raises:
            ConfigurationError: the folder is full, or cannot be written.
        """
        with self._lock:
            if self._writer is None or self.room.is_full:
                raise ConfigurationError(f"no copy is kept: {self.name}")
            ticks = self._ticks
            try:
                self._writer.flush()
                if not self.room.holds(self.path.stat().st_size):
                    raise ConfigurationError("no copy is kept: the folder has no room for it")
                return self._copy(self.folder / f"kept-{self._next('kept'):03}{SUFFIX}", ticks)
            except OSError as error:
                raise ConfigurationError(f"no copy is kept: {error}") from error

    def _copy(self, path: Path, ticks: int) -> Path:
        """The take up to a tick, with the duration that it has by then."""
        recording = read_recording(self.path, allow_partial=True)
        setup = self._setup | {"duration": ticks * self._dt}
        with self._open(path, setup) as writer:
            writer.copy(recording.rows[recording.rows["tick"] < ticks])
        return path

    def _open(self, path: Path, setup: dict[str, Any]) -> RecordingWriter:
        return RecordingWriter(path, robot=self._robot, dt=self._dt, setup=setup)

    @property
    def name(self) -> str:
        """Of the take that is recorded, or why none is."""
        return self.room.notice if self.room.is_full else self.path.name

    def _next(self, kind: str) -> int:
        # A log whose recording somebody has moved is kept, too.
        names = (path.name for path in self.folder.glob(f"{kind}-*"))
        found = (re.fullmatch(rf"{kind}-(\d+)\.\w+", name) for name in names)
        return 1 + max((int(match[1]) for match in found if match), default=0)
