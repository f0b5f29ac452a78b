"""The `poise` command, and what any command around Poise shares with it."""

from poise._progress import Bar
from poise.cli._command import run_command

__all__ = [
    "Bar",
    "run_command",
]
