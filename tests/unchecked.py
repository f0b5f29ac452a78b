"""Long runs in processes of their own, where loops are not type-checked and take a fifth.

Each is the fork of one process that has imported all of it, which takes longer than many a run.
"""

import json
import multiprocessing
import os
import sys
import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path

_PRELOADED = [
    "poise.cli._run",
    "poise.apps.scenarios",
    "poise.apps.teleoperation",
    "matplotlib.backends.backend_svg",
    "mcap.writer",
    "zstandard",
]


@dataclass(frozen=True)
class Done:
    """A process that has ended: its exit status, and what it printed."""

    status: int
    out: str
    err: str


def run_poise(*arguments):
    """Runs `poise ARGUMENTS` as from a shell."""
    return _run(_act, arguments, timeout=200.0)


def run_unchecked(code, *arguments):
    """Runs Python code, and returns what it prints last, which must be JSON.

    Args:
        code: Python code, with warnings as errors.
        arguments: `sys.argv[1:]` of the code.
    """
    done = _run(_execute, (code, *map(str, arguments)))
    assert done.status == 0, done.err
    return json.loads(done.out.splitlines()[-1])


def _run(act, arguments, timeout=None):
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_PRELOADED)
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder, name) for name in ("out", "err")]
        process = context.Process(target=_begin, args=(files, act, arguments))
        process.start()
        process.join(timeout)
        if process.exitcode is None:
            process.kill()
            process.join()
        status = process.exitcode
        process.close()
        return Done(status, *(file.read_text() for file in files))


def _begin(files, act, arguments):
    """In the new process: prints into files what it prints."""
    for stream, file in enumerate(files, 1):
        os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT), stream)
    act(*arguments)


def _act(*arguments):
    from poise.cli.main import main

    sys.exit(main(list(arguments)))


def _execute(code, *arguments):
    warnings.simplefilter("error")
    sys.argv[1:] = arguments
    exec(compile(code, "<code>", "exec"), {"__name__": "__main__"})
