"""Inverse-kinematics problems are singular where they say, and in conflict where they say."""

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.hqp.inverse_kinematics import (
    HUMANOID,
    PLANAR,
    SINGULAR,
    Reach,
    humanoid_problems,
)
from poise.dynamics import Dynamics, RobotState
from poise.hqp import LexicographicSolver

ARMS = {source.name: source for source in SINGULAR}
HUMANOIDS = {source.name: source for source in HUMANOID}


def solve(problems):
    """Solutions, each from the active set of the last."""
    solver = LexicographicSolver()
    for problem in problems:
        problem.validate()
    return [solver.solve(problem) for problem in problems]


@pytest.mark.parametrize("source", PLANAR, ids=lambda source: source.name)
def test_a_planar_arm_is_stretched_in_the_middle_and_misses_what_it_cannot_do(source):
    problems = list(source.make(21, None))
    smallest = [np.linalg.svd(p.level(1).A, compute_uv=False)[-1] for p in problems]
    assert np.argmin(smallest) == 10
    assert smallest[10] < 1e-12 < 1e-4 < min(smallest[9], smallest[11])
    solutions = solve(problems)
    assert all(solution.ok for solution in solutions)
    # Stretched, the 0.3 m/s along the arm are lost, and those across it are not.
    assert solutions[10].residuals[1] == pytest.approx(0.3)
    assert all(solution.residuals[0] < 1e-9 < solution.residuals[2] for solution in solutions)


@pytest.mark.parametrize(
    ("name", "trunk"),
    [
        ("ik-arm6-wrist", False),
        ("ik-arm6-elbow", False),
        ("ik-panda-shoulder", False),
        ("ik-upper17-elbows", True),
    ],
)
def test_an_arm_is_singular_in_the_middle_and_its_hand_wants_what_is_lost(name, trunk, get_robot):
    get_robot("panda" if "panda" in name else "arm6")
    problems = list(ARMS[name].make(9, None))
    smallest, free = [], np.eye(problems[0].n)
    for problem in problems:
        if trunk:
            T = problem.level(1).A
            free = np.eye(problem.n) - np.linalg.pinv(T, rcond=1e-10) @ T
        hands = problem.level(2 if trunk else 1).A @ free
        smallest.append(np.linalg.svd(hands, compute_uv=False)[-1])
    assert smallest[4] < 1e-12
    assert min(smallest[3], smallest[5]) > 1e-6
    solutions = solve(problems)
    assert all(solution.ok for solution in solutions)
    hands = 0.5 * np.sqrt(2.0 if trunk else 1.0)
    assert solutions[4].residuals[-2] == pytest.approx(hands, rel=1e-6)
    assert max(solution.residuals[0] for solution in solutions) < 1e-9


@pytest.mark.parametrize(
    ("name", "missed"),
    [
        ("ik-humanoid-reach", [False, False, False, False, False, True]),
        ("ik-humanoid-conflict", [False, False, True, True, True, True]),
    ],
)
def test_a_humanoid_misses_what_it_should(name, missed):
    solutions = solve(list(HUMANOIDS[name].make(5, None)))
    assert all(solution.ok for solution in solutions)
    for solution in solutions:
        assert (solution.residuals > 1e-6).tolist() == missed


def test_a_humanoids_rows_are_derivatives_of_what_they_move(get_robot):
    robot = get_robot("humanoid33")
    reach = Reach(right=(0.4, -0.2, 0.9), left=(0.4, 0.2, 0.9), gaze=(1.5, 0.3, 1.2), before=0)
    (problem,) = humanoid_problems(reach, 1)
    dynamics = Dynamics(robot)

    def measured(step):
        q = pin.integrate(robot.model, robot.q_home, step)
        dynamics.update(RobotState(q, np.zeros(robot.nv)))
        head = dynamics.frame(robot.frame_id("head_link"))
        ahead = head.rotation.T @ (np.array(reach.gaze) - head.position)
        hands = [dynamics.frame(robot.frame_id(hand)).position for hand in robot.hands]
        return np.concatenate((dynamics.com[:2], hands[1], hands[0], ahead))

    distance = np.linalg.norm(measured(np.zeros(robot.nv))[-3:])
    steps = 1e-6 * np.eye(robot.nv)
    differences = np.stack([(measured(s) - measured(-s)) / 2e-6 for s in steps], axis=1)
    rows = np.vstack([problem.level(1).A[12:], *(problem.level(i).A for i in (2, 3, 4))])
    # The eyes follow what is ahead in units of its distance, and how far it is does not count.
    differences = np.vstack([differences[:8], differences[9:] / distance])
    np.testing.assert_allclose(rows, differences, atol=1e-7)
