"""`Snapshot`: how the robot stands, as the page shows it, some 25 times a second."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from poise.locomotion import DeviceStatus, HandStatus, Mode


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Snapshot:
    """One moment of a live run; positions in the drawn world, which is the simulator's.

    Attributes:
        time: of the robot [s].
        mode: which feet carry the robot.
        device: what became of the operator's last sample.
        zmp: measured, x and y [m].
        zmp_reference: of it [m].
        com: estimated [m].
        soles: left and right [m].
        handles: where the operator holds the left and the right foot [m].
        target: where the foot in the air is sent [m].
        polygon: the support polygon's corners, counter-clockwise [m].
        margin: of the ZMP to the polygon's nearest edge, negative outside [m].
        loads: on the soles, left and right [N].
        tilt: of the torso, or of the base of a robot that is driven [rad].
        bodies: where each body of the simulator is [m].
        turns: and how it is turned, (w, x, y, z).
        fallen: whether the robot fell.
        paused: whether time stands still.
        speed: robot time over wall-clock time that is asked for.
        real_time_factor: what the last second reached of that speed.
        take: name of the recording.
        heading: where the torso faces, along which hands are led, to the left of the world's x axis
            [rad].
        hands: where the hands are led to, left and right; no rows where none is led [m].
        hands_do: what they do.
        hand_turns: how they are led to be turned, world_R_hand; None for one that is not.
        gaze: what the head does; None where nothing can turn it.
        text: what the robot does, in words; what its mode says when empty.
    """

    time: float
    mode: Mode
    device: DeviceStatus
    zmp: Float64[np.ndarray, "2"]
    zmp_reference: Float64[np.ndarray, "2"]
    com: Float64[np.ndarray, "3"]
    soles: Float64[np.ndarray, "2 3"]
    handles: Float64[np.ndarray, "2 3"]
    target: Float64[np.ndarray, "3"] | None
    polygon: Float64[np.ndarray, "h 2"]
    margin: float
    loads: Float64[np.ndarray, "2"]
    tilt: float
    bodies: Float64[np.ndarray, "B 3"]
    turns: Float64[np.ndarray, "B 4"]
    fallen: bool
    paused: bool
    speed: float
    real_time_factor: float
    take: str
    heading: float = 0.0
    hands: Float64[np.ndarray, "k 3"] = field(default_factory=lambda: np.zeros((0, 3)))
    hands_do: tuple[HandStatus, ...] = ()
    hand_turns: tuple[Float64[np.ndarray, "3 3"] | None, ...] = ()
    gaze: HandStatus | None = None
    text: str = ""
