"""How much torques change from tick to tick, with and without the bound on it."""

from collections.abc import Sequence

from studies.finding import Finding, Section, Table
from studies.locomotion.torque_steps import Kind, StepOutcome, StepTrial, run_step_trial
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

ROBOTS = ("humanoid33", "g1")
RATE = 50.0
"""The default [1/s]."""

_BOUNDS: dict[Kind, float] = {"walk": 0.25, "bumps": 0.5, "stand": 0.25}
"""Largest step that is wanted, by the joint's limit."""

_MET = 1e-6
"""Residual of contacts and joint limits up to which they are met."""

_SEEDS, _SECONDS, _QUICK_SECONDS = 20, 30.0, 6.0


def steps_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    seeds, seconds = (1, _QUICK_SECONDS) if options.quick else (_SEEDS, _SECONDS)
    trials = [
        StepTrial(
            robot=robot, kind=kind, rate=rate, seed=options.seed * _SEEDS + i, seconds=seconds
        )
        for robot in ROBOTS
        for kind in _BOUNDS
        for rate in (None, RATE)
        for i in range(1 if kind == "walk" else seeds)
    ]
    outcomes = run_step_trials(trials, progress)
    groups: dict[tuple[str, Kind, float | None], list[StepOutcome]] = {}
    for trial in trials:
        groups.setdefault((trial.robot, trial.kind, trial.rate), []).append(outcomes[trial])
    findings = [
        finding
        for (robot, kind, rate), found in groups.items()
        if rate is not None
        for finding in _findings(robot, kind, found)
    ]
    return Section(
        prose=(
            f"Runs of {seconds:.0f} s with the true state: a walk of 0.15 m steps on the flat, the "
            "same over bumps of up to 20 mm that nobody told of, and standing while the torso is "
            "pushed every second by 0.1 m/s. A torque step is the change of a torque from tick to "
            "tick, 2 ms, over the joint's limit.",
        ),
        findings=tuple(findings),
        tables=(_table(groups),),
    )


def run_step_trials(
    trials: Sequence[StepTrial], progress: Progress, workers: int | None = None
) -> dict[StepTrial, StepOutcome]:
    """Runs trials in processes of their own, as many at a time as there are cores.

    Args:
        trials: in any order.
        progress: told how many are done.
        workers: processes; one a core when None.

    Raises:
        PoiseError: a trial has ended every process that tried it.
    """
    return run_each(run_step_trial, StepOutcome, trials, progress, workers)


def _findings(robot: str, kind: Kind, outcomes: Sequence[StepOutcome]) -> list[Finding]:
    largest = max(o.largest for o in outcomes)
    found = [
        Finding(
            name=f"{robot}, {kind}: largest torque step",
            paper=_BOUNDS[kind],
            ours=largest,
            ok=largest <= _BOUNDS[kind],
            note=f"by the joint's limit; {len(outcomes)} seeds",
        )
    ]
    if kind == "walk":
        worst = max(o.worst_physics for o in outcomes)
        found.append(
            Finding(
                name=f"{robot}, {kind}: residual of level 2",
                paper=_MET,
                ours=worst,
                ok=worst <= _MET,
                note="every tick on flat ground",
            )
        )
    return found


def _table(groups: dict[tuple[str, Kind, float | None], list[StepOutcome]]) -> Table:
    rows = [
        (
            robot,
            kind,
            "none" if rate is None else f"{rate:g}",
            f"{sum(o.fell for o in found)} of {len(found)}",
            f"{max(o.largest for o in found):.2f}",
            str(sum(o.steps for o in found)),
            f"{max(o.worst_physics for o in found):.1e}",
        )
        for (robot, kind, rate), found in groups.items()
    ]
    return Table(
        title="Torque steps",
        header="robot | run | rate [1/s] | falls | largest step | over half a limit | level 2",
        rows=tuple(rows),
        caption="With no bound on the change of torques, and with the default one.",
    )
