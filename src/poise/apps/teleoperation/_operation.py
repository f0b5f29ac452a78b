"""`Operation`: an operator's device and the step teleoperator that follows it, in a rollout."""

from collections.abc import Callable, Mapping

import numpy as np

from poise.control import Command
from poise.dynamics import RobotState
from poise.locomotion import Device, DeviceSample, StepTeleoperator, TeleopStatus
from poise.sim import Value
from poise.stack import Stack

Tape = Callable[[int, DeviceSample | None], None]
"""Writes down what a device sent at a tick."""


class Operation:
    """The leader of a rollout in which somebody's hands walk the robot; and its controller.

    Args:
        teleoperator: follows the device.
        device: asked once a tick.
        tape: told the number of each tick and what the device sent, before anybody acts on it.

    Attributes:
        teleoperator: follows the device.
        device: asked once a tick.
        sample: what it sent at the last tick; None for nothing.
        stack: an empty one, what the robot does is the hands' affair.
    """

    def __init__(
        self, teleoperator: StepTeleoperator, device: Device, tape: Tape | None = None
    ) -> None:
        self.teleoperator, self.device = teleoperator, device
        self._tape, self._tick = tape, 0
        self.sample: DeviceSample | None = None
        self.stack = Stack()

    def lead(self, state: RobotState) -> None:
        """Asks the device; hands do not wait for a state that comes late, so the ticks are counted.

        Args:
            state: not heeded, the operator sees the robot otherwise.
        """
        del state
        self.sample = self.device.sample(self._tick * self.teleoperator.parameters.dt)
        if self._tape is not None:
            self._tape(self._tick, self.sample)
        self._tick += 1

    def step(self, state: RobotState) -> Command:
        """Joint velocities that follow what the device sent."""
        return self.teleoperator.step(state, self.sample)

    def signals(self) -> Mapping[str, Value | str]:
        """What a recorder should know of the last tick, as the teleoperator estimates it.

        `com`, `zmp` and the like are the plant's own; the estimated ones stand under `estimate/`.
        """
        status: TeleopStatus | None = self.teleoperator.status
        sample, nowhere = self.sample, np.full(3, np.nan)
        told: dict[str, Value | str] = {
            "target/left device": nowhere if sample is None else sample.left,
            "target/right device": nowhere if sample is None else sample.right,
        }
        if status is None:
            return told
        support = status.mode.support if status.mode.single else None
        planned = {
            f"planned/{sole}": float(support is None or support == i)
            for i, sole in enumerate(self.teleoperator.soles)
        }
        return {
            **told,
            **planned,
            "zmp_reference": status.zmp_reference,
            "estimate/zmp": status.zmp,
            "estimate/cart_table_zmp": status.cart_table_zmp,
            "estimate/com": status.com,
            "estimate/soles": np.array(status.soles),
            "estimate/loads": status.loads,
            "estimate/tilt": status.tilt,
            "foot_target": nowhere if status.target is None else status.target,
            "mode": status.mode.name,
            "device": status.device.name,
        }
