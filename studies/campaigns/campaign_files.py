"""Campaigns of the study: their files, and reading what they left behind."""

import json
from pathlib import Path
from typing import Any

from poise.apps.campaigns import read_rows

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
    """The rows in a campaign's folder now, by number; none before it has begun."""
    return read_rows(folder) if (folder / "campaign.json").exists() else []
