"""How far the estimate is off on walks, with good and bad contacts."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import chi2

from studies.finding import Finding, Section, Table
from studies.locomotion.estimated_walk import Outcome, Trial, run_trial
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

ROBOTS = ("humanoid33", "g1")

_SEEDS, _SECONDS = 20, 60.0
_QUICK_SEEDS, _QUICK_SECONDS = 1, 20.0

VELOCITY, TILT, DRIFT = 0.05, np.radians(0.5), 0.02
"""Bounds: rms errors of velocity [m/s] and tilt [rad], drift over the way."""

_OBSERVED = 5
"""Degrees of freedom of tilt and velocity."""

_CONFIDENCE = 0.99

_SLIPPERY = 0.35
"""Friction of a floor on which feet slip without the robot falling at once."""

_HARD: tuple[tuple[str, dict[str, float | str]], ...] = (
    ("a slippery floor", {"friction": _SLIPPERY}),
    ("cells stuck at 40% of the weight", {"fault": "stuck"}),
    ("cells that say nothing", {"fault": "dead"}),
    ("no cells, torques alone", {"fault": "none"}),
)


def estimation_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    seeds = options.count(_SEEDS, _QUICK_SEEDS)
    seconds = _QUICK_SECONDS if options.quick else _SECONDS
    first = options.seed * _SEEDS
    plain = [
        Trial(robot=robot, seed=first + i, seconds=seconds)
        for robot in ROBOTS
        for i in range(seeds)
    ]
    hard = {
        what: [Trial(robot=robot, seed=first, seconds=seconds, **change) for robot in ROBOTS]  # type: ignore[arg-type]
        for what, change in _HARD
    }
    trials = plain + [trial for group in hard.values() for trial in group]
    outcomes = run_each(run_trial, Outcome, trials, progress, options)
    findings = [
        finding
        for robot in ROBOTS
        for finding in _walk_findings(robot, [outcomes[t] for t in plain if t.robot == robot])
    ]
    for what, group in hard.items():
        findings += _hard_findings(what, [outcomes[trial] for trial in group])
    return Section(
        prose=(
            f"Straight walks of {seconds:.0f} s in steps of 0.15 m, {seeds} seeds a robot, which "
            "draw noise and biases. Errors are against the truth of the moment that the sensors "
            "measured. NEES is the error of tilt and velocity, squared and normalised by the "
            "filter's own covariance: its mean is 5 for a consistent filter, more for one that "
            "believes too much, less for a careful one. The bound is what the mean of as many "
            "seeds exceeds once in a hundred.",
        ),
        findings=tuple(findings),
        tables=(_table(trials, outcomes),),
    )


def _walk_findings(robot: str, outcomes: Sequence[Outcome]) -> list[Finding]:
    """What is asked of every seed, by the worst one."""
    worst = _worst_of(outcomes)
    falls = sum(o.fell for o in outcomes)
    nees = float(np.mean([o.nees for o in outcomes]))
    most = float(chi2.ppf(_CONFIDENCE, _OBSERVED * len(outcomes)) / len(outcomes))
    note = f"worst of {len(outcomes)} seeds"
    return [
        Finding(name=f"{robot}: falls", paper=0, ours=falls, ok=falls == 0, note=note),
        _bounded(
            f"{robot}: velocity error, rms", worst(lambda o: o.velocity_rms), VELOCITY, "m/s", note
        ),
        _bounded(
            f"{robot}: tilt error, rms",
            np.degrees(worst(lambda o: o.tilt_rms)),
            np.degrees(TILT),
            "deg",
            note,
        ),
        _bounded(
            f"{robot}: drift over the way",
            100.0 * worst(lambda o: o.drift),
            100.0 * DRIFT,
            "%",
            note,
        ),
        _bounded(
            f"{robot}: NEES of tilt and velocity",
            nees,
            most,
            "",
            "mean over seeds; 5 is consistent",
        ),
    ]


def _hard_findings(what: str, outcomes: Sequence[Outcome]) -> list[Finding]:
    """Survived: a velocity that a controller can use, and no fall where the floor carries one.

    On a floor with less friction than the controller believes robots fall with the truth, too.
    """
    robots = ", ".join(
        f"{o.trial.robot} {'fell after' if o.fell else 'walked'} {o.way:.1f} m, "
        f"soles slipped {o.slipped:.2f} m"
        for o in outcomes
    )
    velocity = max(o.velocity_rms for o in outcomes)
    found = [_bounded(f"{what}: velocity error, rms", velocity, VELOCITY, "m/s", robots)]
    if all(o.trial.friction >= 1.0 for o in outcomes):
        falls = sum(o.fell for o in outcomes)
        found.append(
            Finding(name=f"{what}: falls", paper=0, ours=falls, ok=falls == 0, note=robots)
        )
    return found


def _worst_of(outcomes: Sequence[Outcome]) -> Callable[[Callable[[Outcome], float]], float]:
    return lambda pick: max(pick(outcome) for outcome in outcomes)


def _bounded(name: str, ours: float, bound: float, unit: str, note: str) -> Finding:
    ok = bool(ours <= bound)
    return Finding(
        name=name, paper=float(bound), ours=float(ours), unit=unit, ok=ok, note=f"at most; {note}"
    )


def _table(trials: Sequence[Trial], outcomes: dict[Trial, Outcome]) -> Table:
    rows: list[tuple[str | float, ...]] = []
    for trial in trials:
        o = outcomes[trial]
        case = trial.fault or ("slippery" if trial.friction < 1.0 else "walk")
        figures = (
            o.way,
            o.slipped,
            1e3 * o.velocity_rms,
            float(np.degrees(o.tilt_rms)),
            100.0 * o.drift,
        )
        rows.append(
            (
                trial.robot,
                case,
                trial.seed,
                "yes" if o.fell else "no",
                *figures,
                1e3 * o.height,
                o.nees,
                o.estimator_us,
            )
        )
    return Table(
        title="Runs",
        header="robot | case | seed | fell | way [m] | slipped [m] | velocity rms [mm/s] | "
        "tilt rms [deg] | drift [%] | height [mm] | NEES | update [us]",
        rows=tuple(rows),
        caption="Drift and height are the largest of a run; the update's time is its median.",
    )
