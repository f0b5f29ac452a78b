"""`VelocityNumbers`: numbers of the velocity level."""

from dataclasses import dataclass

from poise.locomotion._stepping._stance import RobotSize


@dataclass(frozen=True, kw_only=True)
class VelocityNumbers:
    """Numbers of Zhang and Kikuuwe, section 3 to 5, and those that the paper leaves open."""

    acceleration_max: float  # a_lim [m/s^2]
    r_lift: float  # distance of ZMP and reference at which a foot may leave the ground [m]
    capture_max: float  # largest distance of the DCM from the stance foot at lift-off [m]
    ct_zmp_max: float  # largest distance of the CT-ZMP from there [m]
    w_L: float  # weight of the angular momentum in single support
    lift_speed: float  # largest vertical speed of the COM [m/s]
    lift_acceleration: float  # largest vertical acceleration of the COM [m/s^2]
    shift_time: float = 0.01  # time for which a weight shift has to be complete [s]
    k_omega: float = 10.0  # gain of the angular velocities [1/s]
    omega_lim: float = 0.8  # largest angular velocity [rad/s]
    k_level: float = 8.0  # gain with which a stance sole is levelled [1/s]
    w_B: float = 100.0  # weight of the torso's angular velocity in double support
    w_B1: float = 3.0  # the same in single support
    w_S1: float = 30.0  # weight of the swing foot's velocity
    w_S2: float = 1e4  # weight of the other foot's velocity in double support
    epsilon: float = 1e-3  # weight of what should not count
    tilt_soft: float = 0.2  # tilt of the torso at which its attitude weighs twice as much [rad]
    momentum_leak: float = 5.0  # decay of the desired angular momentum [1/s]
    velocity_leak: float = 5.0  # decay of the commanded COM velocity into the measured one [1/s]


def velocity_numbers(size: RobotSize) -> VelocityNumbers:
    """Scale the numbers from the paper's robot: 65 kg, feet 0.42 m apart.

    The first swing of the ZMP, a_lim / omega^2, keeps its ratio to the COM's height; `r_lift` keeps
    its ratio to the distance of the feet, within half a sole. Angular momentum weighs as much as
    the paper's beside the swing foot's velocity: it goes with m h.
    """
    return VelocityNumbers(
        acceleration_max=size.by_stiffness(0.8 * size.tall),
        r_lift=min(0.12 * size.apart / 0.42, size.half_sole),
        capture_max=0.06 * size.wide,
        ct_zmp_max=0.12 * size.wide,
        w_L=(65.0 / size.mass / size.tall) ** 2,
        lift_speed=0.3 * size.tall,
        lift_acceleration=1.5 * size.tall,
    )
