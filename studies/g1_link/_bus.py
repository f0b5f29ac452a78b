"""`Bus`: a simulated G1 behind its bus in lock-step, for deployments in one process."""

from collections.abc import Callable, Generator
from copy import copy
from dataclasses import fields, replace
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.apps.deployment import FaultPlan, Faults, g1_gains, stage_deployment
from poise.apps.scenarios import Scenario
from poise.hardware import (
    LastCheck,
    LinkStatus,
    MotorCommand,
    MotorState,
    PlantLink,
)
from poise.robots import Robot
from poise.sim import MotorConfig, Plant, PlantConfig, Tick, rollout

FIELDS = tuple(field.name for field in fields(MotorCommand))

PERIOD = 0.002
"""Of states and commands of a G1 [s]."""

ON_THE_WAY = FaultPlan(delay=1e-3)
"""Way of a state over the bus: as long as `MotorConfig.g1()` has it for commands [s]."""

_FRESH = 0.01
"""Age of a command from which the process of a `ProcessLink` damps [s]."""

_ROUNDING = 2.0**-23
"""Relative error of a float32, twice that of rounding to the nearest."""

_SENT = "q", "dq", "tau", "quaternion", "gyro", "acceleration"
"""Fields of a state that the messages of a G1 have, as float32."""


class Bus:
    """Link to a plant in this process, with a bus between them, whose time passes by commands.

    States and commands are rounded to float32, as messages are. States are those of `Faults` of the
    plan, stamped at their arrival, as a G1's; the drives keep a command that is not followed by
    another. What reaches them is checked once more, by code that shares nothing with `LastCheck`.

    Args:
        plant: the robot.
        check: the last check; the bus has a copy of it.
        plan: faults of the bus and its devices.
        seed: of the faults.

    Attributes:
        check: the copy.
        change: made of each state at its arrival.
        missed: periods in which no state arrived.
        wrong: commands at the drives that are not finite or not within limits.
        largest: torque of ideal drives that was asked for, by its limit.
    """

    def __init__(
        self, plant: Plant, check: LastCheck, plan: FaultPlan = ON_THE_WAY, *, seed: int = 0
    ) -> None:
        self._plant, self.check, self._link = plant, copy(check), PlantLink(plant, load_cells=False)
        self.info, self.status = self._link.info, LinkStatus.OK
        self._faults = Faults(plan, self.info.joints, period=PERIOD, seed=seed)
        self._kp_max, self._kd_max = check.kp_max, check.kd_max
        self.change: Callable[[MotorState], MotorState] = lambda state: state
        self.missed, self.wrong, self.largest = 0, 0, 0.0
        self._sent = MotorCommand.damping(np.zeros(plant.robot.nj))
        self._state = self._received(self._link.read())

    @property
    def refused(self) -> int:
        """Number of commands that failed the last check."""
        return self.check.refused

    @property
    def reason(self) -> str:
        """Fault of the last refused command."""
        return self.check.reason

    def clock(self) -> float:
        """Return the plant's time [s]."""
        return self._plant.time

    def read(self) -> MotorState:
        """Return the state that arrived last."""
        return self._state

    def write(self, command: MotorCommand) -> None:
        """Send a command, and advance by a period."""
        self._sent = _rounded(self.check.check(command, self._state))
        self._advance()

    def stall(self, periods: int) -> None:
        """Advance without a command: damping from 10 ms on, as by a `ProcessLink`."""
        for k in range(periods):
            if (k + 1) * PERIOD >= _FRESH:
                self.check.reset()
                self._sent = _rounded(self.check.damping)
            self._advance()

    def close(self) -> None:
        """Do nothing: the plant ends with the process."""

    def _advance(self) -> None:
        plant, now = self._plant, self._plant.time
        command, truth = self._faults.command(self._sent, now), plant.true_state()
        q, dq = truth.q[-plant.robot.nj :], truth.v[-plant.robot.nj :]
        share = float(np.max(np.abs(command.torque(q, dq)) / plant.robot.tau_max))
        self.largest = max(self.largest, share)
        self.wrong += not self._within_limits(command)
        plant.drive(command)
        arrived = self._faults.states(self._link.read(), plant.time)
        self.missed += not arrived
        if arrived:
            self._state = self._received(arrived[-1])

    def _received(self, state: MotorState) -> MotorState:
        now = self._plant.time
        numbers = {name: _as_sent(getattr(state, name)) for name in _SENT}
        return self.change(replace(state, time=now, arrived=now, **numbers))

    def _within_limits(self, command: MotorCommand) -> bool:
        """Return True for finite numbers in the limits of the robot's description and drives."""
        robot, slack = self._plant.robot, 1.0 + _ROUNDING
        q, dq, kp, kd, tau = (getattr(command, name) for name in FIELDS)
        middle, half = 0.5 * (robot.q_min + robot.q_max), 0.5 * (robot.q_max - robot.q_min)
        inside = np.abs(q - middle) <= half + _ROUNDING * (half + np.abs(middle))
        slow = np.abs(dq) <= slack * robot.v_max
        good = (
            np.isfinite([q, dq, kp, kd, tau]).all(axis=0)
            & ((kp == 0.0) | inside)
            & ((kd == 0.0) | slow)
            & (np.abs(tau) <= slack * robot.tau_max)
            & (kp >= 0.0)
            & (kp <= slack * self._kp_max)
            & (kd >= 0.0)
            & (kd <= slack * self._kd_max)
        )
        return bool(good.all())


def g1_plant(*loads: PlantConfig.Payload, ideal: bool = False) -> PlantConfig:
    """Return the plant of a G1: with motors and noise, or ideal drives and sensors."""
    config = PlantConfig(control_dt=PERIOD, payloads=loads)
    return config if ideal else replace(config, motors=MotorConfig.g1()).with_noise()


def stage_on(bus: Bus, scenario: Scenario, robot: Robot, *, ramp: float = 3.0) -> Any:
    """Stage a scenario on a G1 behind the bus."""
    gains = g1_gains(robot)
    return stage_deployment(
        scenario,
        robot,
        bus,
        gains.check,
        gains.split,
        kp=gains.kp,
        kd=gains.kd,
        ramp=ramp,
    )


def ticks_of(stage: Any, plant: Plant) -> Generator[Tick]:
    """Run a stage to its end, an end by the watchdog or a fall of the plant."""
    for tick in rollout(
        stage.plant,
        stage.controller,
        stage.leader,
        estimator=stage.estimator,
        duration=stage.scenario.duration,
    ):
        yield tick
        if plant.fallen:
            return


def _rounded(command: MotorCommand) -> MotorCommand:
    return MotorCommand(**{name: _as_sent(getattr(command, name)) for name in FIELDS})


def _as_sent(numbers: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    return numbers.astype(np.float32).astype(np.float64)
