"""`Faults`: what a bus and its devices do to states and commands."""

from collections import deque
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from poise._schema import Bounds, Seconds, checked
from poise.errors import UnknownNameError
from poise.hardware import MotorCommand, MotorState

_ROUNDING = 1e-9  # of sums of periods [s]
_Chance = Annotated[float, Bounds(least=0.0, most=1.0)]


@checked()
@dataclass(frozen=True, kw_only=True)
class FaultPlan:
    """Faults of a simulated robot's bus and devices."""

    begin: Seconds = 0.0  # of all faults [s]
    loss: _Chance = 0.0  # probability that a message does not arrive, in both directions
    delay: Seconds = 0.0  # of each state [s]
    jitter: Seconds = 0.0  # what a state is later than that at most, evenly distributed [s]
    reorder: _Chance = 0.0  # probability that a state arrives after the next one
    frozen: tuple[str, ...] = ()  # joints whose encoder repeats its number
    dead: tuple[str, ...] = ()  # joints whose motor gives no torque


class Faults:
    """Apply a plan to the messages of a simulated robot.

    Args:
        plan: the plan.
        joints: names of the joints, in the order of the arrays.
        period: of the messages [s].
        seed: of everything random.

    Raises:
        UnknownNameError: no such joint.
    """

    def __init__(
        self, plan: FaultPlan, joints: tuple[str, ...], *, period: float, seed: int = 0
    ) -> None:
        for name in (*plan.frozen, *plan.dead):
            if name not in joints:
                raise UnknownNameError("a fault names no joint", got=name, choices=joints)
        self._plan, self._period = plan, period
        self._rng = np.random.default_rng(seed)
        self._frozen = np.isin(joints, plan.frozen)
        self._dead = np.isin(joints, plan.dead)
        self._stuck: np.ndarray | None = None
        self._under_way: deque[tuple[float, MotorState]] = deque()
        self._command: MotorCommand | None = None

    def states(self, state: MotorState, time: float) -> list[MotorState]:
        """Return the states that arrive now, in their order.

        Args:
            state: as measured now.
            time: now [s].
        """
        plan, draw = self._plan, self._rng.random
        if time < plan.begin:
            return [state]
        if self._frozen.any():
            if self._stuck is None:
                self._stuck = state.q.copy()
            q = np.where(self._frozen, self._stuck, state.q)
            state = replace(state, q=q, dq=np.where(self._frozen, 0.0, state.dq))
        if draw() >= plan.loss:
            late = plan.delay + plan.jitter * draw()
            late += 1.5 * self._period * (draw() < plan.reorder)
            self._under_way.append((time + late, state))
        now = time + _ROUNDING
        due = sorted((e for e in self._under_way if e[0] <= now), key=lambda e: e[0])
        self._under_way = deque(e for e in self._under_way if e[0] > now)
        return [state for _, state in due]

    def command(self, command: MotorCommand, time: float) -> MotorCommand:
        """Return the command that the drives have now.

        Args:
            command: the newest one that was sent.
            time: now [s].
        """
        if time < self._plan.begin:
            return command
        if self._command is None or self._rng.random() >= self._plan.loss:
            self._command = command
        if not self._dead.any():
            return self._command
        gains = (np.where(self._dead, 0.0, getattr(self._command, n)) for n in ("kp", "kd", "tau"))
        return replace(self._command, **dict(zip(("kp", "kd", "tau"), gains, strict=True)))
