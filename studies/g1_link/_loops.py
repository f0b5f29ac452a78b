"""`loops`: deployments of a G1 in lock-step, with motors, noise, delays, loss and jitter."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import yaml

from poise.apps.deployment import FaultPlan, g1_gains
from poise.apps.scenarios import Scenario, load_scenario
from poise.hardware import Action
from poise.locomotion import StepTeleoperator
from poise.robots import Robot, load_robot
from poise.sim import HoistedPlant, PlantConfig
from studies.finding import Cell, Finding, Section, Table
from studies.g1_link._bus import ON_THE_WAY, Bus, g1_plant, stage_on, ticks_of
from studies.plan import Progress, StudyOptions
from studies.staged import episode, random_velocities
from studies.trial_section import run_each

_SECONDS, _QUICK = 300.0, 10.0
"""Length of a run, and with `--quick` [s]."""

_LOAD = 1.0
"""In each hand [kg]."""

CLEAN, LOSSY, IDEAL = "as it is", "1 % lost, 2 ms of jitter", "no motors, noise or faults"
"""Conditions."""

_PLANS = {
    CLEAN: ON_THE_WAY,
    LOSSY: replace(ON_THE_WAY, loss=0.01, jitter=2e-3),
    IDEAL: FaultPlan(),
}


@dataclass(frozen=True, kw_only=True)
class Loop:
    """One run."""

    motion: str  # a key of `MOTIONS`
    condition: str  # `CLEAN`, `LOSSY` or `IDEAL`
    seconds: float  # length [s]
    seed: int  # of noise, faults and commands


@dataclass(frozen=True, kw_only=True)
class Looped:
    """The end of a run."""

    fell: bool  # of the plant
    ended: str  # reasons of the watchdog for an end and of the last check
    seconds: float  # until the end, of the scenario alone [s]
    ticks: int  # periods in all
    missed: int  # in which no state arrived
    held: int  # in which the watchdog held the leader's targets
    refused: int  # commands
    wrong: int  # commands at the drives that failed the second check
    torque: float  # largest that was asked for, by its limit
    steps: int  # of the feet


def shipped(name: str, seconds: float, **values: Any) -> Scenario:
    """Return a shipped scenario of a G1 without its motions, pushes and checks.

    Args:
        name: of the scenario.
        seconds: its length [s].
        values: of further fields, as in files.
    """
    text = (files("poise.apps.scenarios") / "shipped" / f"{name}.yaml").read_text()
    data = yaml.safe_load(text)
    for key in ("motions", "pushes", "checks"):
        data.pop(key, None)
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.yaml"
        file.write_text(yaml.safe_dump({**data, "robot": "g1", "duration": seconds, **values}))
        return load_scenario(file)


def driven(velocities: list[dict[str, Any]], seconds: float, seed: int = 0) -> Scenario:
    """Return a scenario of a G1 that walks by velocities, those of `drive.velocities`."""
    begun = [command for command in velocities if command["at"] < seconds]
    return shipped("drive", seconds, seed=seed, drive={"velocities": begun})


def _stand(seconds: float, seed: int) -> Scenario:
    return shipped("stand", seconds, seed=seed)


def _squat(seconds: float, seed: int) -> Scenario:
    motions = [
        {"task": "com", "at": begin + at, "over": 2.0, "by": [0.0, 0.0, way]}
        for begin in np.arange(0.0, seconds - 5.0, 6.0).tolist()
        for at, way in ((0.5, -0.15), (3.0, 0.15))
    ]
    return shipped("squat", seconds, seed=seed, motions=motions)


def _arms(seconds: float, seed: int) -> Scenario:
    """Both hands go ahead and up, and back, one after the other: least jerk, 0.4 m/s at most."""
    motions = [
        {"task": hand, "at": begin + at + late, "over": 0.75, "by": by}
        for begin in np.arange(0.0, seconds - 4.0, 4.0).tolist()
        for late, hand in ((0.0, "left_hand"), (1.0, "right_hand"))
        for at, by in ((0.5, [0.1, 0.0, 0.12]), (1.5, [-0.1, 0.0, -0.12]))
    ]
    return shipped("stand", seconds, seed=seed, motions=motions)


def _walk(seconds: float, seed: int) -> Scenario:
    """There and back in 30 s, with a rest at both ends."""
    legs = (1.0, 0.3), (11.0, 0.0), (14.0, -0.3), (24.0, 0.0)
    begins = np.arange(0.0, seconds, 30.0).tolist()
    velocities = [{"at": b + at, "velocity": [pace, 0.0, 0.0]} for b in begins for at, pace in legs]
    return driven(velocities, seconds, seed)


def _random(seconds: float, seed: int) -> Scenario:
    return driven(random_velocities(seed, seconds), seconds, seed)


def _teleoperated(seconds: float, seed: int) -> Scenario:
    return episode("bad_operators", "as described", "g1", seed, seconds)


MOTIONS: dict[str, Callable[[float, int], Scenario]] = {
    "stand": _stand,
    "squat": _squat,
    "arms in motion, 1 kg in each hand": _arms,
    "walk there and back": _walk,
    "step teleoperation": _teleoperated,
    "random velocities": _random,
}
"""Makers of scenarios."""


def run_loop(trial: Loop) -> Looped:
    """Deploy a scenario in lock-step."""
    robot = load_g1()
    scenario = MOTIONS[trial.motion](trial.seconds, trial.seed)
    hands = robot.hands if MOTIONS[trial.motion] is _arms else ()
    loads = [PlantConfig.Payload(frame=hand, mass=_LOAD) for hand in hands]
    config = g1_plant(*loads, ideal=trial.condition == IDEAL)
    plant = HoistedPlant(robot, config, seed=trial.seed)
    bus = Bus(plant, g1_gains(robot).check, _PLANS[trial.condition], seed=trial.seed)
    stage = stage_on(bus, scenario, robot)
    body, leader = stage.plant.body, stage.leader  # type: ignore[attr-defined]
    by_hand = isinstance(getattr(leader, "_leader", None), StepTeleoperator)
    ticks, held, lifted, steps = 0, 0, False, 0
    for _ in ticks_of(stage, plant):
        ticks += 1
        held += body.verdict.response is Action.HOLD
        single = by_hand and body.time > body.begin and leader.mode.single
        steps += single and not lifted
        lifted = single
    return Looped(
        fell=plant.fallen,
        ended=" ".join(filter(None, (stage.plant.trouble, bus.reason))),
        seconds=body.time - body.begin,
        ticks=ticks,
        missed=bus.missed,
        held=held,
        refused=bus.refused,
        wrong=bus.wrong,
        torque=bus.largest,
        steps=steps if by_hand else getattr(leader.walker, "steps_made", 0),
    )


def loops_section(options: StudyOptions, progress: Progress) -> Section:
    """Run all motions on the bus as it is and with losses; without both what fell."""
    seconds = _QUICK if options.quick else _SECONDS
    trials = [
        Loop(motion=motion, condition=condition, seconds=seconds, seed=options.first_seed)
        for condition in (CLEAN, LOSSY)
        for motion in MOTIONS
    ]
    found = run_each(run_loop, Looped, trials, progress, options)
    fallen = [trial for trial in trials if found[trial].fell or found[trial].ended]
    again = list(dict.fromkeys(replace(trial, condition=IDEAL) for trial in fallen))
    ideal = run_each(run_loop, Looped, again, progress, options) if again else {}
    return Section(
        prose=(
            "A G1 hangs in a hoist, is lowered, and follows a scenario of `poise.apps.deployment` "
            "behind a bus in one process, with the motors of `MotorConfig.g1()`, noise of an "
            "inertial unit, states and commands rounded to float32 and 1 ms of delay in each "
            "direction; then once more with 1 % of messages lost both ways and states up to 2 ms "
            "later. What falls is run once more with ideal drives, sensors and bus.",
        ),
        findings=_findings(found, ideal),
        tables=(_table(found | ideal),),
    )


def _findings(found: dict[Loop, Looped], ideal: dict[Loop, Looped]) -> tuple[Finding, ...]:
    rows = list[Finding]()
    for condition in (CLEAN, LOSSY):
        group = {t: o for t, o in found.items() if t.condition == condition}
        falls = [t for t, o in group.items() if o.fell or o.ended]
        notes = [
            f"{t.motion} after {group[t].seconds:.1f} s ({group[t].ended or 'the plant fell'}), "
            f"{'also' if _failed(ideal[replace(t, condition=IDEAL)]) else 'not'} with {IDEAL}"
            for t in falls
        ]
        ticks = sum(o.ticks for o in group.values())
        missed = sum(o.missed for o in group.values())
        # The first state arrives in the second period.
        expected = len(group) if condition == CLEAN else None
        rows += [
            Finding(
                name=f"{condition}: falls and ends by the watchdog",
                ours=len(falls),
                paper=0,
                ok=not falls,
                note="; ".join((f"of {len(group)} runs", *notes)),
            ),
            Finding(
                name=f"{condition}: ticks without a new state",
                ours=100.0 * missed / ticks,
                paper=None if expected is None else 100.0 * expected / ticks,
                unit="%",
                ok=expected is None or missed <= expected,
                note=f"{missed} of {ticks}"
                + ("" if expected is None else "; the first of each run, which nothing precedes"),
            ),
            _zero(f"{condition}: commands that the last check refused", group, "refused"),
            _zero(f"{condition}: commands at the drives beyond limits", group, "wrong"),
            Finding(
                name=f"{condition}: largest torque asked for, by its limit",
                ours=max(o.torque for o in group.values()),
                ok=True,
                note="of ideal drives, with stiffness and damping; a motor has no more than one",
            ),
        ]
    return tuple(rows)


def _zero(name: str, group: dict[Loop, Looped], attribute: str) -> Finding:
    count = sum(getattr(o, attribute) for o in group.values())
    return Finding(name=name, ours=count, paper=0, ok=count == 0)


def _failed(outcome: Looped) -> bool:
    return outcome.fell or bool(outcome.ended)


def _table(found: dict[Loop, Looped]) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (
            t.motion,
            t.condition,
            o.seconds,
            o.ended or ("fell" if o.fell else "up"),
            o.steps,
            100.0 * o.missed / o.ticks,
            100.0 * o.held / o.ticks,
            o.refused,
            o.torque,
        )
        for t, o in found.items()
    ]
    return Table(
        title="Runs",
        header="motion | condition | time [s] | end | steps | no new state [%] | held [%] | "
        "refused | torque",
        rows=tuple(rows),
        caption="Torque is the largest that was asked for by its limit.",
    )


@cache
def load_g1() -> Robot:
    """Load a G1, once."""
    return load_robot("g1")
