"""Every strategy drives a standing robot; a strict one keeps what a weighted one trades."""

import numpy as np
import pytest

import poise


def run(
    robot: poise.Robot, strategy: str, backend: str | None
) -> tuple[list[poise.Command], poise.WholeBodyController]:
    controller = poise.WholeBodyController(robot, strategy=strategy, backend=backend)
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
    ("strategy", "backend", "tolerance"),
    [
        ("direct", None, 1e-9),
        ("cascade", "daqp", 1e-8),
        ("cascade", "osqp", 1e-4),
        ("weighted", "daqp", 0.1),
    ],
)
def test_every_strategy_answers_every_tick_and_meets_the_tasks(
    get_robot, strategy, backend, tolerance
):
    commands, _ = run(get_robot("humanoid33"), strategy, backend)
    assert all(c.status is poise.CommandStatus.OK for c in commands)
    # Dynamics, contacts, balance and hands; only the posture at the bottom has to give.
    assert max(max(c.residuals[:4]) for c in commands) <= tolerance


def test_weighted_and_direct_agree_roughly_on_the_torques(get_robot):
    robot = get_robot("humanoid33")
    direct, _ = run(robot, "direct", None)
    weighted, controller = run(robot, "weighted", None)
    scale = controller.robot.tau_max
    gap = max(
        np.abs((a.torque - b.torque) / scale).max() for a, b in zip(direct, weighted, strict=True)
    )
    assert gap < 0.05
