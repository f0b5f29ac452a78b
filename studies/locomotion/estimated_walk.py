"""`run_trial`: one walk with the estimator in the loop, and how far its estimate was off."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.control import WholeBodyController
from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.estimation import StateEstimator
from poise.locomotion import Gait, Stride, Walker, plan_footsteps, walking_stack
from poise.robots import Robot, load_robot
from poise.sim import Plant, PlantConfig, Tick, rollout
from studies.locomotion.late_estimate import DELAY, PERIOD, typical_sensors

FAULTS = ("", "stuck", "dead", "none")
"""Load cells: without fault; in every second second the right ones read 40% of the weight at least,
or the left ones nothing; none at all. Estimator and walker have the same."""

_STEP_TIME, _STEP_LENGTH, _DOUBLE_SUPPORT = 0.8, 0.15, 0.15
_REST = 1.5
"""Standing before and after the steps [s]."""

_OBSERVED = [0, 1, 3, 4, 5]
"""Of the invariant error: tilt and velocity. Yaw and position cannot be observed."""

_EVERY = 5
"""Ticks between two looks at the error."""

_LOADED, _CREEPING = 0.2, 0.02
"""A sole slips that carries this part of the weight and is faster than this [m/s]."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What a worker is asked for.

    Attributes:
        robot: its name.
        seed: of the sensors' noise and biases.
        seconds: length of the walk [s].
        friction: of the floor.
        fault: of the load cells, one of `FAULTS`.
    """

    robot: str
    seed: int
    seconds: float
    friction: float = 1.0
    fault: str = ""

    def __post_init__(self) -> None:
        if self.fault not in FAULTS:
            raise ConfigurationError("no such fault", got=self.fault, choices=FAULTS)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a trial.

    Attributes:
        trial: the trial.
        fell: whether the robot fell.
        way: of the base over the floor [m].
        slipped: way of loaded soles that slipped [m].
        velocity_rms: root mean square of the base velocity's error [m/s].
        tilt_rms: of the angle between true and estimated vertical [rad].
        drift: largest error of the base's position over the way so far, once that is a metre.
        height: largest error of the base's height [m].
        nees: mean normalised square of the error of tilt and velocity, 5 where it is consistent.
        estimator_us: median time of an update [us].
    """

    trial: Trial
    fell: bool
    way: float
    slipped: float
    velocity_rms: float
    tilt_rms: float
    drift: float
    height: float
    nees: float
    estimator_us: float


def run_trial(trial: Trial) -> Outcome:
    """Walks."""
    robot = load_robot(trial.robot)
    config = PlantConfig(control_dt=PERIOD, sensors=typical_sensors(), friction=trial.friction)
    plant = Plant(robot, config, seed=trial.seed)
    steps = max(1, int((trial.seconds - 2.0 * _REST) / (_STEP_TIME + _DOUBLE_SUPPORT)))
    plan = plan_footsteps(
        robot,
        [Stride(steps=steps, length=_STEP_LENGTH)],
        Gait(step_time=_STEP_TIME, double_support=_DOUBLE_SUPPORT, crouch=0.02),
    )
    stack = walking_stack(robot)
    walker = Walker(robot, stack, plan=plan)
    watch = _Watch(robot, plant.true_state())
    rollout_ticks = rollout(
        plant,
        WholeBodyController(robot, stack),
        walker,
        estimator=watch.estimate_with(_faulty(trial.fault, robot.weight)),
        duration=trial.seconds,
    )
    for tick in rollout_ticks:
        watch.look(tick)
    return watch.outcome(trial, plant.fallen)


Fault = Callable[[RobotState], RobotState]


def _faulty(fault: str, weight: float) -> Fault:
    """What the cells say instead."""

    def corrupt(state: RobotState) -> RobotState:
        if fault == "none":
            return replace(state, contacts={})
        contacts = {name: wrench.copy() for name, wrench in state.contacts.items()}
        if fault and int(state.time) % 2:
            if fault == "stuck":
                wrench = contacts["right_sole"]
                wrench[2] = max(wrench[2], 0.4 * weight)
            else:
                contacts["left_sole"][:] = 0.0
        return replace(state, contacts=contacts)

    return corrupt


class _Watch:
    """Compares an estimator with the truth."""

    def __init__(self, robot: Robot, start: RobotState) -> None:
        self._robot = robot
        self.estimator = StateEstimator(robot, q_start=start.q)
        self._truth = [start]
        self._dynamics = Dynamics(robot)
        self._soles: dict[str, Float64[np.ndarray, "3"]] = {}
        self._place = start.q[:3].copy()
        self._way = self._slipped = self._drift = self._height = 0.0
        self._velocity: list[float] = []
        self._tilt: list[float] = []
        self._nees: list[float] = []
        self._seconds: list[float] = []

    def estimate_with(self, fault: Fault) -> Callable[[RobotState], RobotState]:
        """The estimator, told what the cells say instead."""

        def estimate(state: RobotState) -> RobotState:
            return self.estimator.update(fault(state))

        return estimate

    def look(self, tick: Tick) -> None:
        """At the error of one tick, against the truth when its sensors measured."""
        self._seconds.append(tick.estimator_seconds)
        self._truth.append(tick.truth)
        age = 1 + round((tick.time - tick.estimate.time) / PERIOD)
        if tick.index % _EVERY == 0 and age < len(self._truth):
            truth = self._truth[-1 - age]
            self._compare(tick.estimate, truth)
            self._follow(truth)
        del self._truth[: -round(DELAY / PERIOD) - 4]

    def _compare(self, estimate: RobotState, truth: RobotState) -> None:
        R, R_estimate = (pin.Quaternion(s.q[3:7]).toRotationMatrix() for s in (truth, estimate))
        self._velocity.append(float(np.sum((estimate.v[:3] - truth.v[:3]) ** 2)))
        self._tilt.append(
            math.atan2(float(np.linalg.norm(np.cross(R[2], R_estimate[2]))), R[2] @ R_estimate[2])
        )
        error = self.estimator.filter.error(R, R @ truth.v[:3], truth.q[:3])[_OBSERVED]
        P = self.estimator.filter.covariance[np.ix_(_OBSERVED, _OBSERVED)]
        self._nees.append(float(error @ np.linalg.solve(P, error)))
        self._way += float(np.linalg.norm(truth.q[:2] - self._place[:2]))
        self._place = truth.q[:3].copy()
        off = estimate.q[:3] - truth.q[:3]
        self._height = max(self._height, abs(float(off[2])))
        if self._way > 1.0:
            self._drift = max(self._drift, float(np.linalg.norm(off)) / self._way)

    def _follow(self, truth: RobotState) -> None:
        """The soles: loaded ones that move slip."""
        self._dynamics.update(truth)
        for name, wrench in truth.contacts.items():
            place = self._dynamics.placement(self._robot.frame_id(name))[0]
            moved = float(np.linalg.norm(place[:2] - self._soles.get(name, place)[:2]))
            loaded = wrench[2] > _LOADED * self._robot.weight
            if loaded and moved > _CREEPING * _EVERY * PERIOD:
                self._slipped += moved
            self._soles[name] = place.copy()

    def outcome(self, trial: Trial, fell: bool) -> Outcome:
        """What it saw."""
        return Outcome(
            trial=trial,
            fell=fell,
            way=self._way,
            slipped=self._slipped,
            velocity_rms=math.sqrt(float(np.mean(self._velocity))),
            tilt_rms=math.sqrt(float(np.mean(np.square(self._tilt)))),
            drift=self._drift,
            height=self._height,
            nees=float(np.mean(self._nees)),
            estimator_us=1e6 * float(np.median(self._seconds)),
        )
