"""The study of levels that cannot be met: targets out of reach, and strict priorities."""

from collections.abc import Sequence

import numpy as np

from studies.finding import Finding, Section
from studies.plan import Part, Progress, StudyOptions, StudyPlan
from studies.quiet.operational import osf_levels
from studies.quiet.reach import Reach, Rest, random_moves, run_reach
from studies.quiet.strictness_section import near_dependent
from studies.trial_section import Bound, Case, TrialSection, part, worst

ROBOTS = ("g1", "humanoid33", "talos", "panda", "upper17")
BOUNDS = {
    "whole_body": (0.02, 0.1),
    "reduced": (0.02, 0.1),
    "osf": (0.05, 0.2),
    "differential_ik": (0.02, np.inf),
}
"""Largest step of a command over its limit, and largest joint speed [rad/s], by controller."""

RESTLESS = 0.03
"""Share of the runs that may not come to rest."""

HELD_BY_SENSORS = 3.0
"""Largest step and speed with sensors, over those of the same robot standing with them."""


def _cases(options: StudyOptions) -> list[Case]:
    robots = ROBOTS[:1] if options.quick else ROBOTS
    moves = {
        robot: random_moves(robot, options.count(40, 2), options.first_seed) for robot in robots
    }
    ways = [(name, bounds, {}) for name, bounds in BOUNDS.items()]
    ways.append(("whole_body", BOUNDS["whole_body"], {"rate_limited": False}))
    cases: list[Case] = []
    for controller, (step, speed), changes in ways:
        cases.append(
            Case(
                name=controller + (", no rate limit of torques" if changes else ""),
                trials=[
                    Reach(robot=robot, controller=controller, moves=way, **changes)
                    for robot in robots
                    for way in moves[robot]
                ],
                allowed=part(RESTLESS),
                failed=lambda o, step=step, speed=speed: o.fell or o.step > step or o.speed > speed,
                what=f"steps of more than {step:g} of the limit"
                + (f", or joints faster than {speed:g} rad/s," if np.isfinite(speed) else ""),
            )
        )
    for robot in ("g1",) if options.quick else ("g1", "humanoid33"):
        sensed = random_moves(robot, options.count(20, 1), options.first_seed)
        cases.append(
            Case(
                name=f"{robot}, sensors with noise",
                trials=[Reach(robot=robot, moves=way, sensed=True) for way in [(), *sensed]],
                allowed=None,
                bounds=(
                    Bound(
                        name="share of runs beyond 3 times standing",
                        value=_beyond_first,
                        most=RESTLESS,
                    ),
                ),
            )
        )
    return cases


def _beyond_first(rests: Sequence[Rest]) -> float:
    """Share of outcomes with much more motion than the first one, which stands at home."""
    home, *others = rests
    step, speed = HELD_BY_SENSORS * home.step, HELD_BY_SENSORS * home.speed
    return float(np.mean([o.fell or o.step > step or o.speed > speed for o in others]))


targets_section = TrialSection(
    title="Motion in the last second",
    prose=(
        "Targets of the CoM and of the hands are displaced at random by 0.1 to 0.5 m, those of "
        "arms by up to 1 m, within 2 s, and rest; steps and speeds are those of the last second "
        "of 5 s.",
    ),
    run=run_reach,
    kind=Rest,
    cases=_cases,
    columns={
        "command step, most": worst("step"),
        "joint speed, most [rad/s]": worst("speed"),
        "error, most [mm]": worst("error", 1e3),
    },
)
"""The section of targets at rest."""

RISE = 1e-9
"""Largest relative rise of a higher level's residual that counts as none."""


def priorities_section(options: StudyOptions, progress: Progress) -> Section:
    """Add lower levels, or ask more of them, and compare residuals of the higher ones."""
    problems = near_dependent(options.count(10_000, 300), options.seed)
    progress(1.0, 2.0)
    count = options.count(1000, 30)
    states = osf_levels(count, options.seed)
    rise = max(states["contacts"], states["balance"])
    progress(2.0, 2.0)
    findings = (
        Finding(
            name="nearly dependent rows: silent rises by a lower level",
            paper=0,
            ours=int(problems["silent"]),
            ok=problems["silent"] == 0,
            note=f"of {problems['problems']} problems with rows dependent to within 1e-10 to 1e-7; "
            f"{problems['inaccurate']} are reported as inaccurate",
        ),
        Finding(
            name="operational space: largest rise of a higher level by hands that ask for more",
            paper=RISE,
            ours=float(rise),
            ok=rise <= RISE,
            note=f"{count} states of G1, hands asked 1, 5 and 10 times, strict levels",
        ),
    )
    return Section(findings=findings)


PLAN = StudyPlan(
    name="quiet",
    title="Quiet strict priority",
    introduction=(
        "A level of a stack that cannot be met is softened: it comes to rest at its edge, and the "
        "levels below cost it nothing. Targets in and out of reach show the motion that is left, "
        "and problems and states drawn at random that priorities hold.",
    ),
    source="T. Sugihara, “Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt "
    "method”, T-RO 2011, for error-proportional damping; the bounds are ours.",
    parts=(
        Part("targets", "Targets at rest", targets_section),
        Part("priorities", "Strictness", priorities_section),
    ),
)
"""The study."""
