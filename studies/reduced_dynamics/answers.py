"""`Judge`: what an answer is worth at a state, by the full equations of motion."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from benchmarks.walk_recording import WalkLead, WalkRecording
from poise.dynamics import Dynamics, RobotState
from poise.robots import Robot
from poise.stack import Task

QUANTITIES = (
    ("1", "base force", "N"),
    ("1", "base moment", "N m"),
    ("1", "joint torque", "N m"),
    ("2", "contacts", "m/s², rad/s²"),
    ("3", "COM", "m/s²"),
    ("3", "pelvis", "rad/s²"),
    ("4", "hands and foot", "m/s², rad/s²"),
)
"""Level, name and unit of what `Judge` measures."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """Accelerations, torques and wrenches that a controller gave for a state.

    Attributes:
        acceleration: dv [m/s^2, rad/s^2].
        torque: of the joints [N m].
        wrench: of the contacts in the order of the stack, zero of inactive ones [N, N m].
    """

    acceleration: Float64[np.ndarray, " nv"]
    torque: Float64[np.ndarray, " nj"]
    wrench: Float64[np.ndarray, " nf"]


class Judge:
    """Measures answers along a walk, in physical units and apart from any solver.

    Args:
        recording: the walk.
        kind: the stack that was asked for.

    Attributes:
        lead: its targets.
        dynamics: of the state at hand.
    """

    def __init__(self, recording: WalkRecording, kind: str) -> None:
        self.lead: WalkLead = recording.lead(kind)
        self.dynamics = Dynamics(recording.robot)
        self._robot: Robot = recording.robot
        self._ends = {*recording.robot.soles, *recording.robot.hands}

    def place(self, state: RobotState) -> None:
        """Goes on to the next state."""
        self.lead.pass_by(state)
        self.dynamics.update(state)

    def evaluate(self) -> None:
        """Brings tasks and contacts up to date where answers are to be measured."""
        for contact in self.lead.stack.contacts:
            contact.evaluate(self.dynamics)
        for _, task in self.lead.stack.tasks():
            if self._is_held(task):
                # As controllers do: a foot that is lifted holds its place as it is then.
                task.reset()
            else:
                task.evaluate(self.dynamics)

    def measure(self, answer: Answer) -> Float64[np.ndarray, " quantities"]:
        """Largest absolute residual of each of `QUANTITIES`."""
        dv, stack = answer.acceleration, self.lead.stack
        force = self.dynamics.M @ dv + self.dynamics.h
        still, first = [0.0], 0
        for contact in stack.contacts:
            place = slice(first, first + contact.dim)
            first = place.stop
            if contact.active:
                force -= contact.jacobian.T @ answer.wrench[place]
                moved = contact.jacobian @ dv + contact.drift - contact.reference
                still.append(float(np.abs(moved).max()))
        base = self._robot.base_dofs
        force[base:] -= answer.torque
        found = {
            name: self._missing(stack.task(name), dv) for name in ("com", "pelvis", *self._ends)
        }
        parts = (force[:3], force[3:base], force[base:])
        return np.array(
            [
                *(float(np.abs(part).max()) for part in parts),
                max(still),
                found["com"],
                found["pelvis"],
                max(found[name] for name in self._ends),
            ]
        )

    def _missing(self, task: Task, dv: Float64[np.ndarray, " nv"]) -> float:
        if self._is_held(task):
            return 0.0
        return float(np.abs(task.jacobian @ dv + task.drift - task.reference).max())

    def _is_held(self, task: Task) -> bool:
        """Whether a contact stands in for the task, which has its frame's name then."""
        return any(c.active and c.frame == task.name for c in self.lead.stack.contacts)
