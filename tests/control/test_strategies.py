"""Every strategy drives a standing robot; a strict one keeps what a weighted one trades."""

import numpy as np
import pytest

import poise
from poise.hqp import ACCURACY


def run(
    robot: poise.Robot, strategy: str, backend: str | None, kind=poise.WholeBodyController
) -> tuple[list[poise.Command], poise.WholeBodyController | poise.ReducedController]:
    # A solver that is exact to 1e-3 leaves torques that the next tick cannot change from exactly.
    plain = poise.default_stack(robot)
    stack = poise.Stack(plain.contacts, plain.levels) if backend == "osqp" else plain
    controller = kind(robot, stack, strategy=strategy, backend=backend)
    plant = poise.sim.Plant(robot)
    commands = []
    controller.dynamics.update(plant.state())
    com = controller.dynamics.com.copy()
    for tick in range(40):
        controller.stack.task("com").set_target(com + 0.0005 * tick * np.array([0.0, 1.0, -1.0]))
        commands.append(controller.step(plant.state()))
        plant.step(commands[-1])
    return commands, controller


@pytest.mark.parametrize(
    ("strategy", "backend", "levels", "tolerance"),
    [
        # Dynamics, contacts, balance and hands; only the posture at the bottom has to give.
        ("direct", None, 4, 1e-9),
        ("cascade", "daqp", 4, 1e-8),
        ("cascade", "osqp", 4, ACCURACY["osqp"]),
        # Not strict: the posture takes from every task, but never from the physics.
        ("weighted", "daqp", 2, 1e-9),
    ],
)
@pytest.mark.parametrize("kind", [poise.WholeBodyController, poise.ReducedController])
def test_every_strategy_answers_every_tick(get_robot, kind, strategy, backend, levels, tolerance):
    commands, _ = run(get_robot("humanoid33"), strategy, backend, kind)
    assert all(c.status is poise.CommandStatus.OK for c in commands)
    assert max(max(c.residuals[:levels]) for c in commands) <= tolerance


def test_weighted_and_direct_agree_roughly_on_the_torques(get_robot):
    robot = get_robot("humanoid33")
    direct, _ = run(robot, "direct", None)
    weighted, controller = run(robot, "weighted", None)
    scale = controller.robot.tau_max
    gap = max(
        np.abs((a.torque - b.torque) / scale).max() for a, b in zip(direct, weighted, strict=True)
    )
    assert gap < 0.05
