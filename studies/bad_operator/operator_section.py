"""`operator_section`: falls of robots that bad operators lead, by robot and condition."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from studies.bad_operator.conditions import DESCRIBED, MIXED
from studies.bad_operator.led_trial import Outcome, Trial, run_trial
from studies.plan import StudyOptions
from studies.trial_section import Case, TrialSection, median, none, total, worst

FALL_EVERY = 10.0
"""Time in which one fall is allowed where a robot is not as described, or is pushed [min]."""

Allowed = Callable[[Sequence[Any]], float] | None
"""Falls that are allowed, of the outcomes of a case; None where nothing is asked."""


class Asked(NamedTuple):
    """Robot and condition of a case."""

    robot: str
    condition: str
    level: str = "torque"
    solved_by: str | None = None


def one_in_ten_minutes(outcomes: Sequence[Outcome]) -> float:
    """Allow a fall every `FALL_EVERY` minutes."""
    return sum(outcome.seconds for outcome in outcomes) / 60.0 / FALL_EVERY


def none_but_mixed(asked: Asked) -> Allowed:
    """Allow falls under the mixed condition alone."""
    return one_in_ten_minutes if asked.condition == MIXED else none


def operator_section(
    title: str,
    asked: Sequence[Asked],
    seeds: tuple[int, int],
    allowed: Callable[[Asked], Allowed],
    *,
    prose: str = "",
    described_seeds: int | None = None,
    quick_seconds: float = 20.0,
    run: Callable[[Trial], Outcome] = run_trial,
    folder: Path | None = None,
) -> TrialSection:
    """Make a part of a study that has operators lead robots for a minute a seed.

    Args:
        title: of its table.
        asked: robots and conditions.
        seeds: of each case, in the whole and in the quick version.
        allowed: falls of each case.
        prose: about it.
        described_seeds: seeds of robots as described; as of the others when None.
        quick_seconds: length of a run in the quick version [s].
        run: runs a trial.
        folder: keeps the inputs of falls, by robot.
    """

    def cases(options: StudyOptions) -> list[Case]:
        seconds, found = quick_seconds if options.quick else 60.0, list[Case]()
        for one in asked:
            full, quick = seeds
            if one.condition == DESCRIBED and described_seeds is not None:
                full = described_seeds
            trials = [
                Trial(
                    robot=one.robot,
                    level=one.level,
                    condition=one.condition,
                    seed=options.first_seed + k,
                    seconds=seconds,
                    solved_by=one.solved_by,
                    folder=None if folder is None else folder / one.robot,
                )
                for k in range(options.count(full, quick))
            ]
            words = (one.robot, one.solved_by or one.level, one.condition)
            found.append(Case(name=", ".join(words), trials=trials, allowed=allowed(one)))
        return found

    return TrialSection(
        title=title,
        prose=(prose,) if prose else (),
        run=run,
        kind=Outcome,
        cases=cases,
        columns={
            "minutes": total("seconds", 1.0 / 60.0),
            "feet lifted": total("steps"),
            "lean, median [rad]": median("tilt"),
            "most [rad]": worst("tilt"),
            "legs apart, least [mm]": lambda group: 1e3 * min(o.apart for o in group),
        },
    )
