"""`TeleopLog`: what the record of a run says of the operator's side, a row a tick."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int8

from poise.locomotion import DeviceStatus, Mode
from poise.sim import RunRecord

MODES = tuple(Mode)  # The number of a mode in a log is its place here


@dataclass(frozen=True, kw_only=True, eq=False)
class TeleopLog:
    """A teleoperated run seen by the operator: columns of its record, T ticks.

    Positions are in the world as the teleoperator estimates it.

    Attributes:
        time: before the tick [s].
        mode: place in `tuple(Mode)`.
        device: place in `tuple(DeviceStatus)`.
        devices: left and right, NaN where no sample came [m].
        zmp: measured, smoothed [m].
        zmp_reference: of it [m].
        cart_table_zmp: CT-ZMP [m].
        com: [m].
        soles: left and right [m].
        target: of the swing foot, NaN with both on the ground [m].
        loads: left and right [N].
        tilt: of the torso [rad].
        command: velocity [rad/s] or torque [N m] commanded, each joint.
        q: true configuration after the tick [m, rad].
        touched: a solid part of the robot touched a block after the tick.
    """

    time: Float64[np.ndarray, " T"]
    mode: Int8[np.ndarray, " T"]
    device: Int8[np.ndarray, " T"]
    devices: Float64[np.ndarray, "T 2 3"]
    zmp: Float64[np.ndarray, "T 2"]
    zmp_reference: Float64[np.ndarray, "T 2"]
    cart_table_zmp: Float64[np.ndarray, "T 2"]
    com: Float64[np.ndarray, "T 3"]
    soles: Float64[np.ndarray, "T 2 3"]
    target: Float64[np.ndarray, "T 3"]
    loads: Float64[np.ndarray, "T 2"]
    tilt: Float64[np.ndarray, " T"]
    command: Float64[np.ndarray, "T nj"]
    q: Float64[np.ndarray, "T nq"]
    touched: Bool[np.ndarray, " T"]

    @classmethod
    def of(cls, record: RunRecord, dt: float) -> "TeleopLog":
        """Make the log of the record of a rollout with ticks of `dt` [s]."""
        # A state that the teleoperator cannot use before it began leaves no status: no row.
        end = record.times("zmp_reference")
        rows = np.isin(record.times("q"), end)
        touched = record["touched"][rows] if "touched" in record else np.zeros(len(end), np.bool_)
        command = record["command_torque" if "command_torque" in record else "command_velocity"]
        devices = [record[f"target/{side} device"][rows] for side in ("left", "right")]
        known = ("zmp", "cart_table_zmp", "com", "soles", "loads", "tilt")
        return cls(
            time=dt * (np.round(end / dt) - 1.0),
            mode=_places(record.notes("mode"), [mode.name for mode in MODES], end),
            device=_places(record.notes("device"), [status.name for status in DeviceStatus], end),
            devices=np.stack(devices, axis=1),
            zmp_reference=record["zmp_reference"],
            target=record["foot_target"],
            command=command[rows],
            q=record["q"][rows],
            touched=touched,
            **{name: record[f"estimate/{name}"] for name in known},
        )

    def __len__(self) -> int:
        return len(self.time)

    def when(self, mode: Mode) -> Bool[np.ndarray, " T"]:
        """Ticks in a mode."""
        return self.mode == MODES.index(mode)

    def entries(self, mode: Mode) -> Float64[np.ndarray, " n"]:
        """Times at which a mode was entered [s]."""
        now = self.when(mode)
        return self.time[now & ~np.concatenate(([False], now[:-1]))]


def _places(
    notes: Sequence[tuple[float, str]], names: Sequence[str], times: Float64[np.ndarray, " T"]
) -> Int8[np.ndarray, " T"]:
    """The place of the note that holds at each time."""
    starts = np.array([time for time, _ in notes])
    places = np.array([names.index(text) for _, text in notes], dtype=np.int8)
    return places[np.searchsorted(starts, times, side="right") - 1]
