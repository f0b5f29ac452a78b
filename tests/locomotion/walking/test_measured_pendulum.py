"""C and its velocity as measured, against differences of positions."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import poise
from poise.locomotion import Walker, walking_stack

STEP = 1e-6


def _in_flight(robot):
    """A walker that has just lifted its left foot in place, and the state it has seen."""
    walker = Walker(robot, walking_stack(robot))
    state = poise.RobotState(robot.q_home, np.zeros(robot.nv))
    walker.lead(state)
    walker._engine.steps.put_down(0)
    return walker, state


def _mass(walker, state):
    walker._engine.parts.sense.update(state)
    return walker._engine.parts.pendulum.mass(walker._engine.steps.flight)


@pytest.mark.parametrize("name", ["humanoid33", "g1"])
def test_velocity_is_how_fast_c_moves(name, get_robot):
    robot = get_robot(name)
    walker, state = _in_flight(robot)
    parts, flight = walker._engine.parts, walker._engine.steps.flight
    # The stance foot rests: the base moves so that it does, whatever the joints do.
    v = 0.3 * np.random.default_rng(4).standard_normal(robot.nv)
    data = robot.model.createData()
    frame = robot.frame_id(parts.stand.soles[1])
    jacobian = pin.computeFrameJacobian(robot.model, data, state.q, frame, pin.LOCAL)
    v[:6] = -np.linalg.solve(jacobian[:, :6], jacobian[:, 6:] @ v[6:])
    _, velocity = _mass(walker, replace(state, v=v))
    ends = []
    for way in (-STEP, STEP):
        parts.sense.update(replace(state, q=pin.integrate(robot.model, state.q, way * v)))
        place, _ = parts.sense.lower_edge(flight.foot)
        # The body heads along x at home: a foot that rises counts as one that goes ahead.
        lifted = (float(place[0] + parts.pendulum._rise * place[2]), float(place[1]))
        com = parts.sense.com[:2]
        ends.append(parts.legs.joined(tuple(com), (lifted, parts.stance.feet[1].position[:2])))
    expected = (np.array(ends[1]) - np.array(ends[0])) / (2.0 * STEP)
    assert np.array(velocity) == pytest.approx(expected, abs=1e-6)
