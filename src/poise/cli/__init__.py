"""The `poise` command, and parts that other commands can reuse."""

from poise._progress import Bar
from poise.cli._command import run_command

__all__ = [
    "Bar",
    "run_command",
]
