"""Random targets, in and out of reach: the motion that is left once they are at rest."""

from collections.abc import Sequence

import numpy as np

from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.quiet.reach import Reach, Rest, random_moves, run_reach
from studies.trials import run_each

ROBOTS = ("g1", "humanoid33", "talos", "panda", "upper17")
BOUNDS = {
    "whole_body": (0.02, 0.1),
    "reduced": (0.02, 0.1),
    "osf": (0.05, 0.2),
    "differential_ik": (0.02, np.inf),
}
"""Largest step of a command over its limit, and largest joint speed [rad/s], by controller."""

SHARE = 0.97
"""Least share of the runs that has to come to rest."""

HELD_BY_SENSORS = 3.0
"""Largest step and speed, over those of the same robot standing with the same sensors."""

NEAR, LATER = 1e-6, 1.05
"""Largest change of a reached target's final error [m], and of the time to 1 mm, relative."""

_PUSH = 0.05
"""Steady force on the torso, over the weight: half of what takes the ZMP to the edge of a sole."""


def targets_section(options: StudyOptions, progress: Progress) -> Section:
    """Run 40 targets per robot and controller, exact states."""
    count = options.count(40, 2)
    robots = ROBOTS[:1] if options.quick else ROBOTS
    trials = [
        Reach(robot=robot, controller=controller, moves=moves)
        for robot in robots
        for controller in BOUNDS
        for moves in random_moves(robot, count, options.first_seed)
    ]
    trials += [
        Reach(robot=robot, controller=controller, moves=(("com", (0.0, 0.0, 0.0)),), push=_PUSH)
        for robot in robots
        if robot in ("g1", "humanoid33")
        for controller in ("whole_body", "reduced")
    ]
    rests = run_each(run_reach, Rest, trials, progress, options)
    findings: list[Finding] = []
    for controller, (step, speed) in BOUNDS.items():
        own = [rest for trial, rest in rests.items() if trial.controller == controller]
        quiet = [rest.step <= step and rest.speed <= speed and not rest.fell for rest in own]
        share = float(np.mean(quiet))
        findings.append(
            Finding(
                name=f"{controller}: share of runs at rest",
                paper=SHARE,
                ours=round(share, 4),
                ok=share >= SHARE,
                note=f"of {len(own)} runs; command step at most {step:g} of the limit per tick, "
                f"joint speed at most {speed:g} rad/s, in the last second of 5 s",
            )
        )
    return Section(
        prose=(
            "Targets of the CoM and of the hands are displaced at random by 0.1 to 0.5 m, those "
            "of arms by up to 1 m, within 2 s, and rest. One run of each humanoid has a steady "
            "push of 5% of its weight on the torso in their place.",
        ),
        findings=tuple(findings),
        tables=(_table(rests),),
    )


def unlimited_section(options: StudyOptions, progress: Progress) -> Section:
    """Run the same without the torques' rate limit."""
    count = options.count(40, 2)
    robots = ROBOTS[:1] if options.quick else ROBOTS
    trials = [
        Reach(robot=robot, moves=moves, rate_limited=False)
        for robot in robots
        for moves in random_moves(robot, count, options.first_seed)
    ]
    rests = run_each(run_reach, Rest, trials, progress, options)
    step, speed = BOUNDS["whole_body"]
    share = _share(list(rests.values()), step, speed)
    finding = Finding(
        name="whole_body without a rate limit of torques: share of runs at rest",
        paper=SHARE,
        ours=round(share, 4),
        ok=share >= SHARE,
        note=f"of {len(rests)} runs; bounds as with the rate limit",
    )
    return Section(findings=(finding,), tables=(_table(rests),))


def sensed_section(options: StudyOptions, progress: Progress) -> Section:
    """Run targets with noisy sensors and the estimator, against standing with the same sensors."""
    count = options.count(20, 1)
    robots = ("g1",) if options.quick else ("g1", "humanoid33")
    trials = [Reach(robot=robot, sensed=True) for robot in robots]
    trials += [
        Reach(robot=robot, moves=moves, sensed=True)
        for robot in robots
        for moves in random_moves(robot, count, options.first_seed)
    ]
    rests = run_each(run_reach, Rest, trials, progress, options)
    findings: list[Finding] = []
    for robot in robots:
        home = rests[Reach(robot=robot, sensed=True)]
        own = [rest for trial, rest in rests.items() if trial.robot == robot and trial.moves]
        bounds = HELD_BY_SENSORS * home.step, HELD_BY_SENSORS * home.speed
        share = _share(own, *bounds)
        findings.append(
            Finding(
                name=f"{robot}, sensors with noise: share of runs within 3 times standing",
                paper=SHARE,
                ours=round(share, 4),
                ok=share >= SHARE,
                note=f"of {len(own)} runs; command step at most {bounds[0]:.3g} of the limit, "
                f"joint speed at most {bounds[1]:.3g} rad/s",
            )
        )
    return Section(findings=tuple(findings), tables=(_table(rests),))


def reached_section(options: StudyOptions, progress: Progress) -> Section:
    """Compare targets that strict levels reach with the same under softening."""
    count = options.count(40, 2)
    robots = ROBOTS[:1] if options.quick else ROBOTS
    pairs = [
        (
            Reach(robot=robot, moves=moves, softening=0.0),
            Reach(robot=robot, moves=moves),
        )
        for robot in robots
        for moves in random_moves(robot, count, options.first_seed)
    ]
    trials = [trial for pair in pairs for trial in pair]
    rests = run_each(run_reach, Rest, trials, progress, options)
    same, in_time, rows, reached = 0, 0, list[tuple[str, str, float, float, float, float]](), 0
    for strict, soft in pairs:
        before, after = rests[strict], rests[soft]
        if not np.isfinite(before.to_1mm) or before.fell:
            continue
        reached += 1
        near = abs(after.error - before.error) <= NEAR
        # From the beginning of the targets' motion, so that zero is no unit.
        total = 2.0 + before.to_1mm, 2.0 + after.to_1mm
        early = total[1] <= LATER * total[0]
        same, in_time = same + near, in_time + early
        if not (near and early):
            figures = 1e3 * before.error, 1e3 * after.error, before.to_1mm, after.to_1mm
            rows.append((strict.robot, _words(strict), *figures))
    share = (same / reached, in_time / reached) if reached else (0.0, 0.0)
    findings = (
        Finding(
            name="reached targets with the same final error",
            paper=SHARE,
            ours=round(share[0], 4),
            ok=share[0] >= SHARE,
            note=f"of {reached} targets that strict levels reach to 1 mm; within {NEAR:g} m",
        ),
        Finding(
            name="reached targets as soon as before",
            paper=SHARE,
            ours=round(share[1], 4),
            ok=share[1] >= SHARE,
            note=f"time from the beginning of the motion to 1 mm at most {LATER:g} of before",
        ),
    )
    table = Table(
        title="Targets that are reached otherwise",
        header="robot | target [m] | error, strict [mm] | error [mm] | to 1 mm, strict [s] | "
        "to 1 mm [s]",
        rows=tuple(rows),
    )
    return Section(findings=findings, tables=(table,) if rows else ())


def collision_section(options: StudyOptions, progress: Progress) -> Section:
    """Lead hands into each other and into the trunk."""
    heights = {"g1": 0.85, "humanoid33": 1.2}
    robots = ("g1",) if options.quick else tuple(heights)
    trials = [
        Reach(robot=robot, moves=moves, goals=True, collisions=True)
        for robot in robots
        for moves in _collisions(heights[robot])
    ]
    rests = run_each(run_reach, Rest, trials, progress, options)
    step, speed = BOUNDS["whole_body"]
    share = _share(list(rests.values()), step, speed)
    finding = Finding(
        name="hands led into each other and into the trunk: share of runs at rest",
        paper=SHARE,
        ours=round(share, 4),
        ok=share >= SHARE,
        note=f"of {len(rests)} runs; command step at most {step:g}, joint speed {speed:g} rad/s",
    )
    return Section(findings=(finding,), tables=(_table(rests),))


def _collisions(height: float) -> list[tuple[tuple[str, tuple[float, float, float]], ...]]:
    left, right = "left_hand pose", "right_hand pose"
    ahead, inside = (0.25, 0.0, height), (0.0, 0.0, height)
    return [
        ((left, ahead), (right, ahead)),
        ((left, inside),),
        ((right, inside),),
        ((left, (0.15, -0.3, height)), (right, (0.15, 0.3, height))),
    ]


def _share(rests: Sequence[Rest], step: float, speed: float) -> float:
    return float(np.mean([r.step <= step and r.speed <= speed and not r.fell for r in rests]))


def _words(trial: Reach) -> str:
    if trial.push:
        return f"push of {trial.push:g} of the weight"
    return "; ".join(f"{name} {np.round(way, 2).tolist()}" for name, way in trial.moves) or "home"


def _table(rests: dict[Reach, Rest]) -> Table:
    worst = sorted(rests.items(), key=lambda item: -max(item[1].step / 0.02, item[1].speed / 0.1))
    return Table(
        title="Runs with most motion left",
        header="robot | controller | target [m] | command step | joint speed [rad/s] | error [mm]",
        rows=tuple(
            (t.robot, t.controller, _words(t), r.step, r.speed, 1e3 * r.error)
            for t, r in worst[:20]
        ),
    )
