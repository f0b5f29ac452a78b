"""Falls under the bad operator, seed by seed, over all cores."""

import os
from collections.abc import Generator
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path

from studies.bad_operator.trial import Outcome, Trial, run_trial
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions

_SEEDS, _SECONDS, _QUICK_SEEDS = 200, 60.0, 20
_SPREAD = 1_000_000
"""Seeds of `--seed N` begin at N times this: runs with different N share none. Tuning used seeds
from 100,000 to 100,999, which no N reaches."""

ALLOWED = 2
"""Falls in 200 seeds that are asked for at most."""

FOLDER = Path("runs/bad-operator-falls")
"""Where inputs that made the robot fall are kept."""

_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def falls_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    count = _QUICK_SEEDS if options.quick else _SEEDS
    first = _SPREAD * options.seed
    outcomes = run_trials(
        [Trial(seed=first + i, seconds=_SECONDS, folder=FOLDER) for i in range(count)], progress
    )
    falls = [o for o in outcomes if o.fell]
    allowed = ALLOWED * count // _SEEDS if count >= _SEEDS else 0
    steps = sum(o.steps for o in outcomes)
    return Section(
        prose=(
            f"Seeds {first} to {first + count - 1}, {_SECONDS:.0f} s each. Inputs that made the "
            f"robot fall are in `{FOLDER}`; `poise.apps.teleoperation.replay_teleop` "
            "runs them again.",
        ),
        findings=(
            Finding(
                name=f"falls in {count} seeds",
                paper=None,
                ours=len(falls),
                unit="",
                ok=len(falls) <= allowed,
                note=f"asked: at most {ALLOWED} in {_SEEDS}; {steps} feet were lifted in all",
            ),
        ),
        tables=(
            Table(
                title="Falls",
                header=("seed", "fell at [s]", "mode", "feet lifted before", "recording"),
                rows=tuple(
                    (o.seed, o.seconds, o.mode, o.steps, str(o.recording or "")) for o in falls
                ),
                caption="" if falls else "None.",
            ),
        ),
    )


def run_trials(
    trials: list[Trial], progress: Progress, workers: int | None = None
) -> list[Outcome]:
    """Runs trials in processes of their own, as many at a time as there are cores.

    Args:
        trials: in any order.
        progress: told how many are done.
        workers: processes; one a core when None.

    Returns:
        Outcomes in the order of the trials; they do not depend on the number of processes.
    """
    outcomes: list[Outcome] = []
    with _one_thread_each(), get_context("spawn").Pool(workers) as pool:
        for outcome in pool.imap(run_trial, trials):
            outcomes.append(outcome)
            progress(float(len(outcomes)), float(len(trials)))
    return outcomes


@contextmanager
def _one_thread_each() -> Generator[None]:
    """Workers inherit the environment: linear algebra in them must not start threads of its own."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
