"""`TeleopStatus`: how the last tick of the step teleoperator stood."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from poise.locomotion._stepping._operator import (
    NOWHERE,
    DeviceStatus,
    OperatorSample,
    Vector,
)
from poise.locomotion._stepping._upper_body import HandStatus
from poise.locomotion._support import Rotation, Vector2, Vector3
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
    zmp: Vector2
    zmp_reference: Vector2
    cart_table_zmp: Vector2
    com: Vector3
    soles: tuple[Vector3, Vector3]
    target: Vector3 | None
    loads: Vector2
    tilt: float
    heading: float = 0.0
    hands: tuple[HandStatus, ...] = ()
    hand_targets: tuple[Vector3, ...] = ()
    hand_rotations: tuple[Rotation | None, ...] = ()
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
        left, right = (None, None) if sample is None else (sample.place(0), sample.place(1))
        return {
            **{f"planned/{sole}": float(support in (None, i)) for i, sole in enumerate(soles)},
            **{f"target/{hand}": at for hand, at in zip(hands, self.hand_targets, strict=True)},
            "target/left device": _place(left),
            "target/right device": _place(right),
            "foot_target": _place(self.target),
            "zmp_reference": self.zmp_reference,
            "estimate/zmp": self.zmp,
            "estimate/cart_table_zmp": self.cart_table_zmp,
            "estimate/com": self.com,
            "estimate/soles": np.array(self.soles),
            "estimate/loads": self.loads,
            "estimate/tilt": self.tilt,
            "mode": self.mode.name,
            "device": self.device.name,
            "hands": ", ".join([hand.name for hand in self.hands]),
            "gaze": "" if self.gaze is None else self.gaze.name,
            "step_end": "" if self.ended is None else self.ended.name,
        }


def _place(place: Vector | Vector3 | None) -> Vector3:
    return np.array(NOWHERE if place is None else place)
