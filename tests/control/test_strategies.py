"""Every strategy drives a standing robot; a strict one keeps what a weighted one trades."""

import numpy as np
import pytest

import poise
from poise.hqp import ACCURACY, SolveStatus


def run(
    robot: poise.Robot, strategy: str, backend: str | None, kind=poise.WholeBodyController
) -> tuple[list[poise.Command], poise.WholeBodyController | poise.ReducedController]:
    # A solver that is exact to 1e-3 leaves torques that the next tick cannot change from exactly.
    plain = poise.default_stack(robot)
    limit = None if backend == "osqp" else plain.torque_limit
    stack = poise.Stack(plain.contacts, plain.levels, torque_limit=limit, softening=0.0)
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


def test_weighted_and_direct_agree_roughly_but_for_forces_within_the_feet(get_robot):
    """What two feet press against each other costs next to nothing: `weighted` leaves it over."""
    robot = get_robot("humanoid33")
    controllers = [
        poise.WholeBodyController(robot, poise.default_stack(robot), strategy=strategy)
        for strategy in ("direct", "weighted")
    ]
    plant = poise.sim.Plant(robot)
    com = poise.Dynamics(robot)
    com.update(plant.state())
    for tick in range(40):
        commands = []
        for controller in controllers:
            target = com.com + 0.0005 * tick * np.array([0.0, 1.0, -1.0])
            controller.stack.task("com").set_target(target)
            commands.append(controller.step(plant.state()))
        # Of the torques what is not the part of the wrenches, by (7): M times the accelerations.
        apart = commands[0].acceleration - commands[1].acceleration
        moved = (controllers[0].dynamics.M @ apart)[robot.base_dofs :]
        assert np.abs(moved / robot.tau_max).max() < 0.05
        plant.step(commands[0])


def test_exactly_straight_legs_send_no_search_round_in_circles(get_robot):
    """Rows whose slack was rounding of the wrong sign came and went until the cap on changes."""
    robot = get_robot("g1")
    controller = poise.WholeBodyController(robot, poise.default_stack(robot))
    q, joints = robot.q_home.copy(), slice(robot.nq - robot.nj, None)
    q[joints] = np.clip(0.0, robot.q_min, robot.q_max)
    assert controller.step(poise.RobotState(q, np.zeros(robot.nv))).status.ok
    solution = controller.strategy.current.solution
    assert solution is not None
    # Rows of contacts depend on one another to within rounding: the solver may say so.
    assert solution.status in (SolveStatus.OPTIMAL, SolveStatus.INACCURATE)
    n, m = controller.strategy.current.full.problem.shape
    assert solution.iterations < 3 * (n + m)
