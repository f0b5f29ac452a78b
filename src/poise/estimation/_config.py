"""What an estimator believes of a robot's sensors and soles.

`EstimatorConfig`: all of it.
`ImuNoise`: densities of an inertial unit's noise.
`InitialDeviation`: how well the first state is known.
`ContactBelief`: when a sole is taken to be in contact.
`PayloadBelief`: how a robot may differ from its description, and what tells.
"""

from dataclasses import dataclass, field
from typing import Annotated

from poise._schema import Bounds, Duration, Positive, Ratio, Seconds, Text, checked
from poise.errors import ConfigurationError

Deviation = Annotated[float, Bounds(least=0.0, most=1e6)]
"""A standard deviation, or the density of a noise."""


@checked()
@dataclass(frozen=True, kw_only=True)
class ImuNoise:
    """Densities of an inertial unit's noise, as data sheets give them.

    White noise of standard deviation s in samples dt apart has the density s sqrt(dt).

    Attributes:
        gyro: of the angular velocity [rad/s/sqrt(Hz)].
        accelerometer: of the specific force [m/s^2/sqrt(Hz)].
        gyro_bias: of the walk of the gyro's bias [rad/s^2/sqrt(Hz)].
        accelerometer_bias: of the walk of the accelerometer's bias [m/s^3/sqrt(Hz)].
    """

    gyro: Deviation = 3e-4
    accelerometer: Deviation = 5e-3
    gyro_bias: Deviation = 1e-5
    accelerometer_bias: Deviation = 1e-4


@checked()
@dataclass(frozen=True, kw_only=True)
class InitialDeviation:
    """How well a state is known when a filter starts, as standard deviations an axis.

    Attributes:
        tilt: of the orientation about horizontal axes [rad].
        yaw: of the orientation about the vertical [rad].
        velocity: of the velocity [m/s].
        position: of the position [m].
        gyro_bias: of the gyro's bias [rad/s].
        accelerometer_bias: of the accelerometer's bias [m/s^2].
    """

    tilt: Deviation = 0.01
    yaw: Deviation = 0.0
    velocity: Deviation = 0.1
    position: Deviation = 0.0
    gyro_bias: Deviation = 0.005
    accelerometer_bias: Deviation = 0.03


@checked()
@dataclass(frozen=True, kw_only=True)
class ContactBelief:
    """When a sole is taken to be in contact, and how firmly.

    The probability of contact is a logistic function of the normal force, times one of the speed
    that kinematics and estimate give the sole.

    Attributes:
        load: normal force at which contact is as likely as not, over the robot's weight.
        load_width: how far from there its odds change by a factor of e, over the weight.
        begin: probability by force above which contact begins.
        end: probability by force below which it ends.
        speed: of the sole, at which rest is as likely as not [m/s].
        speed_width: how far from there its odds change by a factor of e [m/s].
        rest: density of the walk of a point in certain contact [m/s/sqrt(Hz)].
        turn: density of the angular velocity of a sole in certain contact [rad/s/sqrt(Hz)].
        shake: how much that grows with the angular velocity of the base: soles rock under a robot
            that is shaken, and clocks and scales of gyro and encoders differ [1/sqrt(Hz)].
        slip: density of the walk of one that slips, or is in no contact at all [m/s/sqrt(Hz)].
        gate: square of the Mahalanobis distance beyond which a sole has slipped; one in a thousand
            at rest is beyond 16.3.
        slip_time: how long it is then taken to slip on [s].
    """

    load: Ratio = 0.1
    load_width: Ratio = 0.02
    begin: Ratio = 0.7
    end: Ratio = 0.3
    speed: Positive = 0.2
    speed_width: Positive = 0.03
    rest: Deviation = 3e-3
    turn: Deviation = 2e-3
    shake: Deviation = 4e-3
    slip: Deviation = 0.3
    gate: Positive = 16.3
    slip_time: Seconds = 0.05

    def __post_init__(self) -> None:
        if self.end >= self.begin:
            raise ConfigurationError(
                "contact would end where it begins",
                got=(self.end, self.begin),
                wanted="end < begin",
            )


@checked()
@dataclass(frozen=True, kw_only=True)
class EstimatorConfig:
    """What an estimator believes of a robot's sensors.

    Attributes:
        imu: frame of the inertial unit, on the base link; at its origin, along its axes when None,
            as the plant's is.
        noise: of the inertial unit.
        start: how well the first state is known.
        encoder: deviation of the joints' angles, play and bending included [rad].
        joint_velocity: deviation of the joints' velocities [rad/s].
        point: deviation of a sole's centre as a point at rest: it rolls and sinks in [m].
        contact: when a sole is in contact.
        joint_bandwidth: cut-off frequency of a first-order low-pass on the joints' velocities [Hz];
            as measured when None.
        longest_step: time between two states that is still integrated over [s].
        ground: height of what the soles stand on at the start [m].
        tare: whether soles in the air say the zeros of their load cells, as `LoadCellTare` says;
            not where somebody else has taken those off.
        vote: replace the wrenches of faulty and missing load cells, as `LoadCellVote` does.
    """

    imu: Text | None = None
    noise: ImuNoise = field(default_factory=ImuNoise)
    start: InitialDeviation = field(default_factory=InitialDeviation)
    encoder: Deviation = 1e-4
    joint_velocity: Deviation = 0.02
    point: Deviation = 5e-4
    contact: ContactBelief = field(default_factory=ContactBelief)
    joint_bandwidth: Annotated[float, Bounds(positive=True, most=1e6, unit="Hz")] | None = None
    longest_step: Duration = 0.05
    ground: float = 0.0
    tare: bool = True
    vote: bool = True


@checked()
@dataclass(frozen=True, kw_only=True)
class PayloadBelief:
    """What a `PayloadEstimator` believes of robot and sensors.

    Attributes:
        smoothing: time constant of the low-pass that all it compares goes through [s].
        likely_mass: deviation of the mass from the description's that is likely before anything is
            known, by the robot's own.
        likely_offset: likewise of the centre of mass, along each axis [m].
        likely_held: likewise of what a hand holds, by the robot's mass.
        mass_walk: density of the walk of the mass, by the robot's own [1/sqrt(s)].
        offset_walk: density of the walk of the centre of mass [m/sqrt(s)].
        force_noise: density of the noise of what the soles measure together, by the weight
            [sqrt(s)].
        moment_noise: density of the noise of their moment about the centre of mass, by the weight
            [m sqrt(s)].
        lost_mass: most mass below the description's, by the robot's own.
        added_mass: most mass beyond it, likewise.
        offset_max: farthest that the centre of mass is along any axis [m].
        held_walk: density of the walk of what a hand holds by the way that it moves, by the robot's
            mass [1/sqrt(m)].
        held_noise: density of the noise of how the moment changes, by the weight [m sqrt(s)].
        held_max: most that a hand holds, by the robot's mass.
        held_rate: how fast what a hand is told to hold may change, by the robot's mass [1/s].
        washout: how long a moment has to stay to be the body's own [s].
        mass_rate: how fast the mass that is told may change, by the robot's own [1/s].
        offset_rate: how fast the centre of mass that is told may move [m/s].
        least_load: part of the weight below which the soles say nothing: the robot hangs, or flies.
        shock: acceleration of the centre of mass above which they say nothing either [m/s^2].
        push: force along the ground, by the weight, that neither mass nor offset explains and at
            which what the soles say counts a quarter: somebody else pushes.
    """

    smoothing: Positive = 0.25
    likely_mass: Deviation = 0.1
    likely_offset: Deviation = 0.01
    likely_held: Deviation = 0.03
    mass_walk: Deviation = 0.02
    offset_walk: Deviation = 0.004
    force_noise: Positive = 0.02
    moment_noise: Positive = 0.004
    lost_mass: Ratio = 0.4
    added_mass: Ratio = 0.6
    offset_max: Positive = 0.08
    held_walk: Deviation = 0.03
    held_noise: Positive = 0.0015
    held_max: Ratio = 0.1
    held_rate: Deviation = 0.04
    washout: Positive = 1.0
    mass_rate: Deviation = 0.1
    offset_rate: Deviation = 0.02
    least_load: Ratio = 0.3
    shock: Positive = 2.0
    push: Positive = 0.01


@checked()
@dataclass(frozen=True, kw_only=True)
class AttitudeBiasBelief:
    """What a `AttitudeBiasEstimator` believes of robot and sensors.

    Attributes:
        likely: error of the attitude that is likely before anything is known [rad].
        walk: density of its walk [rad/sqrt(s)].
        noise: density of the noise of what is measured of it [rad sqrt(s)].
        smoothing: time constant of the low-pass that all it compares goes through [s].
        shock: acceleration of the centre of mass above which soles say nothing [m/s^2].
        push: error beyond what is known at which what is measured counts a quarter: somebody
            pushes [rad].
        rate: how fast either component may change [rad/s].
        most: largest error about either axis [rad].
    """

    likely: Positive = 0.01
    walk: Deviation = 0.001
    noise: Positive = 0.004
    smoothing: Positive = 0.25
    shock: Positive = 2.0
    push: Positive = 0.01
    rate: Positive = 0.02
    most: Positive = 0.05
