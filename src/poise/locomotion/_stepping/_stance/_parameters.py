"""`TeleopParameters`: settings of the step teleoperator."""

from dataclasses import dataclass

from poise._schema import Positive, checked
from poise.errors import ConfigurationError

_REMOVED = {
    name: replacement
    for names, replacement in (
        (
            "acceleration_max r_lift k_omega k_level omega_lim w_B w_S1 w_S2 w_L w_B1 epsilon "
            "momentum_leak capture_max ct_zmp_max shift_time tilt_soft velocity_leak lift_speed "
            "lift_acceleration",
            "none: the velocity level has the paper's number, scaled to the robot",
        ),
        (
            "v_lim clear_height support_margin touch_speed press_speed feet_gap fold_min",
            "none: it follows from the robot's CoM height and soles",
        ),
        (
            "k_v land_load unload_load unload_time shift_timeout zmp_time swing_time knee_min "
            "reach_margin",
            "none: it is the same for every robot",
        ),
        ("servo_stiffness servo_damping", "servo_gains of the StepTeleoperator"),
    )
    for name in names.split()
}


@checked(removed=_REMOVED)
@dataclass(frozen=True, kw_only=True)
class TeleopParameters:
    """Settings of the step teleoperator; the defaults are for `biped20`, at velocity level.

    `teleop_parameters` makes those of another robot, or of one that is commanded torques;
    `dataclasses.replace` changes some of them.

    Attributes:
        dt: T, length of a tick [s].
        kp: k_p of the COM shifter; by torques, the gain kp / omega of the DCM feedback [1/s^2].
        lift_height: height of a device above its foot that lifts the foot [m].
        lower_height: height below which a device counts as lowered again [m].
        press_depth: greatest depth below the ground to which a foot can be commanded [m].
        lower_speed: largest speed of a foot downwards [m/s].
        stoop_max: largest descent of the COM for the legs to reach, over its height.
        step_max: largest distance of the feet forward or sideways that can be commanded [m].
        lift_max: largest height of a foot above the other that can be commanded [m].
        hand_scale: motion of a hand over that of its device.
    """

    dt: Positive = 0.005
    kp: Positive = 40.0
    lift_height: Positive = 0.02
    lower_height: Positive = 0.01
    press_depth: Positive = 0.08
    lower_speed: Positive = 0.3
    stoop_max: Positive = 0.2
    step_max: Positive = 0.46
    lift_max: Positive = 0.46
    hand_scale: Positive = 1.0

    def __post_init__(self) -> None:
        if not self.lower_height < self.lift_height:
            raise ConfigurationError(
                "a device counts as lowered higher up than as lifted",
                got=(self.lower_height, self.lift_height),
                wanted="lower_height < lift_height",
            )
