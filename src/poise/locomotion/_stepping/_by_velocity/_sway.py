"""Sway on one foot of a robot whose velocities are commanded, through its servos."""

import math

import numpy as np

from poise._checks import checked_number
from poise.dynamics import Dynamics
from poise.errors import ConfigurationError
from poise.locomotion._pendulum import ComShifter
from poise.locomotion._stepping._stance import Biped, leg_joints
from poise.locomotion._support import Vector2

_GROWTH_MAX = 0.5
"""Sway may grow by e in no less than two seconds, for which a foot is in the air [1/s]."""

_WAYS = ("forward", "sideways")


def sway_stiffness(
    biped: Biped, dynamics: Dynamics, foot: int, stiffness: float
) -> tuple[Vector2, tuple[str, str]]:
    """Return the stiffness with which the servos of one leg hold the COM along the ground.

    A force F on the COM asks each joint j of the leg that stands for the torque G_j F, with G the
    COM's Jacobian while the sole rests; joints give way one after the other, so
    1 / K = sum G_j^2 / k_j.
    """
    robot = biped.robot
    joints = np.array(leg_joints(robot, biped.soles[foot]))
    columns = robot.base_dofs + joints
    sole = dynamics.frame(biped.frames[foot]).jacobian
    base = np.linalg.solve(sole[:, : robot.base_dofs], sole[:, columns])
    moved = dynamics.com_jacobian[:2]
    rates = moved[:, columns] - moved[:, : robot.base_dofs] @ base
    gives = rates**2 / (stiffness * robot.tau_max[joints])
    first, second = (robot.joint_names[joints[int(np.argmax(row))]] for row in gives)
    return 1.0 / gives.sum(axis=1), (first, second)


def sway_growth(stiffness: float, damping: float, shifter: ComShifter, leak: float) -> float:
    """Return the growth of sway on one foot under the COM shifter; negative where it decays [1/s].

    The COM p of mass m over a sole at rest is an inverted pendulum on the servos' spring. They
    follow the integral P of the commanded velocity V, which the shifter (37) makes of p, with the
    leak lambda into the measured velocity:

        p'' = omega^2 p - (k / m) (p - P) - (d / m) (p' - V)      P' = V
        V'  = -k_p p - k_d V + lambda (p' - V)

    Soft servos are late, and a shifter that brakes late overshoots.
    """
    loop = np.array([
        [0.0, 1.0, 0.0, 0.0],
        [shifter.omega**2 - stiffness, -damping, stiffness, damping],
        [0.0, 0.0, 0.0, 1.0],
        [-shifter.kp, leak, 0.0, -shifter.kd - leak],
    ])  # fmt: skip
    return float(np.linalg.eigvals(loop).real.max())


def check_sway(
    biped: Biped, dynamics: Dynamics, shifter: ComShifter, gains: tuple[float, float], leak: float
) -> None:
    """Refuses a robot that the COM shifter would throw over through servos that are too soft."""
    robot = biped.robot
    gain = checked_number(gains[0], "stiffness of the servos [1/rad]", above=0.0)
    damping = checked_number(gains[1], "damping of the servos [s/rad]")
    for foot, sole in enumerate(biped.soles):
        stiffnesses, weakest = sway_stiffness(biped, dynamics, foot, gain)
        for way, stiffness, joint in zip(_WAYS, stiffnesses / robot.mass, weakest, strict=True):
            held, omega = float(stiffness), shifter.omega
            growth = sway_growth(held, held * damping / gain, shifter, leak)
            if growth > _GROWTH_MAX:
                torque = float(robot.tau_max[robot.joint_names.index(joint)])
                raise ConfigurationError(
                    f"robot {robot.name!r} cannot be stepped by joint velocities: standing on "
                    f"{sole} it would sway {way} ever more, its servos too soft for the COM "
                    "shifter",
                    got=f"sway that grows by {growth:.2g} /s, servos that hold the COM at "
                    f"{math.sqrt(stiffness):.1f} rad/s over a pendulum of {omega:.1f}; what gives "
                    f"way most is {joint}, {torque:.3g} N m",
                    wanted=f"at most {_GROWTH_MAX:g} /s: actuation 'torque', which needs no "
                    f"servos; stronger joints; or servo_gains above {gain:g} /rad, if so they are",
                )
