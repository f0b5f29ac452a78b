"""`run_trial`: one walk with the estimator in the loop, and the errors of its estimate.

`cell_fault`: a fault of load cells.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from poise.control import WholeBodyController
from poise.dynamics import RobotState
from poise.errors import UnknownNameError
from poise.estimation import StateEstimator
from poise.locomotion import Gait, Stride, Walker, plan_footsteps, walking_stack
from poise.robots import Robot, load_robot
from poise.sim import Plant, PlantConfig, Tick, rollout
from studies.locomotion.late_estimate import DELAY, PERIOD, typical_sensors

NO_CELLS, GOOD = "no cells", "good"
FAULTS = ("zero", "stuck", "biased", "gone")
"""Faults of the cells of one sole."""

_FAULT_BEGIN, _STUCK, _BIAS = 1.6, 160.0, 1.3
"""Beginning of a fault [s], force of a stuck cell [N], ratio of a biased force to the true one."""

_STEP_TIME, _STEP_LENGTH, _DOUBLE_SUPPORT = 0.8, 0.15, 0.15
_REST = 1.5
"""Standing before and after the steps [s]."""

_OBSERVED = [0, 1, 3, 4, 5]
"""Of the invariant error: tilt and velocity. Yaw and position cannot be observed."""

_EVERY = 5
"""Ticks between two looks at the error."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One walk."""

    robot: str  # its name
    seed: int  # of the sensors' noise and biases
    seconds: float  # length of the walk [s]
    friction: float = 1.0  # of the floor
    cells: str = GOOD  # the right sole's fault, one of `FAULTS`, or `NO_CELLS`, or `GOOD`


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Errors of the estimate on a walk."""

    trial: Trial  # the trial
    fell: bool  # whether the robot fell
    way: float  # of the base over the floor [m]
    velocity_rms: float  # root mean square of the base velocity's error [m/s]
    tilt_rms: float  # of the angle between true and estimated vertical [rad]
    drift: float  # largest error of the base's position over the way so far, once that is a metre
    height: float  # largest error of the base's height [m]
    # Mean normalised square of the error of tilt and velocity, 5 where it is consistent
    nees: float


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
        estimator=watch.estimate_with(cell_fault(robot, trial.cells, foot=1)),
        duration=trial.seconds,
    )
    for tick in rollout_ticks:
        watch.look(tick)
    return watch.outcome(trial, plant.fallen)


Fault = Callable[[RobotState], RobotState]


def cell_fault(robot: Robot, cells: str, foot: int) -> Fault:
    """Make a fault of the load cells of a sole."""
    if cells not in (*FAULTS, NO_CELLS, GOOD):
        raise UnknownNameError("no such fault", got=cells, choices=(*FAULTS, NO_CELLS, GOOD))
    sole = tuple(robot.soles)[foot]

    def change(state: RobotState) -> RobotState:
        if cells == NO_CELLS:
            return replace(state, contacts={})
        if cells == GOOD or state.time < _FAULT_BEGIN:
            return state
        contacts = dict(state.contacts)
        wrench = contacts.pop(sole)
        if cells == "zero":
            contacts[sole] = np.zeros(6)
        elif cells == "stuck":
            contacts[sole] = np.array([0.0, 0.0, _STUCK, 0.0, 0.0, 0.0])
        elif cells == "biased":
            contacts[sole] = _BIAS * wrench
        return replace(state, contacts=contacts)

    return change


class _Watch:
    """Compares an estimator with the truth."""

    def __init__(self, robot: Robot, start: RobotState) -> None:
        self.estimator = StateEstimator(robot, q_start=start.q)
        self._truth = [start]
        self._place = start.q[:3].copy()
        self._way = self._drift = self._height = 0.0
        self._velocity: list[float] = []
        self._tilt: list[float] = []
        self._nees: list[float] = []

    def estimate_with(self, fault: Fault) -> Callable[[RobotState], RobotState]:
        """The estimator, told what the cells say instead."""

        def estimate(state: RobotState) -> RobotState:
            return self.estimator.update(fault(state))

        return estimate

    def look(self, tick: Tick) -> None:
        """At the error of one tick, against the truth when its sensors measured."""
        self._truth.append(tick.truth)
        age = 1 + round((tick.time - tick.estimate.time) / PERIOD)
        if tick.index % _EVERY == 0 and age < len(self._truth):
            truth = self._truth[-1 - age]
            self._compare(tick.estimate, truth)
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

    def outcome(self, trial: Trial, fell: bool) -> Outcome:
        """What it saw."""
        return Outcome(
            trial=trial,
            fell=fell,
            way=self._way,
            velocity_rms=math.sqrt(float(np.mean(self._velocity))),
            tilt_rms=math.sqrt(float(np.mean(np.square(self._tilt)))),
            drift=self._drift,
            height=self._height,
            nees=float(np.mean(self._nees)),
        )
