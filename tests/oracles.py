"""Random states and finite differences, written without Poise's own kinematics."""

import numpy as np
import pinocchio as pin

from poise.dynamics import Dynamics, RobotState

STEP = 1e-6
"""Step of the central differences; with values near one it leaves errors near 1e-9."""


def random_state(robot, seed, speed=1.0, time=0.0):
    """A state with joints inside their limits, the base anywhere, and everything moving."""
    rng = np.random.default_rng(seed)
    joints = rng.uniform(0.8 * robot.q_min, 0.8 * robot.q_max)
    q = joints
    if robot.floating_base:
        quaternion = rng.normal(size=4)
        base = (rng.normal(size=3), quaternion / np.linalg.norm(quaternion))
        q = np.concatenate((*base, joints))
    return RobotState(q, speed * rng.normal(size=robot.nv), time=time)


def near_home(robot, seed, spread=0.05, speed=0.1, time=0.0):
    """A state near the home configuration, which a controller can stand in."""
    rng = np.random.default_rng(seed)
    dq = spread * rng.normal(size=robot.nv)
    q = pin.integrate(robot.model, robot.q_home, dq)
    first = robot.nq - robot.nj
    q[first:] = np.clip(q[first:], robot.q_min + 0.02, robot.q_max - 0.02)
    return RobotState(q, speed * rng.normal(size=robot.nv), time=time)


def dynamics_at(robot, q, v):
    """Fresh dynamics of one state."""
    dynamics = Dynamics(robot)
    dynamics.update(RobotState(q, v))
    return dynamics


def moved(robot, q, dq):
    """A configuration one tangent step away."""
    return pin.integrate(robot.model, q, dq)


def difference_jacobian(robot, q, difference):
    """Tangent-space central differences of a quantity.

    `difference(q_minus, q_plus)` is the quantity's own difference, such as a rotation's logarithm.
    """
    columns = []
    for i in range(robot.nv):
        step = np.zeros(robot.nv)
        step[i] = STEP
        columns.append(difference(moved(robot, q, -step), moved(robot, q, step)) / (2.0 * STEP))
    return np.array(columns).T


def difference_drift(robot, state, velocity):
    """Rate of `velocity(q, v)` along the motion with constant v: what J dv is added to."""
    q, v = state.q, state.v
    step = STEP * v
    plus, minus = moved(robot, q, step), moved(robot, q, -step)
    return (velocity(plus, v) - velocity(minus, v)) / (2.0 * STEP)


def frame_placement(robot, q, name):
    """Placement of a frame by a forward kinematics of its own."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return data.oMf[robot.model.getFrameId(name)].copy()
