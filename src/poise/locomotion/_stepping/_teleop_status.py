"""`TeleopStatus`: how the last tick of the step teleoperator stood."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float64

from poise.locomotion._stepping._operator import DeviceStatus, OperatorSample
from poise.locomotion._stepping._upper_body import HandStatus
from poise.locomotion._walking import Mode, StepEnd


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TeleopStatus:
    """State of the last tick.

    Attributes:
        mode: which feet carry the robot.
        device: what became of the operator's last sample.
        sample: what the device gave in this tick; None for nothing.
        zmp: measured, x and y [m].
        zmp_reference: where it should be, x and y [m].
        cart_table_zmp: CT-ZMP, x and y [m].
        com: estimated [m].
        soles: where the soles are, left and right [m].
        target: where the swing foot is sent, None with both on the ground [m].
        loads: normal forces, left and right [N].
        tilt: angle of the torso against upright [rad].
        heading: of the pelvis, to the left of the world's x axis [rad].
        hands: what each hand does.
        hand_targets: where each hand is led to [m].
        hand_rotations: how each is led to be turned, world_R_hand; None for one that is not.
        gaze: what the head does; None where nothing can turn it.
        ended: how the operator's last step ended; None while one goes on, and before the first.
    """

    mode: Mode
    device: DeviceStatus = DeviceStatus.OK
    sample: OperatorSample | None
    zmp: Float64[np.ndarray, "2"]
    zmp_reference: Float64[np.ndarray, "2"]
    cart_table_zmp: Float64[np.ndarray, "2"]
    com: Float64[np.ndarray, "3"]
    soles: tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]
    target: Float64[np.ndarray, "3"] | None
    loads: Float64[np.ndarray, "2"]
    tilt: float
    heading: float = 0.0
    hands: tuple[HandStatus, ...] = ()
    hand_targets: tuple[Float64[np.ndarray, "3"], ...] = ()
    hand_rotations: tuple[Float64[np.ndarray, "3 3"] | None, ...] = ()
    gaze: HandStatus | None = None
    ended: StepEnd | None = None

    def signals(
        self, soles: Sequence[str], hands: Sequence[str]
    ) -> Mapping[str, np.ndarray | float | str]:
        """The same by name, as a recorder keeps it.

        What is estimated is under `estimate/`, for `com` and `zmp` are the plant's.

        Args:
            soles: names of the soles, left and right.
            hands: names of the hands.
        """
        support, sample = self.mode.support if self.mode.single else None, self.sample
        values = (
            float(support in (None, 0)),
            float(support in (None, 1)),
            *self.hand_targets,
            _NOWHERE if sample is None else np.array(sample.place(0)),
            _NOWHERE if sample is None else np.array(sample.place(1)),
            _NOWHERE if self.target is None else self.target,
            self.zmp_reference,
            self.zmp,
            self.cart_table_zmp,
            self.com,
            np.array(self.soles),
            self.loads,
            self.tilt,
            self.mode.name,
            self.device.name,
            ", ".join([hand.name for hand in self.hands]),
            "" if self.gaze is None else self.gaze.name,
            "" if self.ended is None else self.ended.name,
        )
        return dict(zip(_signal_names(tuple(soles), tuple(hands)), values, strict=True))


_NOWHERE = np.full(3, np.nan)


@cache
def _signal_names(soles: tuple[str, ...], hands: tuple[str, ...]) -> tuple[str, ...]:
    return (
        *(f"planned/{sole}" for sole in soles),
        *(f"target/{hand}" for hand in hands),
        "target/left device",
        "target/right device",
        "foot_target",
        "zmp_reference",
        "estimate/zmp",
        "estimate/cart_table_zmp",
        "estimate/com",
        "estimate/soles",
        "estimate/loads",
        "estimate/tilt",
        "mode",
        "device",
        "hands",
        "gaze",
        "step_end",
    )
