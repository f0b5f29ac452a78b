"""`estimation_section`: the estimate of the base on walks."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import chi2

from studies.locomotion.estimated_walk import NO_CELLS, Outcome, Trial, run_trial
from studies.plan import StudyOptions
from studies.trial_section import Bound, Case, TrialSection, none, total, worst

ROBOTS, _SEEDS = ("humanoid33", "g1"), 20

_VELOCITY, _TILT, _DRIFT = 0.05, 0.5, 2.0
"""Bounds of the estimate: rms errors of velocity [m/s] and tilt [deg], drift over the way [%]."""

_OBSERVED, _CONFIDENCE = 5, 0.99
"""Degrees of freedom of tilt and velocity; the mean NEES of as many seeds exceeds its bound in one
study of a hundred, where the filter is consistent."""

_SLIPPERY = 0.35
"""Friction of a floor on which feet slip before the robot falls."""


def _mean_nees(outcomes: Sequence[Outcome]) -> float:
    return float(np.mean([outcome.nees for outcome in outcomes]))


def _estimation_cases(options: StudyOptions) -> list[Case]:
    seconds = 20.0 if options.quick else 60.0
    seeds = [options.seed * _SEEDS + i for i in range(options.count(_SEEDS, 1))]
    consistent = float(chi2.ppf(_CONFIDENCE, _OBSERVED * len(seeds)) / len(seeds))
    velocity = Bound(
        name="velocity error, rms", value=worst("velocity_rms"), most=_VELOCITY, unit="m/s"
    )
    bounds = (
        velocity,
        Bound(
            name="tilt error, rms",
            value=worst("tilt_rms", 180.0 / math.pi),
            most=_TILT,
            unit="deg",
        ),
        Bound(name="drift over the way", value=worst("drift", 100.0), most=_DRIFT, unit="%"),
        Bound(
            name="NEES of tilt and velocity",
            value=_mean_nees,
            most=consistent,
            note="mean; 5 is consistent",
        ),
    )
    plain = [
        Case(
            name=robot,
            trials=[Trial(robot=robot, seed=s, seconds=seconds) for s in seeds],
            bounds=bounds,
        )
        for robot in ROBOTS
    ]

    def hard(name: str, allowed: Callable[..., float] | None, **changes: float | str) -> Case:
        trials = [
            Trial(robot=robot, seed=seeds[0], seconds=seconds, **changes)  # type: ignore[arg-type]
            for robot in ROBOTS
        ]
        return Case(name=name, trials=trials, allowed=allowed, bounds=(velocity,))

    # On less friction than the controller believes in robots fall with true states, too.
    return [
        *plain,
        hard("a slippery floor", None, friction=_SLIPPERY),
        *(hard(f"cells: {cells}", none, cells=cells) for cells in ("stuck", "zero", NO_CELLS)),
    ]


estimation_section = TrialSection(
    title="Estimates on walks",
    prose=(
        "Straight walks in steps of 0.15 m; seeds draw noise and biases. Errors are against the "
        "truth of the moment that the sensors measured. NEES is the error of tilt and velocity, "
        "squared and normalised by the filter's own covariance: its mean is 5 for a consistent "
        "filter, more for one that believes too much, less for a careful one.",
    ),
    run=run_trial,
    kind=Outcome,
    cases=_estimation_cases,
    columns={
        "way [m]": total("way"),
        "velocity error, rms, worst [mm/s]": worst("velocity_rms", 1e3),
        "tilt error, rms, worst [deg]": worst("tilt_rms", 180.0 / math.pi),
        "drift, worst [%]": worst("drift", 100.0),
        "height error, worst [mm]": worst("height", 1e3),
        "NEES, mean": _mean_nees,
    },
)
"""The section of the estimate on walks."""
