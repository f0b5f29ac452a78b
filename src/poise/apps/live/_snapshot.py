"""`Snapshot`: state of a live run, as the page shows it, some 25 times a second."""

import re
from dataclasses import dataclass, fields
from enum import Enum
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.locomotion import DeviceStatus, HandStatus, Mode


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Snapshot:
    """One moment of a live run; positions in the drawn world, which is the simulator's."""

    time: float  # of the robot [s]
    mode: Mode
    mode_text: str
    device: DeviceStatus
    zmp: Float64[np.ndarray, "2"]  # measured [m]
    zmp_reference: Float64[np.ndarray, "2"]  # [m]
    com: Float64[np.ndarray, "3"]  # [m]
    soles: Float64[np.ndarray, "2 3"]  # left and right [m]
    handles: Float64[np.ndarray, "2 3"]  # where the operator holds the feet [m]
    target: Float64[np.ndarray, "3"] | None = None  # of the swing foot [m]
    polygon: Float64[np.ndarray, "h 2"]  # corners of the support polygon, counter-clockwise [m]
    margin: float  # of the ZMP to its nearest edge, negative outside [m]
    loads: Float64[np.ndarray, "2"]  # on the soles [N]
    landings: int  # of feet that had been in the air; none of a walk
    tilt: float  # of the torso [rad]
    heading: float  # of the torso, to the left of the world's x axis [rad]
    hands: Float64[np.ndarray, "k 3"]  # targets, left and right [m]
    hands_do: tuple[HandStatus, ...]
    hand_turns: tuple[Float64[np.ndarray, "9"] | None, ...]  # world_R_hand of targets, by rows
    gaze: HandStatus | None  # None where nothing can turn it
    bodies: Float64[np.ndarray, " b"]  # positions of the simulator's bodies [m]
    turns: Float64[np.ndarray, " t"]  # their quaternions (w, x, y, z)
    fallen: bool
    paused: bool
    speed: float  # commanded robot time over wall-clock time
    real_time_factor: float  # part of that speed reached in the last second
    take: str  # name of the recording, or why there is none

    def message(self) -> dict[str, Any]:
        """Return the members of the status that a page gets."""
        told = {key: _plain(getattr(self, name)) for name, key in _KEYS.items()}
        return told | {"deviceText": self.device.value}


_KEYS = {f.name: re.sub("_(.)", lambda m: m[1].upper(), f.name) for f in fields(Snapshot)}


def _plain(value: Any) -> Any:
    """A value as JSON, rounded to figures that can be seen."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    if isinstance(value, np.ndarray):
        return value.round(4).tolist()
    return round(value, 4) if isinstance(value, float) else value
