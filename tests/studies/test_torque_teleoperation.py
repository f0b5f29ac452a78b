"""The study of torque-level teleoperation: its measure of shifts."""

from unittest.mock import Mock

import numpy as np
import pytest

from poise.locomotion import Mode

pytest.importorskip("mujoco")

from poise.apps.teleoperation import MODES, TeleopLog
from studies.torque_teleoperation.scenarios import shift_times


def shift_log(modes, off, dt=0.01):
    """A log of modes [s], whose ZMP is beside its reference [m] as a function of time [s]."""
    lasts = [(mode, round(seconds / dt)) for mode, seconds in modes]
    mode = np.array([MODES.index(m) for m, n in lasts for _ in range(n)], dtype=np.int8)
    time, T = dt * np.arange(len(mode)), len(mode)
    log = Mock(spec=TeleopLog, time=time, mode=mode, zmp_reference=np.zeros((T, 2)))
    log.zmp = np.column_stack([np.zeros(T), [off(t) for t in time]])
    log.__len__ = lambda _: T
    for name in ("when", "entries"):
        setattr(log, name, getattr(TeleopLog, name).__get__(log))
    return log


SHIFT = [(Mode.D, 1.0), (Mode.TL, 0.4), (Mode.SL, 1.0), (Mode.D, 1.0)]


def test_a_shift_takes_until_the_foot_is_up_and_the_zmp_stays_where_it_should_be():
    # Through its reference at 1.2 s without staying there; from 1.7 s on it stays.
    log = shift_log(SHIFT, lambda t: 0.0 if t < 1.0 or 1.2 <= t < 1.25 or t >= 1.7 else 0.05)
    assert shift_times(log) == pytest.approx((0.4, 0.7), abs=0.011)


@pytest.mark.parametrize(
    ("modes", "times"),
    [
        (SHIFT, (0.4, np.inf)),
        (SHIFT[:2], (np.nan, np.nan)),
        ([(Mode.D, 1.0), (Mode.TR, 0.6), (Mode.SR, 1.0)], (0.6, 1.35)),
    ],
)
def test_a_zmp_that_comes_after_the_mode_has_not_settled(modes, times):
    log = shift_log(modes, lambda t: 0.05 if 1.0 <= t < 2.35 else 0.0)
    assert shift_times(log) == pytest.approx(times, abs=0.011, nan_ok=True)
