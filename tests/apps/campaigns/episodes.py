"""Stand-ins for episodes, which workers find by this module's name."""

import os
import signal
import time
from pathlib import Path

from poise.apps.campaigns import Job
from poise.errors import ConfigurationError

TINY = {"name": "tiny", "robot": "biped20", "duration": 0.02}


def jobs(count, **values):
    """Jobs that nobody looks at closely."""
    return [
        Job(number=n, scenario=TINY, where="tiny.yaml", values=values, seed=n, version="x")
        for n in range(count)
    ]


def row(job):
    return {
        "number": job.number,
        "seed": job.seed,
        "version": job.version,
        "ended": "2026-11-22T12:00:00.000+00:00",
        "values": "{}",
        "outcome": "ok",
        "square": float(job.number**2),
    }


def quick(job):
    return row(job)


def slow(job):
    time.sleep(0.2)
    return row(job)


def noted(job):
    """Leaves a line in the file that the job names: who ran it."""
    with Path(job.values["notes"]).open("a") as notes:
        notes.write(f"{job.number} {os.getpid()}\n")
    time.sleep(0.05)
    return row(job)


def ending_third(job):
    """Number 3 takes its process along, after a while; the others take their time."""
    if job.number == 3:
        time.sleep(job.values.get("after", 0.0))
        os.kill(os.getpid(), signal.SIGSEGV)
    return slow(job)


def ending_once(job):
    """Number 3 takes its process along the first time only."""
    marker = Path(job.values["marker"])
    if job.number == 3 and not marker.exists():
        marker.touch()
        time.sleep(job.values.get("after", 0.0))
        os._exit(7)
    return noted(job)


def refusing(job):
    raise ConfigurationError("not this one", got=job.number)


def refusing_first(job):
    return refusing(job) if job.number == 0 else slow(job)


def failing(job):
    return [][job.number]


def nothing(item):
    return item
