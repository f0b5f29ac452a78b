"""How much torques change from tick to tick, with and without the bound on it."""

from collections.abc import Sequence

from studies.finding import Finding, Section, Table
from studies.locomotion.led_section import ROBOTS
from studies.locomotion.led_walk import LedOutcome, LedTrial, run_led
from studies.locomotion.torque_steps import StandOutcome, StandTrial, run_pushed_stand
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

_BOUNDS = {"walk": 0.25, "bumps": 0.5, "stand": 0.5}
"""Largest step that is wanted, by the joint's limit."""

_PACE = (0.25, 0.0, 0.0)

_MET = 1e-6
"""Residual of contacts and joint limits up to which they are met."""

_ROUNDING = 1e-6
"""What a step may be over its bound."""

_SEEDS, _SECONDS, _QUICK_SECONDS = 20, 20.0, 6.0

_Outcome = LedOutcome | StandOutcome


def steps_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    seeds = options.count(_SEEDS, 1)
    seconds = _QUICK_SECONDS if options.quick else _SECONDS
    first = options.seed * _SEEDS
    walks: dict[tuple[str, str, bool], list[LedTrial]] = {}
    stands: dict[tuple[str, str, bool], list[StandTrial]] = {}
    for robot in ROBOTS:
        for bounded in (False, True):
            for kind, course in (("walk", ""), ("bumps", "bumps")):
                walks[robot, kind, bounded] = [
                    LedTrial(
                        robot=robot,
                        seed=first + i,
                        seconds=seconds,
                        velocity=_PACE,
                        course=course,
                        bounded=bounded,
                    )
                    for i in range(seeds)
                ]
            stands[robot, "stand", bounded] = [
                StandTrial(robot=robot, bounded=bounded, seed=first + i, seconds=seconds)
                for i in range(seeds)
            ]
    walking = [t for group in walks.values() for t in group]
    standing = [t for group in stands.values() for t in group]
    walked = run_each(run_led, LedOutcome, walking, progress, options)
    stood = run_each(run_pushed_stand, StandOutcome, standing, progress, options)
    groups: dict[tuple[str, str, bool], list[_Outcome]] = {}
    groups |= {key: [walked[t] for t in group] for key, group in walks.items()}
    groups |= {key: [stood[t] for t in group] for key, group in stands.items()}
    findings = [
        finding
        for (robot, kind, bounded), found in groups.items()
        if bounded
        for finding in _findings(robot, kind, found)
    ]
    return Section(
        prose=(
            "Robots are led at 0.25 m/s on the flat and over tiles of up to 20 mm that nobody told "
            "them of, and they stand for "
            f"{seconds:.0f} s while the torso is pushed every second by 0.1 m/s; all on the "
            "estimate, with noise and delay. A torque step is the change of a torque from tick to "
            "tick, 2 ms, over the joint's limit.",
        ),
        findings=tuple(findings),
        tables=(_table(groups),),
    )


def _findings(robot: str, kind: str, outcomes: Sequence[_Outcome]) -> list[Finding]:
    largest = max(o.torque_step for o in outcomes)
    found = [
        Finding(
            name=f"{robot}, {kind}: largest torque step",
            paper=_BOUNDS[kind],
            ours=largest,
            ok=largest <= _BOUNDS[kind] + _ROUNDING,
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


def _table(groups: dict[tuple[str, str, bool], list[_Outcome]]) -> Table:
    rows = [
        (
            robot,
            kind,
            "yes" if bounded else "no",
            f"{sum(o.fell for o in found)} of {len(found)}",
            f"{max(o.torque_step for o in found):.2f}",
            str(sum(o.torque_steps for o in found)),
            f"{max(o.worst_physics for o in found):.1e}",
        )
        for (robot, kind, bounded), found in groups.items()
    ]
    return Table(
        title="Torque steps",
        header="robot | run | bounded | falls | largest step | over half a limit | level 2",
        rows=tuple(rows),
        caption="With no bound on the change of torques, and with that of the default stacks.",
    )
