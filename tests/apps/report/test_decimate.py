import numpy as np
import pytest

from poise.apps.report._plots._sheet import bucket_max, decimate


@pytest.mark.parametrize("ticks", [1001, 9973, 10_000, 60_013])
def test_decimation_keeps_every_bucket_extreme_at_its_own_time(ticks):
    rng = np.random.default_rng(ticks)
    time, values = np.arange(ticks) * 1e-3, rng.normal(size=ticks)
    spike = int(rng.integers(ticks))
    values[spike] = 50.0
    kept_time, kept = decimate(time, values)
    assert len(kept) <= 1000
    assert (np.diff(kept_time) > 0).all()
    assert kept.max() == 50.0
    assert kept_time[kept.argmax()] == time[spike]
    assert kept.min() == values.min()
    np.testing.assert_array_equal(values[np.searchsorted(time, kept_time)], kept)


def test_a_short_signal_is_not_touched():
    time = np.arange(900) * 1e-3
    assert decimate(time, time)[1] is time


def test_a_long_gap_stays_a_gap_and_its_neighbours_stay():
    time = np.arange(20_000) * 1e-3
    values = np.sin(time)
    values[5000:9000] = np.nan
    kept_time, kept = decimate(time, values)
    inside = (kept_time > 5.1) & (kept_time < 8.9)
    assert np.isnan(kept[inside]).all()
    assert inside.any()
    assert np.isfinite(kept[(kept_time < 4.9) | (kept_time > 9.1)]).all()


def test_bucket_maxima_equal_a_plain_loop():
    values = np.random.default_rng(1).normal(size=(10_007, 3))
    values[100:200, 1] = np.nan
    buckets, rows = bucket_max(values, 600)
    width = rows // len(buckets)
    for i in range(len(buckets)):
        part = values[i * width : (i + 1) * width]
        for j in range(3):
            finite = part[np.isfinite(part[:, j]), j]
            if finite.size:
                assert buckets[i, j] == finite.max()
            else:
                assert np.isnan(buckets[i, j])
