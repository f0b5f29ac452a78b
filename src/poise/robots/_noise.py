"""Output of libraries that read a file, kept from the terminal and logged."""

import logging
import os
import sys
import tempfile
import threading
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass

_LOG = logging.getLogger("poise.robots")
_LOCK = threading.Lock()  # All threads share stdout and stderr


@dataclass
class Noise:
    """Captured output on one line, complete after the block."""

    text: str = ""


@contextmanager
def captured() -> Generator[Noise]:
    """Catch what C++ libraries print to stdout and stderr inside the block.

    It goes to the logger `poise.robots` at level DEBUG: urdfdom and console_bridge complain about
    most files, and an error that stops the reading is raised as well.
    """
    noise = Noise()
    with _LOCK, tempfile.TemporaryFile() as file:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
        kept = {number: os.dup(number) for number in (1, 2)}
        try:
            for number in kept:
                os.dup2(file.fileno(), number)
            yield noise
        finally:
            for number, copy in kept.items():
                os.dup2(copy, number)
                os.close(copy)
            file.seek(0)
            noise.text = " ".join(file.read().decode(errors="replace").split())
            if noise.text:
                _LOG.debug("%s", noise.text)
