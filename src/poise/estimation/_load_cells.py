"""Load cells: zeros learned in the air, and wrenches of faulty and missing cells."""

import math
import operator
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from poise._checks import all_finite, is_array
from poise.dynamics import CheckedWrenches, RobotState
from poise.estimation._config import LONGEST_STEP, ContactBelief
from poise.estimation._momentum import MomentumObserver
from poise.robots import GRAVITY, Robot

_SUSPICIOUS, _AGREES = 0.15, 0.125
"""Differences by the weight: a suspicious one to the inertial unit, 0.11 at most on walks; and the
largest of a sound cell, a quarter of the load of each of two feet."""

_LOW_PASS = 0.02
"""Time constant of all differences, three times the observer's [s]."""

_EVIDENCE = 0.005
"""Excess of the difference over that of sound cells, summed over time, that accuses one [s]: a dead
cell under half the weight reaches it in 0.04 s, a hard landing 0.0003."""

_WATCH, _AGREED = 0.5, 2.0
"""Time of watching after a suspicion, and time of agreement, two steps, that clears a cell [s]."""


class LoadCellTare:
    """Zeros of load cells, as the mean of the wrenches of soles in the air.

    While the robot stands, a horizontal zero of 1% of the weight cannot be distinguished from an
    attitude error of 0.6 degrees, nor a moment from an offset of the centre of mass. The mean
    is over 5 s in the air. Wrenches have to be of the ground alone, without weight and inertia of
    what is below the cells. Until a sole has been in the air its zero is zero. A lasting contact of
    less than 4% of the weight, as of a wall, counts as a part of the zero.

    Args:
        soles: names of the soles.
        weight: of the robot [N].
        longest: time between two states over which zeros are learned [s].
        memory: time in the air over which a zero is averaged; it drifts with temperature [s].
        largest: force by the weight beyond which something touches the sole.
        lever: of that force, whose moment is the largest of a zero [m].

    Attributes:
        zeros: of each sole that has been in the air, by name [N, N m].
    """

    def __init__(
        self,
        soles: Sequence[str],
        weight: float,
        *,
        longest: float = LONGEST_STEP,
        memory: float = 5.0,
        largest: float = 0.04,
        lever: float = 0.15,
    ) -> None:
        self._soles, self._longest, self._memory = tuple(soles), longest, memory
        self._force = largest * weight
        self._moment = lever * self._force
        self.reset()

    def reset(self) -> None:
        """Restart with zeros of zero."""
        self.zeros: dict[str, Float64[np.ndarray, "6"]] = {}
        self._time, self._seen = math.nan, dict.fromkeys(self._soles, 0.0)

    def update(
        self, state: RobotState, airborne: Sequence[int], estimated: Sequence[str] = ()
    ) -> RobotState:
        """Return the state with wrenches less their zeros; learn those of `airborne` soles."""
        dt, self._time = state.time - self._time, state.time
        for sole, clear in zip(self._soles, airborne, strict=True):
            if clear and sole not in estimated and 0.0 < dt <= self._longest:
                self._learn(sole, state.wrench(sole), dt)
        if not self.zeros:
            return state
        contacts = CheckedWrenches(state.contacts)
        for sole, zero in self.zeros.items():
            wrench = contacts.usable.get(sole)
            if wrench is not None and sole not in estimated:
                contacts[sole] = contacts.usable[sole] = wrench - zero
        return replace(state, contacts=contacts)

    def _learn(self, sole: str, wrench: Float64[np.ndarray, "6"] | None, dt: float) -> None:
        """Average the wrench of a sole in the air, unless it is too large for a zero."""
        if wrench is None:
            return
        f_x, f_y, f_z, m_x, m_y, m_z = wrench.tolist()
        if math.hypot(f_x, f_y, f_z) > self._force or math.hypot(m_x, m_y, m_z) > self._moment:
            return
        before = self.zeros.get(sole)
        if before is None:
            self.zeros[sole] = wrench.copy()
            self._seen[sole] = dt
            return
        self._seen[sole] = seen = min(self._seen[sole] + dt, self._memory)
        before += dt / seen * (wrench - before)


class LoadCellVote:
    """Replacement of the wrenches of faulty or missing load cells by estimates.

    All soles together carry m (g + a), as the inertial unit at the base has it. Once their cells
    differ from that, a `MomentumObserver` estimates each wrench from the joint torques. Where the
    sums of cells and estimates differ by much for long (a one-sided CUSUM), the cell that differs
    most is faulty, and joint torques and all other soles determine the wrench on its sole. A push
    moves the estimates of both feet against each other, and leaves their sum. Estimates whose own
    sum is not what the inertial unit measures accuse no cell: a rope carries the robot, or a knee
    is straight.

    Nothing is replaced where the joint torques are not measured.

    Attributes:
        estimated: soles whose wrenches in the last state are estimates.
    """

    def __init__(self, robot: Robot, *, longest: float = LONGEST_STEP) -> None:
        self._joints, self._weight, self._longest = robot.nj, robot.weight, longest
        self._names, self._observer = tuple(robot.soles), MomentumObserver(robot)
        self.reset()

    def reset(self) -> None:
        """Restart with sound cells."""
        self.estimated: tuple[str, ...] = ()
        # By faulty sole, the time for which its cell has agreed with its estimate [s].
        self._faulty = dict[str, float]()
        self._differs = self._unexplained = self._watch = self._evidence = 0.0
        self._apart = np.zeros(len(self._names))
        self._observer.reset()

    def update(
        self, state: RobotState, before: RobotState | None, up: Float64[np.ndarray, "3"]
    ) -> RobotState:
        """Return the state with the wrenches of faulty and missing cells replaced."""
        if before is not None and state.time == before.time:
            return self._replaced(state, before)
        self.estimated = ()
        dt = math.nan if before is None else state.time - before.time
        reading = state.readings
        if before is None or reading is None or not 0.0 < dt <= self._longest:
            self._observer.reset()
            return state
        torque, force = reading.torque, reading.specific_force
        if not (is_array(torque, self._joints) and is_array(force, 3)):
            return state
        lift = sum(map(operator.mul, up.tolist(), force.tolist()))
        if not (math.isfinite(lift) and all_finite(torque)):
            # The observer would never be finite again.
            self._observer.reset()
            return state
        measured = {n: wrench for n in self._names if (wrench := state.wrench(n)) is not None}
        loads = {name: float(wrench[2]) for name, wrench in measured.items()}
        payload = 0.0 if before.payload is None else before.payload.mass * GRAVITY
        gain = dt / (_LOW_PASS + dt)
        expected = (self._weight + payload) * lift / GRAVITY
        differs = (sum(loads.values()) - expected) / self._weight
        self._differs += gain * (differs - self._differs)
        if abs(self._differs) > _SUSPICIOUS:
            self._watch = _WATCH
        if self._watch <= 0.0 and not self._faulty and len(loads) == len(self._names):
            self._observer.reset()
            self._apart[:], self._unexplained = 0.0, 0.0
            return state
        self._watch -= dt
        self._observer.update(before, torque, dt, measured)
        estimates = self._observer.wrenches
        apart = [loads[n] - estimates[n][2] if n in loads else 0.0 for n in self._names]
        total = sum(float(wrench[2]) for wrench in estimates.values())
        self._unexplained += gain * ((total - expected) / self._weight - self._unexplained)
        self._apart += gain * (np.array(apart) / self._weight - self._apart)
        self._judge(payload / self._weight, dt)
        self.estimated = tuple(n for n in self._names if n in self._faulty or n not in loads)
        return self._replaced(state, before)

    def _judge(self, payload: float, dt: float) -> None:
        for name, apart in zip(self._names, self._apart.tolist(), strict=True):
            if name in self._faulty:
                self._faulty[name] = self._faulty[name] + dt if abs(apart) < _AGREES else 0.0
                if self._faulty[name] > _AGREED:
                    del self._faulty[name]
        explained = abs(self._unexplained) < _AGREES
        excess = abs(float(self._apart.sum()) - payload) - _AGREES if explained else -_AGREES
        self._evidence = max(self._evidence + dt * excess, 0.0)
        if not self._faulty and self._evidence > _EVIDENCE:
            self._faulty[self._names[int(np.argmax(np.abs(self._apart)))]] = 0.0

    def _replaced(self, state: RobotState, before: RobotState) -> RobotState:
        if not self.estimated:
            return state
        contacts = {n: w for n, w in state.contacts.items() if n not in self.estimated}
        known = {n: w for n in self._names if n in contacts and (w := state.wrench(n)) is not None}
        observer = self._observer
        # Without a sound cell it has just shared all of the force.
        shared = observer.share(before.q, known) if known else observer.wrenches
        for name, wrench in shared.items():
            force = math.hypot(*wrench[:3].tolist())
            contacts[name] = wrench if force >= ContactBelief.load * self._weight else np.zeros(6)
        return replace(state, contacts=contacts)
