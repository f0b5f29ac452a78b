"""Cards and results that tests look at."""

from dataclasses import replace

from poise.apps.scorecard import Card
from poise.apps.scorecard._card import CaseResult, SeedResult, TrialResult
from poise.apps.scorecard._trials import VERSION


def case(median=0.4, *, low=None, high=None, level=0.25, angle=None, phase=None, limit=""):
    return CaseResult(
        angle=angle,
        phase=phase,
        median=median,
        low=median - 0.1 if low is None else low,
        high=median + 0.1 if high is None else high,
        confidence=0.75,
        level=level,
        limit=limit,
        seeds=(SeedResult(amount=median), SeedResult(amount=median, limit="at least")),
        episode=17,
        mechanism="torque of <knee> at its limit (0.6 s)",
    )


def trial(name, title, unit, easy, hard, *cases):
    return TrialResult(name=name, title=title, unit=unit, easy=easy, hard=hard, cases=cases)


PUSHES = trial(
    "push", "push, standing", "m/s", 0.0, 1.6,
    *(case(0.3 + 0.1 * i, angle=90.0 * i, level=0.2 + 0.1 * i) for i in range(4)),
)  # fmt: skip
STEPS = trial(
    "push_walk", "push, walking", "m/s", 0.0, 1.6,
    *(case(0.3, angle=90.0 * i, phase=p) for p in (0.1, 0.7) for i in range(4)),
)  # fmt: skip
DELAY = trial("delay", "delay of sensors", "s", 0.0, 0.128, case(0.02, low=0.02, high=0.03))
FRICTION = trial(
    "friction",
    "friction",
    "",
    1.0,
    0.01,
    case(0.01, low=0.01, high=0.05, level=1.0, limit="at least"),
)

CARD = Card(
    robot="biped20",
    controller="whole_body",
    version="0.1.0+aaaa",
    trials_version=VERSION,
    quick=True,
    trials=(PUSHES, STEPS, DELAY, FRICTION),
    left_out={"speed": "it cannot <walk>"},
)


def other(**changes):
    """A card of another version, whose delay is far worse."""
    worse = replace(DELAY, cases=(case(0.005, low=0.004, high=0.006, level=0.04),))
    plain = {"version": "0.2.0+bbbb", "trials": (PUSHES, worse)}
    return replace(CARD, **(plain | changes))
