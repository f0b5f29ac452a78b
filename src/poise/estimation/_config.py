"""Beliefs of an estimator about a robot's sensors, soles and masses."""

from dataclasses import dataclass, field
from typing import Annotated

from poise._schema import Bounds, Duration, Positive, Ratio, Seconds, Text, checked
from poise.errors import ConfigurationError

Deviation = Annotated[float, Bounds(least=0.0, most=1e6)]
"""A standard deviation, or the density of a noise."""


LONGEST_STEP = 0.05
"""Longest time between two states over which velocity is extrapolated [s]."""


@checked()
@dataclass(frozen=True, kw_only=True)
class ImuNoise:
    """Densities of an inertial unit's noise, as data sheets give them.

    White noise of standard deviation s in samples dt apart has the density s sqrt(dt).
    """

    gyro: Deviation = 3e-4  # of the angular velocity [rad/s/sqrt(Hz)]
    accelerometer: Deviation = 5e-3  # of the specific force [m/s^2/sqrt(Hz)]
    gyro_bias: Deviation = 1e-5  # of the walk of the gyro's bias [rad/s^2/sqrt(Hz)]
    accelerometer_bias: Deviation = 1e-4  # of the walk of its bias [m/s^3/sqrt(Hz)]


@checked()
@dataclass(frozen=True, kw_only=True)
class InitialDeviation:
    """Standard deviations of a state, an axis each, when a filter starts."""

    tilt: Deviation = 0.01  # of the orientation about horizontal axes [rad]
    yaw: Deviation = 0.0  # of the orientation about the vertical [rad]
    velocity: Deviation = 0.1  # [m/s]
    position: Deviation = 0.0  # [m]
    gyro_bias: Deviation = 0.005  # [rad/s]
    accelerometer_bias: Deviation = 0.03  # [m/s^2]


@checked()
@dataclass(frozen=True, kw_only=True)
class ContactBelief:
    """Thresholds of contact of a sole, and noise of its velocity.

    The probability of contact is a logistic function of the normal force, times one of the speed
    that kinematics and estimate give the sole. `shake` is there because soles rock under a robot
    that is shaken, and clocks and scales of gyro and encoders differ.
    """

    load: Ratio = 0.1  # normal force of even odds, over the robot's weight
    load_width: Ratio = 0.02  # change of force by which odds change by e, over the weight
    begin: Ratio = 0.7  # probability by force above which contact begins
    end: Ratio = 0.3  # probability by force below which it ends
    speed: Positive = 0.2  # of the sole, of even odds of rest [m/s]
    speed_width: Positive = 0.03  # change of speed by which odds change by e [m/s]
    # densities of the walk of a point in certain contact, and of one that slips or is in no
    # contact [m/s/sqrt(Hz)]
    rest: Deviation = 3e-3
    slip: Deviation = 0.3
    turn: Deviation = 2e-3  # density of a resting sole's angular velocity [rad/s/sqrt(Hz)]
    shake: Deviation = 4e-3  # growth of `turn` with the base's angular velocity [1/sqrt(Hz)]
    # square of the Mahalanobis distance beyond which a sole slips: 16.3 for one in a thousand
    gate: Positive = 16.3
    slip_time: Seconds = 0.05  # duration of a slip once found [s]

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
    """Beliefs of a `StateEstimator` about a robot's sensors.

    Without `tare` zeros of the load cells count as taken off already, without `vote` all cells
    count as sound.
    """

    # frame of the inertial unit, on the base link; the base's own where None, as the plant's
    imu: Text | None = None
    noise: ImuNoise = field(default_factory=ImuNoise)  # of the inertial unit
    start: InitialDeviation = field(default_factory=InitialDeviation)  # of the first state
    encoder: Deviation = 1e-4  # of the joints' angles, play and bending included [rad]
    joint_velocity: Deviation = 0.02  # of the joints' velocities [rad/s]
    point: Deviation = 5e-4  # of a sole's centre as a point at rest: it rolls and sinks in [m]
    contact: ContactBelief = field(default_factory=ContactBelief)
    # cut-off frequency of a first-order low-pass on the joints' velocities; none where None [Hz]
    joint_bandwidth: Annotated[float, Bounds(positive=True, most=1e6, unit="Hz")] | None = None
    longest_step: Duration = LONGEST_STEP  # longest time between two states to integrate over [s]
    ground: float = 0.0  # height of the ground under the soles at the start [m]
    tare: bool = True  # learn the zeros of load cells in the air, by `LoadCellTare`
    vote: bool = True  # replace wrenches of faulty and missing cells, by `LoadCellVote`


@checked()
@dataclass(frozen=True, kw_only=True)
class PayloadBelief:
    """Beliefs of a `PayloadEstimator` about robot and sensors.

    Masses are by the robot's mass, forces by its weight. `push` is a force along the ground that
    nothing else explains, and at which measurements count a quarter: something pushes.
    """

    smoothing: Positive = 0.25  # time constant of the low-pass on all that is compared [s]
    least_load: Ratio = 0.3  # of the soles, below which nothing is learned
    shock: Positive = 2.0  # acceleration of the CoM above which nothing is learned [m/s^2]
    push: Positive = 0.01
    force_noise: Positive = 0.02  # density of the noise of the soles' force [sqrt(s)]
    moment_noise: Positive = 0.004  # of their moment about the CoM [m sqrt(s)]
    # the mass, against the description's: initial deviation, density of its walk [1/sqrt(s)],
    # bounds of loss and gain, and largest rate of the output [1/s]
    likely_mass: Deviation = 0.1
    mass_walk: Deviation = 0.02
    lost_mass: Ratio = 0.4
    added_mass: Ratio = 0.6
    mass_rate: Deviation = 0.1
    # the CoM along each axis: the same [m, m/sqrt(s), m, m/s]
    likely_offset: Deviation = 0.01
    offset_walk: Deviation = 0.004
    offset_max: Positive = 0.08
    offset_rate: Deviation = 0.02
    # masses in the hands: the same, the random walk over the distance that the hand moves
    # [1/sqrt(m)], the noise of changes of the moment [m sqrt(s)], and the time for which a
    # moment has to stay to be the body's [s]
    likely_held: Deviation = 0.03
    held_walk: Deviation = 0.03
    held_noise: Positive = 0.0015
    held_max: Ratio = 0.1
    held_rate: Deviation = 0.04
    washout: Positive = 1.0
    # the error of the attitude about either axis: the same, and the noise of horizontal forces
    # [rad, rad/sqrt(s), rad sqrt(s), rad, rad/s]
    likely_tilt: Positive = 0.01
    tilt_walk: Deviation = 0.001
    tilt_noise: Positive = 0.004
    tilt_max: Positive = 0.05
    tilt_rate: Positive = 0.02
