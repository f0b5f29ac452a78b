"""The `poise` command, and what any command around Poise shares with it."""

from poise.cli._command import run_command
from poise.cli._progress import Bar

__all__ = [
    "Bar",
    "run_command",
]
