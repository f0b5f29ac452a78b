"""`faults`: random faults of bus, devices, computer and people, and the response to each."""

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from poise.apps.deployment import FaultPlan, g1_gains
from poise.control import CommandStatus
from poise.dynamics import RobotState
from poise.hardware import Action, MotorState
from poise.sim import Plant
from studies.finding import Cell, Finding, Section, Table
from studies.g1_link._bus import ON_THE_WAY, PERIOD, Bus, g1_plant, stage_on, ticks_of
from studies.g1_link._loops import driven, load_g1, shipped
from studies.plan import Progress, StudyOptions
from studies.trial_section import run_each

_COUNT, _QUICK = 300, 12
"""Number of faults, and with `--quick`."""

_BEGIN, _AFTER, _DAMPED = (1.0, 2.0), 2.0, 0.2
"""A fault begins in this interval, in which a walk makes three steps; it is looked at for so long,
and the robot that is damped [s]. From upright a robot falls in 1.3 s (`poise.hardware` LINGER)."""

_WAYS = {
    "loss": "share of messages, both ways: 0 to 1",
    "delay": "of states: 0 to 20 ms",
    "jitter": "of states: 0 to 20 ms",
    "reorder": "share of states: 0 to 1",
    "frozen": "encoder of a joint",
    "dead": "motor of a joint",
    "NaN": "in a state, at one number",
    "late": "controller: once, by 1 to 20 periods",
    "unsolved": "controller's fallback from then on",
    "stop": "emergency stop or Ctrl-C",
}
"""Kinds of faults; numbers are drawn evenly. The watchdog's limit of a state's age is 10 ms."""

_ALWAYS = ("NaN", "unsolved", "stop")
"""Kinds that have to be answered by damping."""

_LONGEST = 0.02
"""Largest delay [s]."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One run with a fault."""

    kind: str  # a key of `_WAYS`
    seed: int  # of everything random


@dataclass(frozen=True, kw_only=True)
class Response:
    """The end of a run with a fault."""

    walks: bool  # whether the robot walks, or stands
    action: str  # strongest of the watchdog: RUN, HOLD, DAMP or STOP
    reason: str  # of that action; "" without one
    wait: float  # from the fault to the first damping [s]; infinite without
    fell: bool  # without being damped
    wrong: int  # commands at the drives that failed the second check
    finite: bool  # whether all numbers of the plant are, at the end
    torque: float  # largest that was asked for, by its limit


class _Unsolved:
    """Controller whose solver has no answer from a time on."""

    def __init__(self, controller: Any) -> None:
        self._controller, self.fails = controller, False

    def step(self, state: RobotState) -> Any:
        if not self.fails:
            return self._controller.step(state)
        # A state that is not finite, the same fallback as where a solver fails.
        found = self._controller.step(replace(state, q=np.full_like(state.q, np.nan)))
        return found._replace(status=CommandStatus.SOLVER_FAILED)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._controller, name)


def run_fault(trial: Fault) -> Response:
    """Stand or walk, and have a fault."""
    robot, rng = load_g1(), np.random.default_rng([trial.seed, list(_WAYS).index(trial.kind)])
    begin, walks = float(rng.uniform(*_BEGIN)), bool(rng.random() < 0.5)
    seconds = begin + _AFTER
    scenario = driven([{"at": 0.2, "velocity": [0.3, 0.0, 0.0]}], seconds)
    plant = Plant(robot, g1_plant(), seed=trial.seed)
    plan = _plan(trial.kind, begin, robot.joint_names, rng)
    bus = Bus(plant, g1_gains(robot).check, plan, seed=trial.seed)
    stage = stage_on(bus, scenario if walks else shipped("stand", seconds), robot, ramp=0.0)
    controller = _Unsolved(stage.controller)
    body: Any = stage.plant.body  # type: ignore[attr-defined]
    strongest, reason, done = Action.RUN, "", False
    for _ in ticks_of(replace(stage, controller=controller), plant):
        verdict = body.verdict
        if verdict.response > strongest:
            strongest, reason = verdict.response, verdict.reason
        if plant.time >= begin and not done:
            done = True
            _strike(trial.kind, bus, body, controller, rng)
    wait = plant.time - begin if strongest >= Action.DAMP else np.inf
    fell = plant.fallen and strongest < Action.DAMP
    for _ in range(round(_DAMPED / PERIOD) if strongest >= Action.DAMP else 0):
        bus.write(bus.check.damping)
    return Response(
        walks=walks,
        action=strongest.name,
        reason=reason,
        wait=wait,
        fell=fell,
        wrong=bus.wrong,
        finite=bool(np.isfinite([*plant.data.qpos, *plant.data.qvel]).all()),
        torque=bus.largest,
    )


def _plan(kind: str, begin: float, joints: tuple[str, ...], rng: np.random.Generator) -> FaultPlan:
    size, joint = float(rng.random()), joints[int(rng.integers(len(joints)))]
    values: dict[str, Any] = {
        "loss": {"loss": size},
        "delay": {"delay": ON_THE_WAY.delay + _LONGEST * size},
        "jitter": {"jitter": _LONGEST * size},
        "reorder": {"reorder": size},
        "frozen": {"frozen": (joint,)},
        "dead": {"dead": (joint,)},
    }
    return replace(ON_THE_WAY, begin=begin, **values.get(kind, {}))


def _strike(
    kind: str, bus: Bus, body: Any, controller: _Unsolved, rng: np.random.Generator
) -> None:
    if kind == "NaN":
        name = str(rng.choice(["q", "dq", "quaternion", "gyro", "acceleration"]))

        def spoil(state: MotorState) -> MotorState:
            values = getattr(state, name).copy()
            values[rng.integers(len(values))] = rng.choice([np.nan, np.inf])
            return replace(state, **{name: values})

        bus.change = spoil
    elif kind == "late":
        bus.stall(int(rng.integers(1, 21)))
    elif kind == "unsolved":
        controller.fails = True
    elif kind == "stop":
        body.watchdog.stop()


def faults_section(options: StudyOptions, progress: Progress) -> Section:
    """Run random faults of all kinds."""
    kinds = list(_WAYS)
    trials = [
        Fault(kind=kinds[k % len(kinds)], seed=options.first_seed + k // len(kinds))
        for k in range(_QUICK if options.quick else _COUNT)
    ]
    found = run_each(run_fault, Response, trials, progress, options)
    return Section(
        prose=(
            "A G1 stands, or walks at 0.3 m/s, with motors, noise and a bus in lock-step, and one "
            "fault begins. What reaches the drives is checked once more, by other code than the "
            "last check.",
        ),
        findings=_findings(found),
        tables=(_table(found),),
    )


def _findings(found: dict[Fault, Response]) -> tuple[Finding, ...]:
    wrong = sum(o.wrong for o in found.values())
    burst = sum(not o.finite for o in found.values())
    count = len(found)
    sure = [
        Finding(
            name="commands at the drives that are not finite or beyond a limit",
            ours=wrong,
            paper=0,
            ok=wrong == 0,
            note=f"in {count} runs",
        ),
        Finding(name="runs that end in NaN", ours=burst, paper=0, ok=burst == 0),
    ]
    for kind in _ALWAYS:
        group = [o for t, o in found.items() if t.kind == kind]
        missing = sum(o.action != "DAMP" for o in group)
        name = f"{kind}: runs that are not damped"
        sure.append(
            Finding(name=name, ours=missing, paper=0, ok=missing == 0, note=f"of {len(group)}")
        )
    fell = sum(o.fell for o in found.values())
    sure.append(
        Finding(
            name="falls that the watchdog did not damp before the plant counted them",
            ours=fell,
            ok=True,
            note=f"of {count} runs; reported, not judged: a dead motor or a false encoder is no "
            "trouble that the watchdog has a rule for, until the robot tilts",
        )
    )
    return tuple(sure)


def _table(found: dict[Fault, Response]) -> Table:
    rows = list[tuple[Cell, ...]]()
    for kind, what in _WAYS.items():
        group = [o for t, o in found.items() if t.kind == kind]
        actions = Counter(o.action for o in group)
        waits = [1e3 * o.wait for o in group if o.wait < np.inf]
        reasons = Counter(o.reason.split(":")[0] for o in group if o.reason)
        rows.append(
            (
                kind,
                what,
                sum(o.action == "RUN" and not o.fell for o in group),
                actions["HOLD"],
                actions["DAMP"] + actions["STOP"],
                sum(o.fell for o in group),
                float(np.median(waits)) if waits else None,
                ", ".join(f"{reason} ({n})" for reason, n in reasons.most_common(3)),
            )
        )
    return Table(
        title="Responses",
        header="fault | size | none | held | damped | fell undamped | median to damping [ms] | "
        "troubles",
        rows=tuple(rows),
        caption="The strongest response of a run; a held one may also have fallen.",
    )
