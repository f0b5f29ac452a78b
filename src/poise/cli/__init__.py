"""The `poise` command, and what any command around Poise shares with it."""

from poise.cli._command import run_command
from poise.cli._options import add_output_options, make_folder, whole_number, words_of
from poise.cli._progress import Bar

__all__ = [
    "Bar",
    "add_output_options",
    "make_folder",
    "run_command",
    "whole_number",
    "words_of",
]
