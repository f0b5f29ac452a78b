"""Levels of the operational space formulation: hands that ask for more cost no higher level."""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

import poise

_FACTORS = (1.0, 5.0, 10.0)
"""Factors on the hands' first reference accelerations."""

_HANDS = 2.0
"""Standard deviation of the hands' reference accelerations at first [m/s^2, rad/s^2]."""

_SPREAD, _SPEED = 0.05, 0.1
"""Standard deviations of a state from home, and of its velocity [m, rad; m/s, rad/s]."""


def osf_levels(states: int = 1000, seed: int = 0) -> dict[str, float]:
    """Ask the hands of G1 for 1, 5 and 10 times the same, at random states.

    The residual of a level is what it misses over what it asks for, or over one where that is
    less, as in `Command.residuals`.
    """
    robot, rng = poise.load_robot("g1"), np.random.default_rng(seed)
    default = poise.default_stack(robot)
    stack = poise.Stack(
        default.contacts, default.levels, torque_limit=default.torque_limit, softening=0.0
    )
    controller = poise.OperationalSpaceController(robot, stack)
    hands = [stack.task(f"{hand} pose") for hand in robot.hands]
    found = {"contacts": 0.0, "balance": 0.0, "bounded": 0.0, "missed": 0.0}
    for _ in range(states):
        state = _draw_state(robot, rng)
        asked = [_HANDS * rng.normal(size=hand.dim) for hand in hands]
        first: tuple[float, float] | None = None
        for factor in _FACTORS:
            for hand, reference in zip(hands, asked, strict=True):
                hand.set_acceleration(factor * reference)
            command = controller.step(state)
            assert command.acceleration is not None
            contacts, balance = _miss_of_contacts(stack, command.acceleration), command.residuals[2]
            first = first or (contacts, balance)
            found["contacts"] = max(found["contacts"], contacts - first[0])
            found["balance"] = max(found["balance"], balance - first[1])
            found["missed"] = max(found["missed"], balance)
        found["bounded"] += controller.strategy.forces.bounded
    return found


def _draw_state(robot: poise.Robot, rng: np.random.Generator) -> poise.RobotState:
    offset, v = _SPREAD * rng.normal(size=robot.nv), _SPEED * rng.normal(size=robot.nv)
    q = pin.integrate(robot.model, robot.q_home, offset)
    q[-robot.nj :] = np.clip(q[-robot.nj :], robot.q_min, robot.q_max)
    return poise.RobotState(q, v)


def _miss_of_contacts(stack: poise.Stack, acceleration: Float64[np.ndarray, " nv"]) -> float:
    wanted = np.concatenate([c.reference - c.drift for c in stack.contacts])
    moved = np.concatenate([c.jacobian @ acceleration for c in stack.contacts])
    return float(np.linalg.norm(moved - wanted) / max(1.0, np.linalg.norm(wanted)))
