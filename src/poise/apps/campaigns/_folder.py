"""`CampaignFolder`: what a campaign leaves behind, so that nothing recorded is ever lost.

`campaign.json` says which campaign it is. `episodes/` is a Parquet dataset with a row an episode. A
row that has just come is a file of its own, written whole or not at all; from time to time, and at
the end, all become one file.
"""

import fcntl
import json
import os
from collections import defaultdict
from collections.abc import Generator, Mapping
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from poise.apps.campaigns._episode import Row
from poise.errors import ConfigurationError, MissingExtraError, PoiseError

MANIFEST, EPISODES, _LOCK = "campaign.json", "episodes", "lock"
"""File and folder names in a campaign's folder."""

_PARTS = {"campaign": "campaign", "scenario": "scenario", "robots": "robot"}
"""Parts of what a folder is claimed for, and what messages call one that differs."""

_MOST_PARTS = 256
"""Rows in files of their own at most: reading so many takes half a second."""

_ENDLESS = ("episodes", "trials")
"""Keys of a campaign that say how far it goes: a folder may be gone on with for longer."""


class CampaignFolder:
    """A campaign's results on disk, and in memory as `rows`, by number."""

    def __init__(self, path: Path) -> None:
        _require_pyarrow()
        self.path, self._dataset = path, path / EPISODES
        self.rows: dict[int, Row] = {row["number"]: row for row in self._read()}
        self._parts = len(self._files())

    def content(self) -> dict[str, Any]:
        """Hold the result of `claim`."""
        try:
            return json.loads((self.path / MANIFEST).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            raise ConfigurationError(
                "no campaign in this folder", got=str(self.path), wanted=f"one with {MANIFEST}"
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

    @contextmanager
    def claimed(self, content: Mapping[str, Any]) -> Generator[None]:
        """The folder for one campaign and one run of it alone, which may write rows meanwhile."""
        self._dataset.mkdir(parents=True, exist_ok=True)
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
            # What another run has written between reading and locking.
            self.rows = {row["number"]: row for row in self._read()}
            self._identify(content)
            try:
                yield
            finally:
                # Where the disk is full the rows stay in files of their own.
                with suppress(OSError):
                    self._compact()

    def pace(self, total: int) -> dict[str, Any]:
        """Return activity, rows per second and remaining time [s]."""
        if not self._is_written():
            return {"running": False}
        begun = (self.path / _LOCK).stat().st_mtime
        ended = (datetime.fromisoformat(row["ended"]).timestamp() for row in self.rows.values())
        new = sorted(time for time in ended if time > begun)
        rate = len(new) / (new[-1] - begun) if new else 0.0
        left = (total - len(self.first(total))) / rate if rate else None
        return {"running": True, "rate_hz": rate, "left_s": left}

    def add(self, row: Row) -> None:
        """Records a row; when this returns it is on the disk."""
        import pyarrow as pa

        number = row["number"]
        _write_whole(pa.Table.from_pylist([row]), self._dataset / f"part-{number:08d}.parquet")
        self.rows[number] = row
        self._parts += 1
        if self._parts >= _MOST_PARTS:
            self._compact()

    def _is_written(self) -> bool:
        """Whether a run writes here now; a copy of a folder may lack the file that is locked."""
        with suppress(FileNotFoundError), (self.path / _LOCK).open("rb") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                return True
        return False

    def _identify(self, content: Mapping[str, Any]) -> None:
        path = self.path / MANIFEST
        if not path.exists():
            if self.rows:
                self.content()
            _write_text(json.dumps(content, indent=1) + "\n", path)
            return
        here = self.content()
        for part, name in _PARTS.items():
            # Folders of earlier versions do not say what their robots' files were.
            asked = content.get(part, {})
            ours, theirs = _endless(asked), _endless(here.get(part, asked))
            for key in sorted({*ours, *theirs}):
                if ours.get(key) != theirs.get(key):
                    raise ConfigurationError(
                        f"the folder {str(self.path)!r} is of another {name}: {key!r} differs",
                        got=ours.get(key),
                        wanted=f"{theirs.get(key)!r} as in the folder, or another --out",
                    )
        _write_text(json.dumps(content, indent=1) + "\n", path)

    def _files(self) -> list[Path]:
        return sorted(self._dataset.glob("*.parquet"))

    def _read(self) -> list[Row]:
        return [] if not self._files() else self._table().to_pylist()

    def _table(self) -> Any:
        """All rows, each number once, by number."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        tables: list[Any] = []
        for path in self._files():
            try:
                tables.append(pq.read_table(path))
            except FileNotFoundError:
                # The run that writes here has made one file of several meanwhile.
                return self._table()
            except (pa.ArrowException, OSError) as error:
                reason = " ".join(str(error).split())
                raise PoiseError(f"cannot read results ({reason})", got=str(path)) from None
        table = pa.concat_tables(_alike(tables), promote_options="permissive")
        first: dict[int, int] = {}
        for index, number in enumerate(table["number"].to_pylist()):
            # Between the writing of a large file and the end of its parts rows stand in both.
            first.setdefault(number, index)
        return table.take([first[number] for number in sorted(first)])

    def _compact(self) -> None:
        """Makes one file of all."""
        old = self._files()
        if len(old) > 1:
            last = max((int(p.stem.split("-")[1]) for p in old if p.stem[:4] == "rows"), default=0)
            _write_whole(self._table(), self._dataset / f"rows-{last + 1:08d}.parquet")
            for path in old:
                path.unlink()
        self._parts = len(self._files())


def _alike(tables: list[Any]) -> list[Any]:
    """Tables whose columns can be joined: one with texts and numbers becomes one of texts."""
    import pyarrow as pa

    kinds: defaultdict[str, set[str]] = defaultdict(set)
    for table in tables:
        for column in table.schema:
            if not pa.types.is_null(column.type):
                number = pa.types.is_integer(column.type) or pa.types.is_floating(column.type)
                kinds[column.name].add("number" if number else str(column.type))
    mixed = {name for name, found in kinds.items() if len(found) > 1}
    schemas = [
        pa.schema([(c.name, pa.string() if c.name in mixed else c.type) for c in table.schema])
        for table in tables
    ]
    return [table.cast(schema) for table, schema in zip(tables, schemas, strict=True)]


def _endless(content: Mapping[str, Any]) -> dict[str, Any]:
    """Content without what says how far a campaign goes."""
    kept = {key: value for key, value in content.items() if key not in _ENDLESS}
    if isinstance(kept.get("tune"), dict):
        kept["tune"] = {key: v for key, v in kept["tune"].items() if key != "trials"}
    return kept


def _write_whole(table: Any, path: Path) -> None:
    """Writes a file that is there whole or not at all, whatever happens meanwhile."""
    import pyarrow.parquet as pq

    # Readers of datasets pass over names that begin with a dot.
    with _replaced(path) as draft:
        pq.write_table(table, draft)


def _write_text(text: str, path: Path) -> None:
    with _replaced(path) as draft:
        draft.write_text(text, encoding="utf-8")


@contextmanager
def _replaced(path: Path) -> Generator[Path]:
    """A file to write, which takes its place when it is on the disk, and is gone if it fails."""
    draft = path.with_name(f".{path.name}.tmp")
    try:
        yield draft
        with draft.open("rb+") as written:
            os.fsync(written.fileno())
        draft.replace(path)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def _require_pyarrow() -> None:
    try:
        import pyarrow.parquet  # noqa: F401  # pyright: ignore[reportUnusedImport]
    except ImportError:
        raise MissingExtraError("pyarrow", "campaign", "a campaign's results") from None
