"""`TeleopParameters`: every number of the step teleoperator."""

from dataclasses import dataclass

from poise._schema import Positive, checked
from poise.errors import ConfigurationError


@checked()
@dataclass(frozen=True, kw_only=True)
class TeleopParameters:
    """Numbers of the step teleoperator; the defaults are for `biped20`, at velocity level.

    Names and values are those of Zhang and Kikuuwe, section 3 to 5, where they have one; the others
    stand for what the paper leaves open, see docs/teleoperation.md. `r_lift` is the paper's 0.12 m,
    scaled to the feet of `biped20`. Another robot has others, and so has one that is commanded
    torques: `teleop_parameters` makes them, `dataclasses.replace` changes some of those.

    Attributes:
        dt: T, length of a tick [s].
        kp: k_p of the COM shifter; by torques, the gain kp / omega of the DCM feedback [1/s^2].
        acceleration_max: a_lim, where velocities are commanded [m/s^2].
        r_lift: distance of ZMP and reference at which a foot may leave the ground [m].
        k_v: gain of the linear velocities [1/s].
        k_omega: gain of the angular velocities [1/s].
        k_level: gain with which a stance sole is levelled [1/s].
        v_lim: largest linear velocity [m/s].
        omega_lim: largest angular velocity [rad/s].
        w_B: weight of the torso's angular velocity in double support.
        w_S1: weight of the swing foot's velocity in single support.
        w_S2: weight of the other foot's velocity in double support.
        w_L: weight of the angular momentum in single support.
        w_B1: weight of the torso's angular velocity in single support.
        epsilon: weight of what should not count.
        momentum_leak: how fast the desired angular momentum is forgotten [1/s].
        capture_max: largest distance of the divergent component from the support foot's centre at
            which the other foot may leave the ground [m].
        ct_zmp_max: largest distance of the CT-ZMP from there at which it may [m].
        shift_time: how long all this must hold [s].
        lift_height: how far a device is lifted to lift its foot [m].
        lower_height: how far it may be above the ground to count as lowered again [m].
        land_load: load at which a foot in the air has landed, over the weight.
        unload_load: load below which a foot counts as in the air, over the weight.
        unload_time: how long it must be [s].
        press_depth: how far below the ground the operator may command a foot [m].
        shift_timeout: how long a shift may take before both feet are given back [s].
        zmp_time: time constant with which the measured ZMP is smoothed [s].
        clear_height: height from which on a foot in the air is not held firmly [m].
        swing_time: time constant with which the swing foot's velocity is smoothed [s].
        support_margin: how far from the soles' edge the CT-ZMP is kept [m].
        lift_speed: largest vertical speed of the COM [m/s].
        lift_acceleration: largest vertical acceleration of the COM [m/s^2].
        lower_speed: largest speed of a foot downwards [m/s].
        touch_speed: largest speed of a foot downwards at the height of the ground [m/s].
        tilt_soft: tilt of the torso at which its attitude weighs twice as much [rad].
        velocity_leak: how fast the COM's commanded velocity leaks into the measured one [1/s].
        press_speed: largest speed of a foot without load downwards in double support [m/s].
        knee_min: least bend of a knee; straighter the leg is singular [rad].
        reach_margin: fraction of the leg's length that a foot command stays short of.
        stoop_max: how far the COM may come down for the legs to reach, over its height.
        fold_min: least distance of hip and ankle of a leg that carries, over its length.
        step_max: largest distance of the feet forward or sideways that can be commanded [m].
        lift_max: how far above the other foot one can be commanded [m].
        servo_stiffness: of the joints' servos where velocities are commanded: torque at 1 rad of
            error, over the torque limit [1/rad].
        servo_damping: likewise, torque at 1 rad/s of error, over the torque limit [s/rad].
        feet_gap: least distance of the soles' edges, side by side [m].
        hand_scale: motion of a hand over that of its device.
    """

    dt: Positive = 0.005
    kp: Positive = 40.0
    acceleration_max: Positive = 0.8
    r_lift: Positive = 0.08
    k_v: Positive = 10.0
    k_omega: Positive = 10.0
    k_level: Positive = 8.0
    v_lim: Positive = 1.0
    omega_lim: Positive = 0.8
    w_B: Positive = 100.0
    w_S1: Positive = 30.0
    w_S2: Positive = 1e4
    w_L: Positive = 1.0
    w_B1: Positive = 3.0
    epsilon: Positive = 1e-3
    momentum_leak: Positive = 5.0
    capture_max: Positive = 0.06
    ct_zmp_max: Positive = 0.12
    shift_time: Positive = 0.01
    lift_height: Positive = 0.02
    lower_height: Positive = 0.01
    land_load: Positive = 0.047
    unload_load: Positive = 0.0235
    unload_time: Positive = 0.02
    press_depth: Positive = 0.08
    shift_timeout: Positive = 3.0
    zmp_time: Positive = 0.01
    clear_height: Positive = 0.04
    swing_time: Positive = 0.05
    support_margin: Positive = 0.02
    lift_speed: Positive = 0.3
    lift_acceleration: Positive = 1.5
    lower_speed: Positive = 0.3
    touch_speed: Positive = 0.15
    tilt_soft: Positive = 0.2
    velocity_leak: Positive = 5.0
    press_speed: Positive = 0.1
    knee_min: Positive = 0.08
    reach_margin: Positive = 0.02
    stoop_max: Positive = 0.2
    fold_min: Positive = 0.5
    feet_gap: Positive = 0.01
    step_max: Positive = 0.46
    lift_max: Positive = 0.46
    servo_stiffness: Positive = 70.0
    servo_damping: Positive = 2.5
    hand_scale: Positive = 1.0

    def __post_init__(self) -> None:
        if not self.lower_height < self.lift_height:
            raise ConfigurationError(
                "a device counts as lowered higher up than as lifted",
                got=(self.lower_height, self.lift_height),
                wanted="lower_height < lift_height",
            )
        if not self.unload_load < self.land_load < 0.5:
            raise ConfigurationError(
                "loads of lifting and landing do not fit",
                got=(self.unload_load, self.land_load),
                wanted="unload_load < land_load < 0.5",
            )
