"""Pilot runs with one mechanism switched off, beside the same run with all of them."""

from dataclasses import replace

from poise.apps.campaigns import LocalWorkers
from studies.ablation.mechanisms import MECHANISMS, Mechanism
from studies.ablation.runs import TELEOPERATION, AblationOutcome, AblationTrial, draw, run
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions

_SEEDS, _QUICK_SEEDS = 12, 1
_SECONDS, _QUICK_SECONDS = 8.0, 0.5
"""Length of a pilot run [s]: two or three pushes."""


def acts_section(options: StudyOptions, progress: Progress) -> Section:
    """The section: the first of some pilot runs whose motion each mechanism changes."""
    seconds = _QUICK_SECONDS if options.quick else _SECONDS
    first, count = options.first_seed, options.count(_SEEDS, _QUICK_SEEDS)
    acts, tried = dict[str, int](), dict.fromkeys((m.name for m in MECHANISMS), 0)
    with LocalWorkers(options.processes) as crew:
        for seed in range(first, first + count):
            pilot = replace(draw(seed, seconds), off=())
            left = [m for m in MECHANISMS if m.name not in acts and _has(pilot, m)]
            if not left:
                continue
            for name, changes in _compared(pilot, left, crew).items():
                tried[name] += 1
                if changes:
                    acts[name] = seed
            progress(float(seed + 1 - first), float(count))
    return Section(
        prose=(
            f"Up to {count} runs of {seconds:g} s from seed {first}, made again without each "
            "mechanism that has not yet acted. A mechanism acts in a run that ends otherwise "
            "without it: runs are deterministic.",
        ),
        findings=(
            Finding(
                name="mechanisms that act in a pilot run",
                ours=len(acts),
                paper=len(MECHANISMS),
                ok=len(acts) == len(MECHANISMS),
            ),
        ),
        tables=(
            Table(
                title="Where mechanisms act",
                header="mechanism | pilot runs compared | seed of the run in which it acts",
                rows=tuple((name, runs, acts.get(name)) for name, runs in tried.items()),
            ),
        ),
    )


def _has(pilot: AblationTrial, mechanism: Mechanism) -> bool:
    return mechanism.walks or pilot.leader == TELEOPERATION


def _compared(
    pilot: AblationTrial, mechanisms: list[Mechanism], crew: LocalWorkers
) -> dict[str, bool]:
    """Mechanisms whose absence could be compared, and whether it changes the run."""
    trials = [pilot, *(replace(pilot, off=(mechanism.name,)) for mechanism in mechanisms)]
    found = {
        trial: replace(outcome, trial=pilot)
        for trial, outcome in crew.each(run, trials)
        if isinstance(outcome, AblationOutcome)
    }
    whole = found.pop(pilot, None)
    return {} if whole is None else {t.off[0]: outcome != whole for t, outcome in found.items()}
