"""`TeleopLog`: everything about a teleoperated run, a row a tick."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int8

from poise.control.command import Command
from poise.sim import Plant
from poise.teleop import DeviceSample, DeviceStatus, Mode, TeleopStatus

MODES = tuple(Mode)
"""The number of a mode in a log is its place here."""
DEVICE_STATUSES = tuple(DeviceStatus)
"""Likewise the device's status."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TeleopLog:
    """Signals of one run, T ticks. Positions are in the world as the controller estimates it.

    Attributes:
        time: before the tick [s].
        mode: place in `MODES`.
        device: place in `DEVICE_STATUSES`.
        hands: left and right device, NaN where no sample came [m].
        zmp: measured, smoothed [m].
        zmp_reference: of it [m].
        cart_table_zmp: CT-ZMP [m].
        com: [m].
        soles: left and right [m].
        target: of the foot in the air, NaN with both on the ground [m].
        loads: left and right [N].
        tilt: of the torso [rad].
        velocity: commanded, each joint [rad/s].
        q: true configuration before the tick [m, rad].
        touched: whether any part of the robot touched a block.
    """

    time: Float64[np.ndarray, " T"]
    mode: Int8[np.ndarray, " T"]
    device: Int8[np.ndarray, " T"]
    hands: Float64[np.ndarray, "T 2 3"]
    zmp: Float64[np.ndarray, "T 2"]
    zmp_reference: Float64[np.ndarray, "T 2"]
    cart_table_zmp: Float64[np.ndarray, "T 2"]
    com: Float64[np.ndarray, "T 3"]
    soles: Float64[np.ndarray, "T 2 3"]
    target: Float64[np.ndarray, "T 3"]
    loads: Float64[np.ndarray, "T 2"]
    tilt: Float64[np.ndarray, " T"]
    velocity: Float64[np.ndarray, "T nj"]
    q: Float64[np.ndarray, "T nq"]
    touched: Bool[np.ndarray, " T"]

    def __len__(self) -> int:
        return len(self.time)

    def when(self, mode: Mode) -> Bool[np.ndarray, " T"]:
        """Ticks in a mode."""
        return self.mode == MODES.index(mode)

    def entries(self, mode: Mode) -> Float64[np.ndarray, " n"]:
        """Times at which a mode was entered [s]."""
        now = self.when(mode)
        return self.time[now & ~np.concatenate(([False], now[:-1]))]


class LogWriter:
    """Fills a log tick by tick.

    Args:
        plant: whose run.
        ticks: how many there are at most.
    """

    def __init__(self, plant: Plant, ticks: int) -> None:
        robot = plant.robot
        shapes = {
            "time": (), "hands": (2, 3), "zmp": (2,), "zmp_reference": (2,),
            "cart_table_zmp": (2,), "com": (3,), "soles": (2, 3), "target": (3,), "loads": (2,),
            "tilt": (), "velocity": (robot.nj,), "q": (robot.nq,),
        }  # fmt: skip
        self._columns = {k: np.full((ticks, *shape), np.nan) for k, shape in shapes.items()}
        self._codes = {k: np.zeros(ticks, dtype=np.int8) for k in ("mode", "device")}
        self._touched = np.zeros(ticks, dtype=np.bool_)
        self._count = 0

    def add(
        self,
        plant: Plant,
        sample: DeviceSample | None,
        status: TeleopStatus,
        command: Command,
        *,
        touched: bool,
    ) -> None:
        """Adds a tick, before the plant moves."""
        i, columns = self._count, self._columns
        columns["time"][i] = plant.time
        if sample is not None:
            columns["hands"][i] = sample.left, sample.right
        for name in ("zmp", "zmp_reference", "cart_table_zmp", "com", "soles", "loads", "tilt"):
            columns[name][i] = getattr(status, name)
        if status.target is not None:
            columns["target"][i] = status.target
        columns["velocity"][i] = command.velocity
        columns["q"][i] = plant.map.q(plant.data.qpos)
        self._codes["mode"][i] = MODES.index(status.mode)
        self._codes["device"][i] = DEVICE_STATUSES.index(status.device)
        self._touched[i] = touched
        self._count += 1

    def finish(self) -> TeleopLog:
        """The log so far."""
        n = self._count
        parts = self._columns | self._codes | {"touched": self._touched}
        return TeleopLog(**{name: column[:n].copy() for name, column in parts.items()})
