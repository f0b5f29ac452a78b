"""Runs of the design, a row of a file each; those that the file already has are not made again."""

from poise.apps.campaigns import LocalWorkers
from studies.ablation.effects_section import rows_of
from studies.ablation.runs import SECONDS, AblationOutcome, draw, pushed, run
from studies.finding import Finding, Section
from studies.plan import Progress, StudyOptions

_RUNS, _QUICK_RUNS, _QUICK_SECONDS = 800, 4, 2.0


def runs_section(options: StudyOptions, progress: Progress) -> Section:
    """The section: makes the runs that are missing."""
    rows = rows_of(options)
    seconds = _QUICK_SECONDS if options.quick else SECONDS
    count, first = options.count(_RUNS, _QUICK_RUNS), options.first_seed
    outcomes, lost = rows.read(), 0
    done = {outcome.trial.seed for outcome in outcomes}
    left = [seed for seed in range(first, first + count) if seed not in done]
    # Drawn when a process is free, with the pushes that former outcomes ask for.
    trials = (pushed(draw(seed, seconds), outcomes) for seed in left)
    with LocalWorkers(options.processes) as crew:
        for number, (_, outcome) in enumerate(crew.each(run, trials), start=1 + count - len(left)):
            if isinstance(outcome, AblationOutcome):
                outcomes.append(outcome)
                rows.append(outcome)
            else:
                lost += 1
            progress(float(number), float(count))
    failed = sum(bool(outcome.error) for outcome in outcomes)
    return Section(
        prose=(f"{count} runs of {seconds:.0f} s from seed {first}, in `{rows.path}`.",),
        findings=(
            Finding(
                name="runs without an outcome",
                ours=lost + failed,
                ok=lost + failed == 0,
                note="their process ended, or they raised an error, which their row has",
            ),
        ),
    )
