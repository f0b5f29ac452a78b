"""`Takes`: every live run on the disk, from reset to reset, within the quota of its folder."""

import math
import re
import shutil
import time as clock
from pathlib import Path

from poise.apps.live._leads import Lead
from poise.errors import ConfigurationError, PoiseError
from poise.sim import AnyController, LeadFunction, Plant, Recorder, Tick, finish_log
from poise.stack import Leader

_LOOK_EVERY = 10.0  # time from one look into the folder to the next: of some 200 kB [s]


class Takes:
    """Record live runs, from reset to reset, as far as the disk and the folder's quota allow."""

    def __init__(self, folder: Path, kind: str = "take", *, most_bytes: int = 1 << 30) -> None:
        self.folder, self._kind, self._most = folder, kind, most_bytes
        self.path, self._looked_at = folder, -math.inf
        self.problem = ""  # why nothing more of the run is recorded; empty for none
        self._lead: Lead | None = None  # of a run whose recording has yet to begin
        self._recorder: Recorder | None = None

    @property
    def files(self) -> list[str]:
        """Names of the recordings that are there."""
        return sorted(path.name for path in self.folder.glob("*.mcap"))

    @property
    def name(self) -> str:
        """Name of the run's file, or why it has none."""
        return self.problem or self.path.name

    def open(self) -> None:
        """Make the folder if it is not there."""
        self.folder.mkdir(parents=True, exist_ok=True)

    def expect(self, lead: Lead) -> None:
        """Finish the run before, and record the next one with the recorder of its lead."""
        self.end()
        self.path, self._lead = self._next(self._kind), lead
        self.problem = ""  # It may have been of one file.
        self._look()

    def begin(
        self, plant: Plant, controller: AnyController, leader: Leader | LeadFunction | None
    ) -> None:
        self._cast = plant, controller, leader

    def observe(self, tick: Tick) -> None:
        """Record a tick, from the first one on that is not idle."""
        if self._lead is not None and not self.problem and not self._lead.idle:
            recorder, self._lead = self._lead.recorder(self.path), None
            try:
                recorder.begin(*self._cast)
                self._recorder = recorder
            except PoiseError as error:
                self._give_up(error)
        if self._recorder is not None:
            self._recorder.observe(tick)

    def flush(self) -> None:
        """Pass the recorded rows to the writer; end a recording that failed."""
        recorder = self._recorder
        if recorder is not None:
            recorder.flush()
            if recorder.failure is not None:
                self._give_up(recorder.failure)
        if clock.monotonic() - self._looked_at >= _LOOK_EVERY:
            self._look()
        if self.problem:
            self.end()

    def end(self) -> None:
        """Finish the file, if there is one, and stop recording the run."""
        self._lead = None
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            try:
                recorder.end()
            except PoiseError as error:
                self._give_up(error)

    def keep(self) -> Path:
        """Write a complete copy of the recording on disk, which may lack the last flush."""
        if self._recorder is None or self.problem:
            raise ConfigurationError(f"no copy is kept: {self.name}")
        path = self._next("kept")
        try:
            if self._used() + self.path.stat().st_size > self._most:
                raise PoiseError("the folder has no room for it")
            shutil.copyfile(self.path, path)
            finish_log(path)
        except (OSError, PoiseError) as error:
            raise ConfigurationError(f"no copy is kept: {error}") from error
        return path

    def _used(self) -> int:
        """Bytes in the folder."""
        return sum(map(_size, self.folder.iterdir()))

    def _look(self) -> None:
        """Record nothing more where the folder is full or gone."""
        self._looked_at = clock.monotonic()
        try:
            if self._used() >= self._most:
                self._give_up(f"{self.folder} is full ({self._most / 2**20:.0f} MiB)")
        except OSError as error:
            self._give_up(error)

    def _give_up(self, why: object) -> None:
        """Record nothing more until the next run."""
        self.problem = f"not recorded: {why}"

    def _next(self, kind: str) -> Path:
        """The file after the last one of a kind, of whatever version that is."""
        names = (path.name for path in self.folder.glob(f"{kind}-*"))
        found = (re.fullmatch(rf"{kind}-(\d+)\.\w+", name) for name in names)
        number = 1 + max((int(match[1]) for match in found if match), default=0)
        return self.folder / f"{kind}-{number:03}.mcap"


def _size(path: Path) -> int:
    """Bytes of a file; zero for a deleted file or a broken link."""
    try:
        return path.stat().st_size
    except OSError:
        return 0
