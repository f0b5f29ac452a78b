"""Pushed walks with the walking stack's level softened and strict, and pushes while standing."""

import math
from dataclasses import dataclass

import numpy as np

from poise.control import WholeBodyController
from poise.locomotion import Walker, walking_stack
from poise.sim import Plant, PlantConfig, rollout
from poise.stack import Stack, default_stack
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.quiet.reach import robot_named
from studies.trials import run_each

ROBOTS = ("g1", "humanoid33")
SPEEDS, DIRECTIONS, DRAWS = (0.5, 0.6, 0.7), 8, 3
"""Changes of velocity of pushes on the torso [m/s], directions, and random moments of each."""

PERIOD, PUSH_TIME, LARGE = 2e-3, 0.08, 0.25
"""Control period and duration of a push [s]; a torque step that counts as large, over its limit."""

FEWER = 0.6
"""Most large torque steps, over those of a strict level."""

HELD, STANDING_DIRECTIONS = 0.32, 12
"""Push that a standing robot has to hold in every direction [m/s]."""

_WALK, _BEGIN, _SECONDS = 0.3, 0.5, 8.0


@dataclass(frozen=True, kw_only=True)
class Push:
    """One trial.

    Attributes:
        robot: its name.
        walks: whether it walks at 0.3 m/s, or stands on the default stack.
        softening: of the stack; its own when None.
        speed: change of velocity by the push [m/s].
        direction: of the push [rad].
        draw: which random moment.
    """

    robot: str
    walks: bool
    softening: float | None
    speed: float
    direction: float
    draw: int = 0


@dataclass(frozen=True, kw_only=True)
class Pushed:
    """Outcome of a trial.

    Attributes:
        fell: whether the robot fell.
        large: ticks with a large torque step.
    """

    fell: bool
    large: int


def run_push(trial: Push) -> Pushed:
    """Run one trial."""
    robot = robot_named(trial.robot)
    plain = walking_stack(robot) if trial.walks else default_stack(robot)
    stack = Stack(
        plain.contacts,
        plain.levels,
        torque_limit=plain.torque_limit,
        joint_limit=plain.joint_limit,
        softening=plain.softening if trial.softening is None else trial.softening,
    )
    plant = Plant(robot, PlantConfig(control_dt=PERIOD))
    walker = Walker(robot, stack) if trial.walks else None
    if walker is not None:
        walker.set_velocity(_WALK, 0.0, 0.0)
    rng = np.random.default_rng((trial.draw, round(1e3 * trial.direction)))
    moment = float(rng.uniform(3.0, 4.0)) if trial.walks else _BEGIN
    force = robot.mass * trial.speed / PUSH_TIME
    way = math.cos(trial.direction), math.sin(trial.direction)
    plant.push(robot.torso, (force * way[0], force * way[1], 0.0), PUSH_TIME, moment)
    controller, large, last = WholeBodyController(robot, stack), 0, np.zeros(robot.nj)
    duration = _SECONDS if trial.walks else 4.0
    for tick in rollout(plant, controller, walker, duration=duration):
        torque = tick.command.torque
        assert torque is not None
        if tick.time > _BEGIN / 2:
            large += bool((np.abs(torque - last) > LARGE * robot.tau_max).any())
        last = torque
    return Pushed(fell=plant.fallen, large=large)


def pushes_section(options: StudyOptions, progress: Progress) -> Section:
    """Push robots that walk, 72 times each with and without softening."""
    robots = ROBOTS[:1] if options.quick else ROBOTS
    draws, directions = options.count(DRAWS, 1), 2 if options.quick else DIRECTIONS
    trials = [
        Push(
            robot=robot,
            walks=True,
            softening=softening,
            speed=speed,
            direction=2.0 * math.pi * k / directions,
            draw=draw,
        )
        for robot in robots
        for softening in (0.0, None)
        for speed in SPEEDS[: 1 if options.quick else None]
        for k in range(directions)
        for draw in range(draws)
    ]
    outcomes = run_each(run_push, Pushed, trials, progress, options)
    findings, rows = list[Finding](), list[tuple[str, float, int, int, int, int]]()
    for robot in robots:
        own = {t: o for t, o in outcomes.items() if t.robot == robot}
        strict = [o for t, o in own.items() if t.softening == 0.0]
        soft = [o for t, o in own.items() if t.softening is None]
        falls = sum(o.fell for o in strict), sum(o.fell for o in soft)
        large = sum(o.large for o in strict), sum(o.large for o in soft)
        findings += [
            Finding(
                name=f"{robot}, pushed walks: large torque steps over those of a strict level",
                paper=FEWER,
                ours=round(large[1] / max(large[0], 1), 3),
                ok=large[1] <= FEWER * large[0],
                note=f"{large[1]} and {large[0]} ticks in {len(soft)} runs each",
            ),
            Finding(
                name=f"{robot}, pushed walks: falls",
                paper=falls[0],
                ours=falls[1],
                ok=falls[1] <= falls[0],
                note=f"of {len(soft)}, against {falls[0]} with a strict level",
            ),
        ]
        for speed in SPEEDS:
            at = [(t, o) for t, o in own.items() if t.speed == speed]
            one = [o for t, o in at if t.softening == 0.0]
            other = [o for t, o in at if t.softening is None]
            if one:
                counts = sum(o.fell for o in one), sum(o.fell for o in other)
                steps = sum(o.large for o in one), sum(o.large for o in other)
                rows.append((robot, speed, *counts, *steps))
    table = Table(
        title="Pushed walks",
        header="robot | push [m/s] | falls, strict | falls | large steps, strict | large steps",
        rows=tuple(rows),
    )
    return Section(findings=tuple(findings), tables=(table,))


def standing_section(options: StudyOptions, progress: Progress) -> Section:
    """Push G1 standing on its default stack in twelve directions."""
    directions = 3 if options.quick else STANDING_DIRECTIONS
    trials = [
        Push(
            robot="g1",
            walks=False,
            softening=None,
            speed=HELD,
            direction=2.0 * math.pi * k / directions,
        )
        for k in range(directions)
    ]
    outcomes = run_each(run_push, Pushed, trials, progress, options)
    stood = sum(not outcome.fell for outcome in outcomes.values())
    finding = Finding(
        name="g1, default stack: directions in which a standing push is held",
        paper=directions,
        ours=stood,
        ok=stood == directions,
        note=f"{HELD:g} m/s within {PUSH_TIME:g} s",
    )
    return Section(findings=(finding,))
