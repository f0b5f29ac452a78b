"""`falls_finding`: how often robots fell, beside how often they may. `falls_row`: and in a table.

`FALL_EVERY`: what is asked where not everything is as described.
"""

from collections.abc import Sequence

import numpy as np

from studies.bad_operator.conditions import MIXED
from studies.bad_operator.led_trial import Outcome
from studies.finding import Finding

FALL_EVERY = 10.0
"""Where a robot is not as described, or is pushed, one fall in so many minutes is allowed [min]."""


def minutes(group: Sequence[Outcome]) -> float:
    """How long robots stood, all in all [min].

    Args:
        group: what became of trials.
    """
    return sum(outcome.seconds for outcome in group) / 60.0


def falls_allowed(condition: str, group: Sequence[Outcome]) -> float:
    """How many falls are asked for at most: none but under all conditions at once.

    Args:
        condition: what was not as described.
        group: what became of its trials.
    """
    return minutes(group) / FALL_EVERY if condition == MIXED else 0.0


def falls_finding(name: str, group: Sequence[Outcome], allowed: float) -> Finding:
    """The finding.

    Args:
        name: of what was tried.
        group: what became of it.
        allowed: falls that are asked for at most.
    """
    falls = sum(outcome.fell for outcome in group)
    lifted = sum(outcome.steps for outcome in group)
    return Finding(
        name=f"{name}: falls in {len(group)} seeds",
        paper=round(allowed, 2),
        ours=falls,
        ok=falls <= allowed,
        note=f"in {minutes(group):.1f} minutes; {lifted} feet were lifted",
    )


FALLS_HEADER = (
    "robot | condition | seeds | falls | minutes | feet lifted | lean, median [rad] | "
    "greatest [rad]"
)
"""Of a table of `falls_row`s."""


def falls_row(
    robot: str, condition: str, group: Sequence[Outcome]
) -> tuple[str | int | float, ...]:
    """A row of a table.

    Args:
        robot: its name.
        condition: what was not as described.
        group: what became of its trials.
    """
    tilts = [o.tilt for o in group]
    return (
        robot,
        condition,
        len(group),
        sum(o.fell for o in group),
        minutes(group),
        sum(o.steps for o in group),
        float(np.median(tilts)),
        max(tilts),
    )
