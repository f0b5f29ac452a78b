"""`compare_along`: all formulas on the states of one run; nothing but the formula differs."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from benchmarks.fixed_base.plant import set_gravity, with_gravity
from poise.control import RankTreatment
from poise.control._osf._formulation import OperationalFormulation
from poise.control._osf._fused import FusedResolver
from poise.control._osf._recursion import PaperResolver
from poise.control._osf._scales import RowScales
from poise.dynamics import Dynamics, MatrixRates
from poise.robots import load_robot
from studies.bias_acceleration.cup import PAPER_GRAVITY, CupTasks, CupTrace

PAPER_FORMULAS = ("original", "proposed", "numerical")


@dataclass(frozen=True, kw_only=True, eq=False)
class SideBySide:
    """What each formula says along one run.

    Attributes:
        bias: bias acceleration of the second task by formula, without `fused` [rad/s^2].
        torque: torque of both tasks by formula [N m].
    """

    bias: dict[str, Float64[np.ndarray, "T 3"]]
    torque: dict[str, Float64[np.ndarray, "T n"]]

    def bias_difference(self, formula: str) -> Float64[np.ndarray, " T"]:
        """(47) and (48): distance of a formula's bias acceleration from the original's [rad/s^2].

        Args:
            formula: "proposed" or "numerical".
        """
        return np.linalg.norm(self.bias["original"] - self.bias[formula], axis=1)

    def torque_difference(self, formula: str) -> float:
        """Largest difference of a torque from the original's, relative to the largest torque.

        Args:
            formula: any.
        """
        original = self.torque["original"]
        return float(np.abs(self.torque[formula] - original).max() / np.abs(original).max())


def compare_along(
    trace: CupTrace,
    kp: float,
    *,
    derivative: str = "numerical",
    gravity: Float64[np.ndarray, " T"] | None = None,
    progress: Callable[[float], object] | None = None,
) -> SideBySide:
    """Evaluates all formulas on what the controller was told in a run.

    Args:
        trace: the run.
        kp: stiffness of its tasks [1/s^2].
        derivative: how projected Jacobians are differentiated: "exact" or "numerical".
        gravity: vertical gravity that the formulas are told, tick by tick; the run's own when
            None [m/s^2].
        progress: told the share that is done, now and then.
    """
    robot = with_gravity(load_robot("arm6"), PAPER_GRAVITY)
    tasks = CupTasks(robot, kp)
    tasks.stack.bind(robot)
    scales = RowScales(robot)
    scales.learn(tasks.stack)
    formulation = OperationalFormulation(robot, tasks.stack, (), scales)
    dynamics, rank = Dynamics(robot), RankTreatment()
    rates = MatrixRates(robot) if derivative == "exact" else None
    resolvers = {name: PaperResolver(name, rank) for name in PAPER_FORMULAS}
    fused = FusedResolver(robot.nv, rank)
    count = len(trace.states)
    bias = {name: np.zeros((count, 3)) for name in resolvers}
    torque = {name: np.zeros((count, robot.nv)) for name in (*resolvers, "fused")}
    told = trace.gravity if gravity is None else gravity
    for i, state in enumerate(trace.states):
        set_gravity(robot, float(told[i]))
        dynamics.update(state)
        tasks.aim(state.time)
        if rates is not None:
            rates.update(state)
        formulation.fill(dynamics, rates)
        for name, resolver in (*resolvers.items(), ("fused", fused)):
            acceleration = resolver.resolve(formulation.rows, dynamics)
            torque[name][i] = dynamics.M @ acceleration + dynamics.h
            if isinstance(resolver, PaperResolver):
                bias[name][i] = resolver.bias[-1]
        if progress is not None and i % 100 == 0:
            progress(i / count)
    return SideBySide(bias=bias, torque=torque)
