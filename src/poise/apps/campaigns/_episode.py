"""`Job`: a scenario with values to be run. `run_episode`: runs it, anywhere, to one row."""

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from itertools import islice
from pathlib import Path
from socket import gethostname
from time import perf_counter
from typing import Any

from numba.core.event import install_recorder

from poise.apps.campaigns._fields import with_fields
from poise.apps.scenarios import (
    INTERRUPTED,
    Measurement,
    Run,
    Scenario,
    make_scenario,
    measure,
    run_scenario,
    stage_scenario,
    summarise,
    validate_checks,
)
from poise.errors import PoiseError
from poise.robots import Robot
from poise.sim import rollout

# Texts, numbers and truth values by column, None where there is none.
Row = dict[str, Any]

OUTCOMES = ("ok", "failed", "fell", "diverged", "error", "refused", "crashed")
"""Outcomes of an episode: all checks held, one failed, the robot fell, the simulation diverged, the
simulator raised, the scenario does not fit its robot, its process died each time it was tried."""

ABOUT = (
    "number", "seed", "version", "ended", "seconds", "values", "trial", "outcome", "reason",
    "robot", "controller",
)  # fmt: skip
"""Columns that identify an episode and its result."""

FIGURES = ("simulated_s", "com_error_max_m", "torque_ratio_max", "missed_ticks")
"""Columns with figures of every run, besides times, residuals (`residual_max_1`, ...) and the
values of checks (`check: ...`)."""

RAN = ("ok", "failed")
"""Outcomes of episodes that came to their end, with figures that mean something."""

TIMINGS = ("ended", "seconds", "real_time_factor", "tick_us_p50", "tick_us_p99", "tick_us_max")
"""Columns that differ when the same episode is run again; all others do not."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """One episode to be run."""

    number: int  # its name in a folder
    scenario: Mapping[str, Any]  # content of the scenario's file
    where: str  # name of that file in messages
    values: Mapping[str, Any] = field(default_factory=dict[str, Any])  # by path, for the file's
    seed: int = 0
    figures: Mapping[str, Measurement] = field(default_factory=dict[str, Measurement])
    labels: Mapping[str, Any] = field(default_factory=dict[str, Any])  # more columns of its row
    version: str = field(default_factory=lambda: version())  # of the code that is to run it

    def make(self) -> Scenario:
        """The scenario with the job's values and seed."""
        made = make_scenario(with_fields(self.scenario, self.values), self.where)
        return replace(made, seed=self.seed)


@cache
def version() -> str:
    """Version of Poise, and after a `+` the first letters of a digest of its sources."""
    root = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for path in sorted([*root.rglob("*.py"), *root.rglob("*.yaml")]):
        digest.update(f"{path.relative_to(root)}\n".encode() + path.read_bytes())
    return f"{metadata.version('poise')}+{digest.hexdigest()[:8]}"


def run_episode(
    job: Job, describe: Callable[[Job, Run], Row] | None = None, robot: Robot | None = None
) -> Row:
    """Run an episode to its row, also where something goes wrong in it."""
    _check_version(job)
    begin = perf_counter()
    try:
        run = run_scenario(job.make(), robot=robot)
        if run.ended_early == INTERRUPTED:
            raise KeyboardInterrupt
        row = (describe or row_of)(job, run)
    except PoiseError as error:
        row = without_run(job, "refused", str(error))
    except Exception as error:  # Of MuJoCo or a library: this episode's result, not the campaign's.
        row = without_run(job, "error", f"{type(error).__name__}: {error}")
    return {**row, "seconds": perf_counter() - begin}


def row_of(job: Job, run: Run) -> Row:
    """The row of a job whose scenario has been run."""
    validate_checks([*job.figures.values()], run.controller.stack, run.robot)
    summary: Any = summarise(run)
    failed = [check.name for check in run.checks if not check.ok]
    outcome = "fell" if run.fell else "ok" if run.ok else "failed"
    row: Row = {
        **_about(job),
        "outcome": "diverged" if run.plant.diverged else outcome,
        "reason": run.ended_early or "; ".join(failed),
        "robot": summary["robot"],
        "controller": summary["controller"],
        "simulated_s": float(run.signals.time[-1]),
        **{k: summary[k] for k in ("com_error_max_m", "torque_ratio_max", "missed_ticks")},
        **{f"residual_max_{i}": value for i, value in enumerate(summary["residual_max"], 1)},
        **{f"tick_us_{name}": value for name, value in summary["tick_us"].items()},
        "real_time_factor": summary["real_time_factor"],
        **{f"check: {check['name']}": check["value"] for check in summary["checks"]},
    }
    for name, plan in job.figures.items():
        value = measure(plan, run.signals).value
        row[name] = value if math.isfinite(value) else None
    return row


def without_run(job: Job, outcome: str, reason: str) -> Row:
    """The row of a job whose scenario came to no end."""
    return {**_about(job), "outcome": outcome, "reason": " ".join(reason.split())}


def same_kind(job: Job) -> str:
    """A text that jobs have in common for which the same is compiled."""
    chosen = {p: v for p, v in job.values.items() if p.startswith(("robot", "controller"))}
    return json.dumps([job.where, chosen])


def warm_up(kinds: Sequence[tuple[Sequence[Job], bool]]) -> bool:
    """Compile what jobs need, and find scenarios that do not fit their robots.

    Of each kind there are some jobs, and whether one of the kind has a row already; without a row
    it is an error that none fits. The first that does is set up and run for two ticks: all that is
    compiled is kept in the folder that all workers of a machine share. True if something was.
    """
    with install_recorder("numba:compile") as compiling:
        for jobs, begun in kinds:
            refused: list[PoiseError] = []
            for job in jobs:
                _check_version(job)
                try:
                    _begin(job)
                    break
                except PoiseError as error:
                    refused.append(error)
            else:
                if not begun:
                    raise refused[0]
    return bool(compiling.buffer)


def _begin(job: Job) -> None:
    stage = stage_scenario(job.make())
    validate_checks([*job.figures.values()], stage.leader.stack, stage.robot)
    ticks = rollout(stage.plant, stage.controller, stage.leader, estimator=stage.estimator)
    for _ in islice(ticks, 2):
        pass


def _check_version(job: Job) -> None:
    if version() != job.version:
        where = f"a worker on {gethostname()} has another version of Poise"
        raise PoiseError(where, got=version(), wanted=job.version)


def _about(job: Job) -> Row:
    """Columns of the job itself; as JSON the values are kept to the last bit, lists included."""
    plain = {path: v for path, v in job.values.items() if isinstance(v, str | int | float)}
    return {
        "number": job.number,
        "seed": job.seed,
        "version": job.version,
        "ended": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "values": json.dumps(dict(job.values)),
        **job.labels,
        **plain,
    }
