"""Campaigns of the study: their files, and reading what they left behind."""

import json
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent

_TIMES = ("ended", "seconds", "real_time_factor", "tick_us_p50", "tick_us_p99", "tick_us_max")
"""Columns that are not the same when an episode is run again."""


def write_campaign(path: Path, scenario: str, **keys: Any) -> Path:
    """Writes a campaign's file.

    Args:
        path: of the file.
        scenario: name of a scenario's file beside this module.
        keys: of the campaign's file.
    """
    content = {"name": path.stem, "scenario": str(FOLDER / scenario), **keys}
    # JSON is YAML.
    path.write_text(json.dumps(content, indent=1), encoding="utf-8")
    return path


def without_times(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows without the columns that differ from run to run."""
    return [{key: v for key, v in row.items() if key not in _TIMES} for row in rows]


def recorded(folder: Path) -> list[dict[str, Any]]:
    """The rows in a campaign's folder, by number."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    tables = [pq.read_table(path) for path in sorted((folder / "episodes").glob("*.parquet"))]
    if not tables:
        return []
    rows = pa.concat_tables(tables, promote_options="permissive").to_pylist()
    return sorted(rows, key=lambda row: row["number"])


def count_recorded(folder: Path) -> int:
    """How many rows there are now, of a campaign that is running."""
    import pyarrow.parquet as pq

    count = 0
    for path in (folder / "episodes").glob("*.parquet"):
        try:
            count += pq.read_metadata(path).num_rows
        except FileNotFoundError:
            # Several files have become one meanwhile; the next look finds that.
            continue
    return count
