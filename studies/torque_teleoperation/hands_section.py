"""Hands led at random while a robot stands, steps and walks, one of them with a load."""

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from jaxtyping import Float64
from msgspec import structs

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, TeleopRun, run_teleop
from poise.control import WholeBodyController
from poise.dynamics import Dynamics, RobotState
from poise.estimation import PayloadEstimator, StateEstimator
from poise.locomotion import (
    Device,
    HandLeader,
    OperatorGuard,
    OperatorSample,
    ScriptedDevice,
    StepTeleoperator,
    Walker,
    WayPoint,
    walking_stack,
)
from poise.robots import Robot, load_robot
from poise.sim import Plant, PlantConfig, rollout
from studies.bad_operator.conditions import with_attitude
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.torque_teleoperation.random_hands import BEGINS, FASTEST, RandomHands, arm_length
from studies.trials import run_each

ROBOT = "g1"

DOINGS = ("standing", "stepping", "walking")
"""What the robot does meanwhile."""

_LOAD = 1.0
"""In the right hand, which the controller knows nothing of [kg]."""

_RATIO = 2.0
"""How many times as large as with resting arms the error of the COM may be."""

_ATTITUDE = math.radians(0.5)
"""Constant error of the attitude, in a direction drawn by the seed [rad]."""


class _Operator:
    """A device for the feet, and hands."""

    def __init__(self, feet: Device, hands: RandomHands | None) -> None:
        self._feet, self._hands = feet, hands

    def sample(self, time: float) -> OperatorSample | None:
        sample = self._feet.sample(time)
        if sample is None or self._hands is None:
            return sample
        return structs.replace(sample, hands=self._hands.hands(time))


class _Walk:
    """A leader that walks to and fro, and leads the hands."""

    def __init__(self, robot: Robot, trial: "Trial", dt: float) -> None:
        leader = HandLeader(robot, dt=dt)
        self.stack = walking_stack(robot, leader.task)
        self.walker, self._leader = Walker(robot, self.stack), leader
        self._guard = OperatorGuard(dt=dt)
        self._hands = (
            RandomHands(leader, arm_length(robot), dt, trial.seed) if trial.moving else None
        )
        self.errors: list[float] = []

    def lead(self, state: RobotState) -> None:
        """Another velocity every four seconds."""
        if self._hands is not None:
            hands = self._hands.hands(state.time)
            self._guard.check(OperatorSample(state.time, hands=hands), state.time)
            self._leader.lead(self._guard, state)
        self.walker.set_velocity(*_VELOCITIES[int(state.time / 4.0) % len(_VELOCITIES)])
        self.walker.lead(state)
        if state.time > BEGINS:
            self.errors.append(math.hypot(*self.walker.dcm_error))


_VELOCITIES = (
    (0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.0, 0.1, 0.0), (-0.2, 0.0, 0.0), (0.2, 0.0, 0.3),
    (0.0, -0.1, 0.0), (0.3, 0.0, -0.3),
)  # fmt: skip
"""Ahead [m/s], to the left [m/s], turning to the left [rad/s]."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What a worker is asked for.

    Attributes:
        doing: one of `DOINGS`.
        moving: whether hands are moved, the right one with a load; else arms rest, with nothing.
        seed: of hands and noise.
        seconds: [s].
    """

    doing: str
    moving: bool
    seed: int
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a trial.

    Attributes:
        trial: which.
        fell: whether the robot fell.
        seconds: how long it stood [s].
        error: of the COM, root of the mean square [m].
        tilt: largest angle of the torso, NaN where nobody asks [rad].
        lag: how far a hand is from where it is led to, median [m]; NaN where nobody asks.
    """

    trial: Trial
    fell: bool
    seconds: float
    error: float
    tilt: float
    lag: float


@cache
def _robot(name: str) -> Robot:
    return load_robot(name)


def _plant(trial: Trial) -> PlantConfig:
    plant = with_attitude(TORQUE_TELEOP_PLANT.with_noise(), _ATTITUDE, trial.seed)
    if not trial.moving:
        return plant
    load = PlantConfig.Payload(frame=_robot(ROBOT).hands[1], mass=_LOAD)
    return replace(plant, payloads=(load,))


def run_trial(trial: Trial) -> Outcome:
    """Runs a trial."""
    return _walk(trial) if trial.doing == "walking" else _stand_or_step(trial)


def _walk(trial: Trial) -> Outcome:
    robot, config = _robot(ROBOT), _plant(trial)
    plant, leader = Plant(robot, config, seed=trial.seed), _Walk(robot, trial, config.control_dt)
    plant.reset(None)
    controller = WholeBodyController(robot, leader.stack)
    # As in `poise drive`: what a hand holds is weighed while it walks.
    estimator = StateEstimator(robot, payload=PayloadEstimator(robot))
    for _ in rollout(plant, controller, leader, estimator=estimator, duration=trial.seconds):
        pass
    return Outcome(
        trial=trial,
        fell=plant.fallen,
        seconds=plant.time,
        error=float(np.sqrt(np.mean(np.square(leader.errors)))),
        tilt=math.nan,
        lag=math.nan,
    )


def _stand_or_step(trial: Trial) -> Outcome:
    robot, config = _robot(ROBOT), _plant(trial)

    def operator(teleoperator: StepTeleoperator) -> _Operator:
        points = _steps(trial.seconds) if trial.doing == "stepping" else []
        feet = ScriptedDevice(points, *teleoperator.estimator.anchors)
        hands = None
        if trial.moving:
            hands = RandomHands(
                teleoperator.hands, arm_length(robot), config.control_dt, trial.seed
            )
        return _Operator(feet, hands)

    run = run_teleop(robot, operator, config, duration=trial.seconds, seed=trial.seed)
    error, lag = _errors(run, robot)
    return Outcome(
        trial=trial,
        fell=run.fell,
        seconds=run.plant.time,
        error=error,
        tilt=float(run.log.tilt.max()),
        lag=lag,
    )


_LIFT = 0.08
"""How high a foot is lifted [m]."""


def _steps(seconds: float) -> list[WayPoint]:
    """Feet lifted in turn and put down where they were, one every two and a half seconds."""
    points: list[WayPoint] = []
    for k in range(int((seconds - BEGINS) / 2.5)):
        begin = BEGINS + 2.5 * k
        for at, height in ((0.0, 0.0), (0.1, 0.03), (0.5, _LIFT), (1.3, _LIFT), (1.8, 0.0)):
            offset = (0.0, 0.0, height)
            points.append(
                WayPoint(at=begin + at, left=offset)
                if k % 2
                else WayPoint(at=begin + at, right=offset)
            )
    return points


_EVERY = 20
"""Ticks from one that is looked at to the next."""

_CALM = 0.5
"""Time from a change of the mode, with which references jump, to what counts again [s]."""


def _errors(run: TeleopRun, robot: Robot) -> tuple[float, float]:
    """The true COM's distance from its reference, and a hand's from where it is led to [m].

    The reference is that of the ZMP, moved by what the estimated soles are off the true ones.
    """
    log, record, dynamics = run.log, run.record, Dynamics(robot)
    com = record["com"][np.isin(record.times("com"), record.times("zmp_reference"))]
    targets = [record[f"target/{hand}"] for hand in robot.hands]
    errors: list[float] = []
    lags: list[float] = []
    dt = run.plant.config.control_dt
    changed = np.flatnonzero(np.diff(log.mode, prepend=log.mode[0]))
    for k in range(int(BEGINS / dt), len(log), _EVERY):
        last = changed[changed <= k]
        if len(last) and (k - last[-1]) * dt < _CALM:
            continue
        dynamics.update(RobotState(log.q[k], np.zeros(robot.nv)))
        off = np.mean([_place(dynamics, robot, s) for s in robot.soles], axis=0)
        off = off - log.soles[k].mean(axis=0)
        errors.append(float(np.linalg.norm(com[k, :2] - log.zmp_reference[k] - off[:2])))
        lags += [
            float(np.linalg.norm(_place(dynamics, robot, hand) - off - target[k]))
            for hand, target in zip(robot.hands, targets, strict=True)
        ]
    return float(np.sqrt(np.mean(np.square(errors)))), float(np.median(lags))


def _place(dynamics: Dynamics, robot: Robot, frame: str) -> Float64[np.ndarray, "3"]:
    return dynamics.frame(robot.frame_id(frame)).position


def hands_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    seconds = 12.0 if options.quick else 300.0
    trials = [
        Trial(doing=doing, moving=moving, seed=options.seed, seconds=seconds)
        for doing in DOINGS
        for moving in (False, True)
    ]
    outcomes = run_each(run_trial, Outcome, trials, progress, options)
    pairs = [
        (outcomes[rest], outcomes[moved])
        for rest, moved in zip(trials[::2], trials[1::2], strict=True)
    ]
    return Section(
        prose=(
            f"{seconds:.0f} s each. Both devices are moved at random, at up to {FASTEST:g} m/s, "
            "through and beyond the workspace of the hands, and gripped anew every few seconds; "
            f"the right hand holds {_LOAD:g} kg that the controller knows nothing of. Beside it "
            "the same with arms that rest and hold nothing. Noise and half a degree of constant "
            "error of the attitude, as in the other parts; the base is estimated. Standing and "
            "stepping, the error is the true COM's distance from its reference, from half a second "
            "after that jumped on; walking, that of the divergent component as the controller "
            "sees it.",
        ),
        findings=tuple(_finding(rest, moved) for rest, moved in pairs),
        tables=(
            Table(
                title="Hands",
                header="robot | doing | hands | fell | seconds | COM off, RMS [m] | "
                "greatest lean [rad] | hand behind, median [m]",
                rows=tuple(_row(o) for pair in pairs for o in pair),
            ),
        ),
    )


def _finding(rest: Outcome, moved: Outcome) -> Finding:
    ratio = moved.error / rest.error
    return Finding(
        name=f"{ROBOT}, {moved.trial.doing}, hands moved: COM error over that of resting arms",
        paper=_RATIO,
        ours=round(ratio, 2),
        ok=not (moved.fell or rest.fell) and ratio <= _RATIO,
        note=f"{'a fall' if moved.fell else 'no fall'} in {moved.seconds:.0f} s",
    )


def _row(o: Outcome) -> tuple[str | int | float, ...]:
    hands = f"moved, {_LOAD:g} kg" if o.trial.moving else "at rest"
    fell = "yes" if o.fell else "no"
    return (ROBOT, o.trial.doing, hands, fell, o.seconds, o.error, o.tilt, o.lag)
