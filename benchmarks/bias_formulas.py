"""The bias formulas of one tick, each with just what it needs beyond the torque.

As in (Park, Jin, Kang 2022), everything that the torque (17) needs in any case is there already and
does not count: J_i|p, Lambda_i|p and its inverse, Jbar_i|p, mu_i|p + p_i|p, Jdot_i|p v, M^-1, h,
xdd_i,ref, and the sum of the torques above. So is Jdot_i v, which no formula computes here: it
comes with the frames' kinematics, for all formulas alike.

    original    Lambda_i^-1, Lambda_i, mu_i + p_i, J_i M^-1 sum Gamma_j, and their sum      (23)
    original_plain
                the same with a plain inverse for Lambda_i; `original` inverts as all of Poise
                does, ready for tasks that have lost rank
    proposed    the sum of Jbar_j|p (xdd_j|p,ref - Jdot_j|p v) over the tasks above, J_i times
                it, and the velocity terms                                                  (31)
    numerical   (J_i - J_i|p) v and its backward difference                                 (41)
    fused       alpha_j, the sum of Jbar_j|p alpha_j over the tasks above, J_i times it, and
                Jdot_i v
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from benchmarks.fixed_base.loop import CONTROL_DT
from poise.control._osf._bias import PrioritisedTask, bias_fused, bias_original, bias_proposed

Biases = list[Float64[np.ndarray, " _"]]
"""Bias accelerations of tasks 2 to k."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BiasTick:
    """One tick's quantities that the torque needs anyway.

    Attributes:
        tasks: tasks 1 to k.
        references: xdd_i,ref.
        references_p: xdd_i|p,ref, by (24).
        torques_above: sum of the torques of the tasks above, for tasks 2 to k.
        M_inverse: M^-1.
        h: V + G.
        v: joint velocities.
        before: (J_i - J_i|p) v of the tick before, for tasks 2 to k.
    """

    tasks: list[PrioritisedTask]
    references: list[Float64[np.ndarray, " _"]]
    references_p: list[Float64[np.ndarray, " _"]]
    torques_above: list[Float64[np.ndarray, " n"]]
    M_inverse: Float64[np.ndarray, "n n"]
    h: Float64[np.ndarray, " n"]
    v: Float64[np.ndarray, " n"]
    before: Biases


def original(tick: BiasTick) -> Biases:
    """By (23)."""
    return [
        bias_original(task, tick.M_inverse, above, tick.h)
        for task, above in zip(tick.tasks[1:], tick.torques_above, strict=True)
    ]


def original_plain(tick: BiasTick) -> Biases:
    """By (23), for tasks that have their full rank by themselves."""
    found: Biases = []
    for task, Gamma_above in zip(tick.tasks[1:], tick.torques_above, strict=True):
        J_Minv = task.J.dot(tick.M_inverse)
        Lambda_inverse = J_Minv.dot(task.J.T)
        mu = np.linalg.inv(Lambda_inverse).dot(J_Minv.dot(tick.h) - task.drift)
        bias = J_Minv.dot(Gamma_above)
        bias += task.Lambda_p_inverse.dot(task.mu_p)
        bias -= Lambda_inverse.dot(mu)
        found.append(bias)
    return found


def proposed(tick: BiasTick) -> Biases:
    """By (31)."""
    first, *tasks = tick.tasks
    S = first.Jbar_p.dot(tick.references_p[0] - first.drift_p)
    found = [bias_proposed(tasks[0], S)]
    for i in range(1, len(tasks)):
        above = tasks[i - 1]
        S += above.Jbar_p.dot(tick.references_p[i] - above.drift_p)
        found.append(bias_proposed(tasks[i], S))
    return found


def numerical(tick: BiasTick) -> Biases:
    """By (41)."""
    return [
        ((task.J - task.J_p).dot(tick.v) - before) / CONTROL_DT
        for task, before in zip(tick.tasks[1:], tick.before, strict=True)
    ]


def fused(tick: BiasTick) -> Biases:
    """With the prioritised velocity terms cancelled; Jdot_i|p v is in the result."""
    first, *tasks = tick.tasks
    S = first.Jbar_p.dot(tick.references[0] - first.drift)
    bias = bias_fused(tasks[0].J, tasks[0].drift, S)
    found = [bias]
    for i in range(1, len(tasks)):
        task = tasks[i]
        S += tasks[i - 1].Jbar_p.dot(tick.references[i] - bias)
        bias = bias_fused(task.J, task.drift, S)
        found.append(bias)
    return found


FORMULAS: dict[str, Callable[[BiasTick], Biases]] = {
    "original": original,
    "original_plain": original_plain,
    "proposed": proposed,
    "numerical": numerical,
    "fused": fused,
}
"""By name; the original first, as the one that others are compared with."""
