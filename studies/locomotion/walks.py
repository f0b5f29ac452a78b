"""Sections of walks: by commands, on unknown ground, on the estimate; and pushes without a step."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.stats import chi2

from poise.control import WholeBodyController
from poise.locomotion import walking_stack
from poise.robots import Robot, load_robot
from poise.sim import Plant, PlantConfig, rollout
from poise.stack import Stack, default_stack
from studies.locomotion import estimated_walk
from studies.locomotion.courses import COURSES, Velocity
from studies.locomotion.estimated_walk import NO_CELLS
from studies.locomotion.late_estimate import PERIOD, LateEstimate, typical_sensors
from studies.locomotion.led_walk import PUSH_TIME, LedOutcome, LedTrial, run_led
from studies.plan import StudyOptions
from studies.trial_section import Bound, Case, TrialSection, none, part, total, worst

ROBOTS = ("humanoid33", "g1")

_SPEEDS: tuple[tuple[str, Velocity, float, str], ...] = (
    ("ahead", (0.62, 0.0, 0.0), 0.6, "m/s"),
    ("sideways", (0.0, 0.28, 0.0), 0.25, "m/s"),
    ("turning", (0.0, 0.0, 0.7), 0.6, "rad/s"),
)
"""Direction, commanded velocity, the least that has to be reached, and its unit."""

_PUSHES = {"walking": 0.4, "standing": 0.6}
"""Pushes that are to be survived while walking and while standing [m/s]."""

_PACE, _SLOW_PACE = (0.3, 0.0, 0.0), (0.25, 0.0, 0.0)
_DIRECTIONS, _SEEDS = 12, 20
_SURVIVED = part(0.05)
"""Share of pushes in each direction, and of runs on each course, that may end with a fall."""


def _seeds(options: StudyOptions, full: int = _SEEDS, quick: int = 1) -> list[int]:
    return [options.seed * _SEEDS + i for i in range(options.count(full, quick))]


def _one_fall(_outcomes: Sequence[LedOutcome]) -> float:
    return 1.0


def _led_cases(options: StudyOptions) -> list[Case]:
    seeds, cases = _seeds(options), list[Case]()
    for robot in ROBOTS:
        for axis, (name, velocity, least, unit) in enumerate(_SPEEDS):
            cases.append(
                Case(
                    name=f"{robot}: {name}",
                    trials=[
                        LedTrial(robot=robot, seed=seed, seconds=7.0, velocity=velocity)
                        for seed in seeds
                    ],
                    failed=lambda o, axis=axis, least=least: o.fell or o.reached[axis] < least,
                    what=f"falls, or less than {least:g} {unit},",
                )
            )
        for name, push in _PUSHES.items():
            for k in range(0, _DIRECTIONS, 3 if options.quick else 1):
                degrees = 360 * k // _DIRECTIONS
                cases.append(
                    Case(
                        name=f"{robot}: pushed by {push:g} m/s {name}, {degrees} degrees",
                        trials=[_pushed(robot, seed, k, name, push) for seed in seeds],
                        allowed=_SURVIVED,
                        failed=lambda o, name=name: o.fell or not (o.rested or name == "walking"),
                        what="falls, or no rest,",
                    )
                )
        seconds = 30.0 if options.quick else 600.0
        wanders = seeds[:1]
        cases.append(
            Case(
                name=f"{robot}: random velocities for {seconds:g} s",
                trials=[
                    LedTrial(robot=robot, seed=seed, seconds=seconds, velocity=None)
                    for seed in wanders
                ],
                allowed=_one_fall,
            )
        )
    return cases


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


_WALK_COLUMNS = {
    "steps": total("steps"),
    "ahead, left, turn, mean [m/s, rad/s]": lambda group: ", ".join(
        f"{x:.2f}" for x in np.mean([o.reached for o in group], axis=0)
    ),
    "torque step, most, by the limit": worst("torque_step"),
}

led_section = TrialSection(
    title="Walks by commanded velocities",
    prose=(
        "Steps are made while the robot walks. Pushes on the torso take 0.08 s, from ahead to the "
        "left; while walking their moment is drawn over two steps. At rest is a robot that stands "
        "with its feet side by side 3 s after the push. Velocities count from 3 s on.",
    ),
    run=run_led,
    kind=LedOutcome,
    cases=_led_cases,
    columns=_WALK_COLUMNS,
)
"""The section of walks by commanded velocities."""

_FLAT, _WANDERING = "flat ground", "wandering"

_STEPS = {_FLAT: 0.25, "bumps": 0.5 + 1e-6}
"""Largest change of a torque from tick to tick that is wanted, by its limit."""

_MET = 1e-6
"""Residual of contacts and joint limits up to which they are met, on flat ground."""


def _ground_cases(options: StudyOptions) -> list[Case]:
    cases: list[Case] = []
    for robot, course in product(ROBOTS, (_FLAT, *COURSES)):
        seeds = _seeds(options, 10 if course == _WANDERING else _SEEDS)
        bounds: tuple[Bound, ...] = ()
        if course in _STEPS:
            bounds = (Bound(name="torque step", value=worst("torque_step"), most=_STEPS[course]),)
        if course == _FLAT:
            value = worst("worst_physics")
            bounds += (Bound(name="residual of level 2", value=value, most=_MET),)
        trials = [
            LedTrial(
                robot=robot,
                seed=seed,
                seconds=6.0 if options.quick else 20.0,
                velocity=_SLOW_PACE,
                course="" if course == _FLAT else course,
            )
            for seed in seeds
        ]
        allowed = _one_fall if course == _WANDERING else _SURVIVED
        cases.append(Case(name=f"{robot}: {course}", trials=trials, allowed=allowed, bounds=bounds))
    return cases


ground_section = TrialSection(
    title="Walks on ground that is not in the model",
    prose=(
        "Robots are led at 0.25 m/s, or 0.15 m/s sideways, onto ramps of 8 degrees with level "
        "ground before and behind, tiles of up to 20 mm, a step of 50 mm down. Or the ground is "
        "more slippery than the contacts of the stack say, 0.3 against 0.6, the robot is lighter "
        "or heavier than described by a fifth, or all sensors are 20 ms late. Wandering is a "
        "minute of random velocities with tiles on a third of the floor.",
    ),
    run=run_led,
    kind=LedOutcome,
    cases=_ground_cases,
    columns=_WALK_COLUMNS,
)
"""The section of walks on unknown ground."""

_VELOCITY, _TILT, _DRIFT = 0.05, 0.5, 2.0
"""Bounds of the estimate: rms errors of velocity [m/s] and tilt [deg], drift over the way [%]."""

_OBSERVED, _CONFIDENCE = 5, 0.99
"""Degrees of freedom of tilt and velocity; the mean NEES of as many seeds exceeds its bound in one
study of a hundred, where the filter is consistent."""

_SLIPPERY = 0.35
"""Friction of a floor on which feet slip before the robot falls."""


def _mean_nees(outcomes: Sequence[estimated_walk.Outcome]) -> float:
    return float(np.mean([outcome.nees for outcome in outcomes]))


def _estimation_cases(options: StudyOptions) -> list[Case]:
    seconds, seeds = 20.0 if options.quick else 60.0, _seeds(options)
    consistent = float(chi2.ppf(_CONFIDENCE, _OBSERVED * len(seeds)) / len(seeds))
    velocity = Bound(
        name="velocity error, rms", value=worst("velocity_rms"), most=_VELOCITY, unit="m/s"
    )
    bounds = (
        velocity,
        Bound(
            name="tilt error, rms",
            value=worst("tilt_rms", 180.0 / math.pi),
            most=_TILT,
            unit="deg",
        ),
        Bound(name="drift over the way", value=worst("drift", 100.0), most=_DRIFT, unit="%"),
        Bound(
            name="NEES of tilt and velocity",
            value=_mean_nees,
            most=consistent,
            note="mean; 5 is consistent",
        ),
    )
    plain = [
        Case(
            name=robot,
            trials=[estimated_walk.Trial(robot=robot, seed=s, seconds=seconds) for s in seeds],
            bounds=bounds,
        )
        for robot in ROBOTS
    ]

    def hard(name: str, allowed: Callable[..., float] | None, **changes: float | str) -> Case:
        trials = [
            estimated_walk.Trial(robot=robot, seed=seeds[0], seconds=seconds, **changes)  # type: ignore[arg-type]
            for robot in ROBOTS
        ]
        return Case(name=name, trials=trials, allowed=allowed, bounds=(velocity,))

    # On less friction than the controller believes in robots fall with true states, too.
    return [
        *plain,
        hard("a slippery floor", None, friction=_SLIPPERY),
        *(hard(f"cells: {cells}", none, cells=cells) for cells in ("stuck", "zero", NO_CELLS)),
    ]


estimation_section = TrialSection(
    title="Estimates on walks",
    prose=(
        "Straight walks in steps of 0.15 m; seeds draw noise and biases. Errors are against the "
        "truth of the moment that the sensors measured. NEES is the error of tilt and velocity, "
        "squared and normalised by the filter's own covariance: its mean is 5 for a consistent "
        "filter, more for one that believes too much, less for a careful one.",
    ),
    run=estimated_walk.run_trial,
    kind=estimated_walk.Outcome,
    cases=_estimation_cases,
    columns={
        "way [m]": total("way"),
        "velocity error, rms, worst [mm/s]": worst("velocity_rms", 1e3),
        "tilt error, rms, worst [deg]": worst("tilt_rms", 180.0 / math.pi),
        "drift, worst [%]": worst("drift", 100.0),
        "height error, worst [mm]": worst("height", 1e3),
        "NEES, mean": _mean_nees,
    },
)
"""The section of the estimate on walks."""

STACKS: Mapping[str, Callable[[Robot], Stack]] = {
    "default_stack": default_stack,
    "walking_stack": walking_stack,
}
"""Stacks of robots that are pushed and make no step."""

_PUSH, _MORE = 0.33, (0.36, 0.40)
"""Push that the pendulum with the feet of G1 withstands at most, and pushes beyond it [m/s]."""


@dataclass(frozen=True, kw_only=True)
class StandingPush:
    """A push on G1, which makes no step.

    Attributes:
        stack: of `STACKS`.
        seed: of noise and biases.
        push: change of the robot's velocity [m/s].
        direction: of the push, in twelfths of a turn from ahead to the left.
    """

    stack: str
    seed: int
    push: float
    direction: int


@dataclass(frozen=True, kw_only=True)
class StandingOutcome:
    """Outcome of a push: `fell` for a fall."""

    trial: StandingPush
    fell: bool


def run_standing_push(trial: StandingPush) -> StandingOutcome:
    """Stand for 4 s, pushed on the torso after 1 s."""
    robot = load_robot("g1")
    config = PlantConfig(control_dt=PERIOD, sensors=typical_sensors())
    plant = Plant(robot, config, seed=trial.seed)
    force = robot.mass * trial.push / PUSH_TIME
    angle = 2.0 * math.pi * trial.direction / _DIRECTIONS
    x, y = force * math.cos(angle), force * math.sin(angle)
    plant.push(robot.torso, (x, y, 0.0), PUSH_TIME, 1.0)
    controller = WholeBodyController(robot, STACKS[trial.stack](robot))
    for _ in rollout(plant, controller, estimator=LateEstimate(robot), duration=4.0):
        pass
    return StandingOutcome(trial=trial, fell=plant.fallen)


def _standing_cases(options: StudyOptions) -> list[Case]:
    directions = range(0, _DIRECTIONS, 6 if options.quick else 1)
    pushes = (_PUSH,) if options.quick else (_PUSH, *_MORE)
    return [
        Case(
            name=f"{stack}, {push:g} m/s, {360 * k // _DIRECTIONS} degrees",
            trials=[
                StandingPush(stack=stack, seed=seed, push=push, direction=k)
                for seed in _seeds(options)
            ],
            allowed=_SURVIVED if push == _PUSH else None,
        )
        for stack, push, k in product(STACKS, pushes, directions)
    ]


standing_section = TrialSection(
    title="Pushes without steps",
    prose=(
        "Pushes of 0.08 s on the torso of G1, which stands with its feet side by side and makes "
        "no step; on the estimate, with noise and delay. The bound is what the linear pendulum "
        "with its feet withstands. Directions are from ahead to the left.",
    ),
    run=run_standing_push,
    kind=StandingOutcome,
    cases=_standing_cases,
)
"""The section of pushes without steps."""
