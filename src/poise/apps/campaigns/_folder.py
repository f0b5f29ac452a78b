"""`CampaignFolder`: the rows of a campaign on disk. `RowLog`: the file that they are added to.

`campaign.json` identifies the campaign, `rows.jsonl` has a line an episode from the moment that
it ends, and `episodes/` is the same as Parquet, written when a run ends.
"""

import errno
import fcntl
import json
import os
from collections.abc import Generator, Mapping
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from poise.apps.campaigns._episode import Row
from poise.apps.pages import replace_file
from poise.errors import ConfigurationError, MissingExtraError, PoiseError, import_extra

_MANIFEST, _ROWS, _TABLE, _LOCK = "campaign.json", "rows.jsonl", "episodes/rows.parquet", "lock"

_PARTS = {"campaign": "campaign", "scenario": "scenario", "robots": "robot"}
"""Parts of the content that a folder is claimed for, and their names in messages."""

_ENDLESS = ("episodes", "trials")
"""Keys of a campaign that set its length: a folder can be continued with larger ones."""


class RowLog:
    """A file that rows are added to and never changed in, one JSON object a line.

    A line that a run left unfinished as it died is passed over, and cut off by the next row.

    Args:
        path: of the file; its folder is made with the first row.

    Raises:
        PoiseError: a line is no row.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._end = path, 0
        self.rows: list[dict[str, Any]] = []
        content = path.read_bytes() if path.exists() else b""
        self._end = content.rfind(b"\n") + 1
        try:
            self.rows += [json.loads(line) for line in content[: self._end].splitlines()]
        except ValueError as error:
            raise PoiseError(f"cannot read results ({error})", got=str(path)) from None

    def add(self, row: dict[str, Any]) -> None:
        """Record a row of what JSON can hold; when this returns it is on the disk."""
        line = json.dumps(row).encode() + b"\n"
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("ab", buffering=0) as file:
            file.truncate(self._end)
            try:
                if file.write(line) < len(line):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self._path))
                os.fsync(file.fileno())
            except BaseException:
                file.truncate(self._end)
                raise
        self._end += len(line)
        self.rows.append(row)


def read_rows(directory: str | Path) -> list[dict[str, object]]:
    """Read the results in the folder of a campaign or a scorecard, while it runs or later.

    Args:
        directory: the folder.

    Returns:
        A row an episode, by number. All have the same columns; None where an episode has no value.

    Raises:
        PoiseError: the folder has no results that can be read.
    """
    folder = CampaignFolder(Path(directory))
    folder.content()
    return folder.table()


class CampaignFolder:
    """A campaign's results on disk, and in memory as `rows`, by number."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if not (path / _ROWS).exists() and next(path.glob("episodes/*.parquet"), None):
            raise ConfigurationError(
                "the results in this folder are of an earlier form",
                got=str(path),
                wanted="another --out, or a tool that reads its Parquet files",
            )
        self._read()

    def content(self) -> dict[str, Any]:
        """The content that the folder was claimed for."""
        try:
            return json.loads((self.path / _MANIFEST).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            raise ConfigurationError(
                "no campaign in this folder", got=str(self.path), wanted=f"one with {_MANIFEST}"
            ) from None

    def row(self, number: int) -> Row:
        """The row of an episode."""
        if number not in self.rows:
            raise ConfigurationError(
                "this episode has no result",
                got=number,
                wanted=f"one of the {len(self.rows)} numbers in {str(self.path)!r}",
            )
        return self.rows[number]

    def first(self, total: int) -> list[Row]:
        """The rows that a campaign of so many episodes has: it may have been longer before."""
        return [row for number, row in self.rows.items() if number < total]

    def table(self) -> list[Row]:
        """All rows with all columns, by number."""
        columns = dict.fromkeys(name for row in self.rows.values() for name in row)
        return [{name: row.get(name) for name in columns} for _, row in sorted(self.rows.items())]

    def add(self, row: Row) -> None:
        """Record a row; when this returns it is on the disk."""
        self._log.add(row)
        self.rows[row["number"]] = row

    @contextmanager
    def claimed(self, content: Mapping[str, Any]) -> Generator[None]:
        """The folder for one campaign and one run of it alone, which may add rows meanwhile."""
        self.path.mkdir(parents=True, exist_ok=True)
        with (self.path / _LOCK).open("a+", encoding="utf-8") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                lock.seek(0)
                raise ConfigurationError(
                    "another run writes into this folder",
                    got=str(self.path),
                    wanted=f"another --out, or the end of process {lock.read().strip()}",
                ) from None
            lock.truncate(0)
            lock.write(f"{os.getpid()} on {os.uname().nodename}")
            lock.flush()
            # Another run may have written between reading and locking.
            self._read()
            self._identify(content)
            try:
                yield
            finally:
                # Where the disk is full the rows are in the log.
                with suppress(OSError):
                    self._write_table()

    def pace(self, total: int) -> dict[str, Any]:
        """Activity of a run in this folder, its rows a second, and the time that is left [s]."""
        try:
            with (self.path / _LOCK).open("rb") as lock:
                fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
            return {"running": False}
        except FileNotFoundError:  # A copy of a folder may lack the file that is locked.
            return {"running": False}
        except BlockingIOError:
            pass
        begun = (self.path / _LOCK).stat().st_mtime
        ended = (datetime.fromisoformat(row["ended"]).timestamp() for row in self.rows.values())
        new = sorted(time for time in ended if time > begun)
        rate = len(new) / (new[-1] - begun) if new else 0.0
        left = (total - len(self.first(total))) / rate if rate else None
        return {"running": True, "rate_hz": rate, "left_s": left}

    def _read(self) -> None:
        self._log = RowLog(self.path / _ROWS)
        self.rows: dict[int, Row] = {row["number"]: row for row in self._log.rows}

    def _identify(self, content: Mapping[str, Any]) -> None:
        """Refuse the folder of another campaign."""
        path = self.path / _MANIFEST
        here = self.content() if path.exists() or self.rows else content
        for part, name in _PARTS.items():
            ours, theirs = _endless(content.get(part, {})), _endless(here.get(part, {}))
            for key in sorted({*ours, *theirs}):
                if ours.get(key) != theirs.get(key):
                    raise ConfigurationError(
                        f"the folder {str(self.path)!r} is of another {name}: {key!r} differs",
                        got=ours.get(key),
                        wanted=f"{theirs.get(key)!r} as in the folder, or another --out",
                    )
        replace_file(path, json.dumps(content, indent=1) + "\n")

    def _write_table(self) -> None:
        """Write all rows as Parquet; scorecards are made without the package as well."""
        try:
            pa, pq = require_pyarrow()
        except MissingExtraError:
            return
        rows = self.table()
        if rows:
            columns = {name: _alike([row[name] for row in rows]) for name in rows[0]}
            table = pa.BufferOutputStream()
            pq.write_table(pa.table(columns), table)
            replace_file(self.path / _TABLE, table.getvalue().to_pybytes())


def require_pyarrow() -> tuple[Any, ...]:
    """Import `pyarrow` and `pyarrow.parquet`."""
    names, purpose = ("pyarrow", "pyarrow.parquet"), "a campaign's results"
    return tuple(import_extra(name, "campaign", purpose) for name in names)


def _alike(values: list[Any]) -> list[Any]:
    """A column of one kind: texts where there are several."""
    kinds = {float if type(v) is int else type(v) for v in values if v is not None}
    return values if len(kinds) < 2 else [None if v is None else str(v) for v in values]


def _endless(content: Mapping[str, Any]) -> dict[str, Any]:
    """Content without the keys that set the length of a campaign."""
    kept = {key: value for key, value in content.items() if key not in _ENDLESS}
    return kept | ({"tune": _endless(kept["tune"])} if isinstance(kept.get("tune"), dict) else {})
