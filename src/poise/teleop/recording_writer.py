"""`RecordingWriter`: keeps everything that comes from outside a run, a row an event."""

from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.teleop.device import DeviceSample
from poise.teleop.recording_format import (
    FORMAT,
    ROW,
    UNFINISHED,
    VERSION,
    RowKind,
    header_text,
)


class RecordingWriter:
    """Writes a recording while the run goes on; a context manager.

    Args:
        path: the file, replaced if it is there; by convention `*.teleop`.
        robot: the robot's name.
        dt: length of a tick [s].
        setup: whatever else the run needs to be run again, as JSON: see `run_teleop`.

    Raises:
        ConfigurationError: the set-up is too long or no JSON.

    Attributes:
        setup: what the header will hold; what is known at the end only can be put in before
            `close`.
    """

    def __init__(
        self, path: Path, *, robot: str, dt: float, setup: dict[str, Any] | None = None
    ) -> None:
        self.setup: dict[str, Any] = dict(setup or {})
        self._header: dict[str, Any] = {
            "format": FORMAT,
            "version": VERSION,
            "robot": robot,
            "dt": float(dt),
            "rows": UNFINISHED,
            "setup": self.setup,
        }
        text = header_text(self._header)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("wb")
        self._file.write(text)
        self._rows = 0

    def sample(self, tick: int, sample: DeviceSample) -> None:
        """Notes a sample that came before a tick, good or bad."""
        self._write(
            tick, RowKind.SAMPLE, sample.time, sample.left, sample.right, upright=sample.upright
        )

    def push(self, tick: int, force: Float64[np.ndarray, "3"], duration: float) -> None:
        """Notes a push on the torso that began before a tick.

        Args:
            tick: counted from zero.
            force: in the world [N].
            duration: [s].
        """
        self._write(tick, RowKind.PUSH, 0.0, force, np.array([duration, 0.0, 0.0]))

    def flush(self) -> None:
        """Hands every row to the operating system: a run that is killed later loses none."""
        self._file.flush()

    def close(self) -> None:
        """Writes how many rows there are; without it the file counts as truncated."""
        if self._file.closed:
            return
        self._header["rows"] = self._rows
        self._file.seek(0)
        self._file.write(header_text(self._header))
        self._file.close()

    def __enter__(self) -> "RecordingWriter":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _write(
        self,
        tick: int,
        kind: RowKind,
        time: float,
        left: np.ndarray,
        right: np.ndarray,
        *,
        upright: bool = False,
    ) -> None:
        row = np.zeros(1, dtype=ROW)
        row["tick"], row["kind"], row["upright"], row["time"] = tick, kind, upright, time
        # A device may send anything: what is no point is kept as one that is refused again.
        row["left"], row["right"] = _point(left), _point(right)
        self._file.write(row.tobytes())
        self._rows += 1


def _point(value: object) -> np.ndarray:
    if isinstance(value, np.ndarray) and value.shape == (3,) and value.dtype == np.float64:
        return value
    return np.full(3, np.nan)
