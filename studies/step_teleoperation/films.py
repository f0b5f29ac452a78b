"""Videos of runs; where the machine cannot draw, or has no encoder, none."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

from poise.apps.teleoperation import TeleopRun
from poise.errors import MissingExtraError
from poise.sim import render_video
from studies.figure import Film


def films(runs: Sequence[tuple[str, str, TeleopRun]]) -> tuple[Film, ...]:
    """A video a run.

    Args:
        runs: name of the file, title, and the run.
    """
    made: list[Film] = []
    with tempfile.TemporaryDirectory() as folder:
        for name, title, run in runs:
            path = Path(folder) / f"{name}.mp4"
            try:
                render_video(run.plant, run.log.time, run.log.q, path)
            except MissingExtraError:
                # The snapshots' note says why.
                return ()
            made.append(Film(name=name, title=title, data=path.read_bytes()))
    return tuple(made)
