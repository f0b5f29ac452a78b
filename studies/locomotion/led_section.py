"""Walking that is led by velocities: how fast, how hard a push, how long without a fall."""

import math
from collections.abc import Sequence

import numpy as np

from studies.finding import Finding, Section, Table
from studies.locomotion.courses import Velocity
from studies.locomotion.led_walk import LedOutcome, LedTrial, run_led
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

ROBOTS = ("humanoid33", "g1")

_SPEEDS: tuple[tuple[str, Velocity, float, str], ...] = (
    ("ahead", (0.62, 0.0, 0.0), 0.6, "m/s"),
    ("sideways", (0.0, 0.28, 0.0), 0.25, "m/s"),
    ("turning", (0.0, 0.0, 0.7), 0.6, "rad/s"),
)
"""What is asked for, and the least that has to be reached."""

_PUSHES = {"walking": 0.4, "standing": 0.6}
"""Pushes that are to be survived while walking and while standing [m/s]."""

_PACE = (0.3, 0.0, 0.0)
"""Steps of some 0.15 m."""

_DIRECTIONS = 12
_SEEDS, _QUICK_SEEDS = 20, 1
_WANDER, _QUICK_WANDER = 600.0, 30.0
"""How long random velocities are followed [s]."""


def led_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    seeds = range(options.count(_SEEDS, _QUICK_SEEDS))
    first = options.seed * _SEEDS
    groups: dict[str, list[LedTrial]] = {}
    for robot in ROBOTS:
        for name, velocity, _, _ in _SPEEDS:
            groups[f"{robot}: {name}"] = [
                LedTrial(robot=robot, seed=first + i, seconds=7.0, velocity=velocity) for i in seeds
            ]
        for name, push in _PUSHES.items():
            groups[f"{robot}: {name}"] = [
                _pushed(robot, first + i, k, name, push)
                for i in seeds
                for k in range(0, _DIRECTIONS, 3 if options.quick else 1)
            ]
        seconds = _QUICK_WANDER if options.quick else _WANDER
        groups[f"{robot}: wandering"] = [
            LedTrial(robot=robot, seed=first + i, seconds=seconds, velocity=None)
            for i in (seeds if options.quick else range(1))
        ]
    trials = [t for group in groups.values() for t in group]
    outcomes = run_each(run_led, LedOutcome, trials, progress, options)
    found = {name: [outcomes[t] for t in group] for name, group in groups.items()}
    findings = [f for robot in ROBOTS for f in _findings(robot, found)]
    return Section(
        prose=(
            "A robot is led by velocities, and its steps are made while it walks. Pushes on the "
            "torso take 0.08 s; while walking their moment is drawn over two steps. Back at rest "
            "is a robot that stands with its feet side by side 3 s after the push.",
        ),
        findings=tuple(findings),
        tables=(_directions(found), _table(found)),
    )


def _pushed(robot: str, seed: int, direction: int, name: str, push: float) -> LedTrial:
    walking = name == "walking"
    moment = np.random.default_rng((seed, direction)).uniform(3.0, 4.1) if walking else 1.5
    return LedTrial(
        robot=robot,
        seed=seed,
        seconds=float(moment) + 3.1,
        velocity=_PACE if walking else (0.0, 0.0, 0.0),
        push=push,
        direction=2.0 * math.pi * direction / _DIRECTIONS,
        at=float(moment),
    )


def _findings(robot: str, found: dict[str, list[LedOutcome]]) -> list[Finding]:
    findings: list[Finding] = []
    for axis, (name, _, least, unit) in enumerate(_SPEEDS):
        group = found[f"{robot}: {name}"]
        reached = min(0.0 if o.fell else o.reached[axis] for o in group)
        findings.append(
            Finding(
                name=f"{robot}: speed {name}",
                paper=least,
                ours=reached,
                unit=unit,
                ok=bool(reached >= least),
                note=f"at least; worst of {len(group)} seeds, nothing where it fell",
            )
        )
    for name, push in _PUSHES.items():
        group = found[f"{robot}: {name}"]
        held = _held(name, group)
        weakest = min(_share(group, held, k) for k in {o.trial.direction for o in group})
        findings.append(
            Finding(
                name=f"{robot}: pushes of {push:g} m/s {name}, weakest direction",
                paper=95.0,
                ours=weakest,
                unit="%",
                ok=bool(weakest >= 95.0),
                note=f"survived, at least; {_counted(sum(held), len(held))} in all directions",
            )
        )
    group = found[f"{robot}: wandering"]
    falls = sum(o.fell for o in group)
    seconds = sum(o.trial.seconds for o in group)
    findings.append(
        Finding(
            name=f"{robot}: falls under random velocities",
            paper=1,
            ours=falls,
            ok=falls <= 1,
            note=f"at most; {seconds:.0f} s, {sum(o.steps for o in group)} steps, flat ground",
        )
    )
    return findings


def _share(group: Sequence[LedOutcome], held: Sequence[bool], direction: float) -> float:
    """What part was survived in a direction [%]."""
    chosen = [h for o, h in zip(group, held, strict=True) if o.trial.direction == direction]
    return 100.0 * sum(chosen) / len(chosen)


def _held(name: str, group: Sequence[LedOutcome]) -> list[bool]:
    """Which pushes were survived; standing, by a robot that is back at rest."""
    return [not o.fell and (o.rested or name == "walking") for o in group]


def _counted(held: int, count: int) -> str:
    """A count with Wilson's interval of 95% for its share."""
    z = 1.96
    share, spread = held / count, z * z / count
    middle = (share + 0.5 * spread) / (1.0 + spread)
    half = z * math.sqrt(share * (1.0 - share) / count + 0.25 * spread / count) / (1.0 + spread)
    return f"{held} of {count} ({100.0 * (middle - half):.0f} to {100.0 * (middle + half):.0f}%)"


def _directions(found: dict[str, list[LedOutcome]]) -> Table:
    """Pushes by their direction."""
    rows: list[tuple[str | float, ...]] = []
    for name in (f"{robot}: {name}" for robot in ROBOTS for name in _PUSHES):
        group, held = found[name], _held(name.rsplit(maxsplit=1)[1], found[name])
        for direction in sorted({o.trial.direction for o in group}):
            chosen = [h for o, h in zip(group, held, strict=True) if o.trial.direction == direction]
            degrees = round(math.degrees(direction))
            rows.append((name, degrees, _counted(sum(chosen), len(chosen))))
    return Table(
        title="Pushes by direction",
        header="robot and case | push from ahead to the left [deg] | survived",
        rows=tuple(rows),
        caption="In brackets Wilson's interval of 95%. Standing, back at rest within 3 s.",
    )


def _table(found: dict[str, list[LedOutcome]]) -> Table:
    rows: list[tuple[str | float, ...]] = []
    for name, group in found.items():
        for o in group:
            degrees = round(math.degrees(o.trial.direction))
            rows.append(
                (name, o.trial.seed, degrees, "yes" if o.fell else "no", o.steps, *o.reached)
            )
    return Table(
        title="Runs that were led",
        header="robot and case | seed | push from ahead to the left [deg] | fell | steps | "
        "ahead [m/s] | left [m/s] | turn [rad/s]",
        rows=tuple(rows),
        caption="Velocities are means from 3 s on.",
    )
