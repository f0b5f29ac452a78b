"""`robot_digest`: tells one robot from another of the same name."""

import hashlib

from poise.robots import Robot

_DIGITS = 6
"""Digits that count: another machine may read the last ones of a file otherwise."""


def robot_digest(robot: Robot) -> str:
    """The first letters of a digest of joints, masses, limits, soles and home of a robot.

    Args:
        robot: one that carries something, or was changed, has another one.
    """
    model = robot.model
    numbers = [model.armature, robot.q_home, robot.q_min, robot.q_max, robot.v_max, robot.tau_max]
    numbers += [inertia.toDynamicParameters() for inertia in model.inertias]
    for placement in model.jointPlacements:
        numbers += [placement.translation, placement.rotation.ravel()]
    numbers += [[sole.length, sole.width] for sole in robot.soles.values()]
    # Adding zero takes the sign from zeros.
    text = " ".join(f"{float(x) + 0.0:.{_DIGITS}g}" for row in numbers for x in row)
    names = " ".join((*model.names, *robot.soles, *robot.hands))
    return hashlib.sha256(f"{names} {text}".encode()).hexdigest()[:16]
