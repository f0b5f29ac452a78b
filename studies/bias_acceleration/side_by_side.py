"""`compare_along`: all formulas on the states of one run; nothing but the formula differs."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from benchmarks.bias.recursion import PAPER_FORMULAS, FusedRecursion, PaperRecursion
from benchmarks.bias.rows import PaperFormulation
from benchmarks.rigid_plant import set_gravity, with_gravity
from poise.dynamics import Dynamics
from poise.robots import load_robot
from studies.bias_acceleration.cup import PAPER_GRAVITY, CupTasks, CupTrace


@dataclass(frozen=True, kw_only=True, eq=False)
class SideBySide:
    """Answers of each formula along one run."""

    # Bias acceleration of the second task by formula, without `fused` [rad/s^2]
    bias: dict[str, Float64[np.ndarray, "T 3"]]
    torque: dict[str, Float64[np.ndarray, "T n"]]  # torque of both tasks by formula [N m]

    def bias_difference(self, formula: str) -> Float64[np.ndarray, " T"]:
        """(47) and (48): distance of a formula's bias acceleration from the original's [rad/s^2].

        Args:
            formula: "proposed" or "numerical".
        """
        return np.linalg.norm(self.bias["original"] - self.bias[formula], axis=1)

    def torque_difference(self, formula: str) -> float:
        """Largest difference of a torque from the original's, relative to the largest torque."""
        original = self.torque["original"]
        return float(np.abs(self.torque[formula] - original).max() / np.abs(original).max())


def compare_along(
    trace: CupTrace,
    kp: float,
    *,
    gravity: Float64[np.ndarray, " T"] | None = None,
    progress: Callable[[float], object] | None = None,
) -> SideBySide:
    """Evaluates all formulas on what the controller was told in a run."""
    robot = with_gravity(load_robot("arm6"), PAPER_GRAVITY)
    tasks = CupTasks(robot, kp)
    formulation, dynamics = PaperFormulation(robot, tasks.stack), Dynamics(robot)
    recursions = {name: PaperRecursion(name) for name in PAPER_FORMULAS}
    fused = FusedRecursion()
    count = len(trace.states)
    bias = {name: np.zeros((count, 3)) for name in recursions}
    torque = {name: np.zeros((count, robot.nv)) for name in (*recursions, "fused")}
    told = trace.gravity if gravity is None else gravity
    for i, state in enumerate(trace.states):
        set_gravity(robot, float(told[i]))
        dynamics.update(state)
        tasks.aim(state.time)
        formulation.fill(dynamics)
        for name, recursion in (*recursions.items(), ("fused", fused)):
            acceleration = recursion.resolve(formulation.rows, dynamics)
            torque[name][i] = dynamics.M @ acceleration + dynamics.h
            if isinstance(recursion, PaperRecursion):
                bias[name][i] = recursion.bias[-1]
        if progress is not None and i % 100 == 0:
            progress(i / count)
    return SideBySide(bias=bias, torque=torque)
