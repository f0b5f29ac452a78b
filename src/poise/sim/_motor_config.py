"""`MotorConfig`: the drives of a simulated robot, and those of a Unitree G1."""

import math
import re
from dataclasses import dataclass
from typing import Annotated

from poise._schema import Bounds, Seconds, Text, Vector, checked
from poise.errors import ConfigurationError

PERIOD = 1e-4
"""Period of the drives' loops [s]: Unitree's developers give 10 to 20 kHz (unitree_legged_sdk)."""

_Positive = Annotated[float, Bounds(positive=True, most=1e6)]
_Torque = Annotated[float, Bounds(least=0.0, most=1e6, unit="N m")]
_Rates = Annotated[tuple[float, float], Vector(2, Bounds(most=1e3))]

_COUNTS = 2**15  # a rotor turn in messages of GO-M8010-6 (unitree_actuator_sdk), another motor
_CYCLES = 6 * 14  # order 6 of three phases, 14 pole pairs as LK MG5010 and MG6012, other motors
# Breakaway over peak torque, all of it taken as cogging: 0.37 N m of 60 N m of PULSE115-60, an
# actuator of another maker (Pérez-Díaz et al. 2024, "Design and Experimental Characterisation")
_RIPPLE = 0.37 / 60.0


@checked()
@dataclass(frozen=True, kw_only=True)
class Motor:
    """One kind of motor with its gear, torques and friction at the output, and its joints."""

    joints: Text  # regular expression that matches the whole names of its joints
    gear: _Positive = 1.0  # turns of the rotor in one of the output
    # Largest torque of the drive [N m]; the robot's limit of the joint when None
    limit: Annotated[float, Bounds(positive=True, most=1e6, unit="N m")] | None = None
    friction: _Torque = 0.0  # Coulomb friction [N m]
    # Viscous friction [N m s/rad]
    damping: Annotated[float, Bounds(least=0.0, most=1e6, unit="N m s/rad")] = 0.0
    # Amplitude of the torque ripple, A sin(cycles gear angle of the output) [N m]
    ripple: _Torque = 0.0
    cycles: _Positive = 1.0  # of the ripple in one turn of the rotor
    # Smallest step of the encoder of the rotor [rad]; none when zero
    resolution: Annotated[float, Bounds(least=0.0, most=math.tau, unit="rad")] = 0.0

    def __post_init__(self) -> None:
        try:
            re.compile(self.joints)
        except re.error as error:
            wrong = f"joints of a motor: {error}"
            wanted = "a regular expression"
            raise ConfigurationError(wrong, got=self.joints, wanted=wanted) from None


@checked()
@dataclass(frozen=True, kw_only=True)
class Linkage:
    """Two motors that drive two joints together, as a linear map about the home posture.

    With the velocities of the joints dq the motors turn at w = R dq, and their torques t make
    torques tau = R^T t of the joints. Set-points are of the joints. The first motor is the one
    named after the first joint.
    """

    joints: tuple[Text, Text]  # names of the two joints
    rates: tuple[_Rates, _Rates]  # rows of R: turns of each motor in one of each joint

    def __post_init__(self) -> None:
        (a, b), (c, d) = self.rates
        if a * d == b * c or self.joints[0] == self.joints[1]:
            wrong = "a linkage needs two joints, which its motors move independently"
            raise ConfigurationError(wrong, got=(self.joints, self.rates))


@checked()
@dataclass(frozen=True, kw_only=True)
class MotorConfig:
    """Drives whose loops run at 10 kHz, with what commands and measurements suffer on the way."""

    motors: tuple[Motor, ...]  # each joint has the first one that matches its name
    linkages: tuple[Linkage, ...] = ()
    latency: Seconds = 0.0  # from a command to its arrival at the drives [s]
    jitter: Seconds = 0.0  # what a command is later than that at most, evenly distributed [s]
    # Cut-off frequency of the drives' low-pass filter of velocities, which are differences of
    # positions in 0.1 ms [Hz]; no filter when None
    velocity_bandwidth: Annotated[float, Bounds(positive=True, most=1e6, unit="Hz")] | None = None

    @classmethod
    def g1(cls) -> "MotorConfig":
        """Drives of a Unitree G1 with 29 joints.

        Gears, peak torques and frictions are those of Unitree's simulations (unitree_rl_lab,
        unitree_actuators.py: N7520-14.3, N7520-22.5, N5020-16, W4010-25). Ripple, encoder and
        velocity filter are of other motors; no figures of these are published.
        """
        hips = "(left|right)_hip_(pitch|yaw)_joint|waist_yaw_joint"
        knees = "(left|right)_(hip_roll|knee)_joint"
        wrists = "(left|right)_wrist_(pitch|yaw)_joint"
        # Motors A and B turn with the pitch and against one another with the roll, at a rate of 1:
        # both reach 2 x 25 N m then, the 50 N m of the first G1's ankles (unitree_mujoco, g1.xml),
        # and the circle within that has 50 / sqrt(2) N m, the 35 N m of later descriptions.
        pairs = ("left_ankle_pitch", "left_ankle_roll"), ("right_ankle_pitch", "right_ankle_roll")
        return cls(
            motors=(
                _motor(hips, 4.5 * (48.0 / 22.0 + 1.0), limit=71.0, friction=1.6, damping=0.16),
                _motor(knees, 22.5, limit=111.0, friction=2.4, damping=0.24),
                _motor(wrists, 25.0, limit=4.8, friction=0.6, damping=0.06),
                _motor(".*", 16.0, limit=24.8, friction=0.6, damping=0.06),
            ),
            linkages=tuple(
                Linkage(joints=(f"{first}_joint", f"{second}_joint"), rates=((1, 1), (1, -1)))
                for first, second in (*pairs, ("waist_pitch", "waist_roll"))
            ),
            # A command waits for a cycle of the motors' bus and travels for one: 1 kHz on Go1,
            # another robot (remarks of the developers of unitree_legged_sdk).
            latency=1e-3,
            jitter=1e-3,
            velocity_bandwidth=400.0,  # of moteus (motor_position.h, pll_filter_hz), another drive
        )


def _motor(joints: str, gear: float, *, limit: float, friction: float, damping: float) -> Motor:
    """Motor with the figures that those of a G1 share."""
    return Motor(
        joints=joints,
        gear=gear,
        limit=limit,
        friction=friction,
        damping=damping,
        ripple=_RIPPLE * limit,
        cycles=_CYCLES,
        resolution=math.tau / _COUNTS,
    )
