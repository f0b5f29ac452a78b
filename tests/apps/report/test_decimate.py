import numpy as np
import pytest

from poise.apps.report._plots._sheet import decimate


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


def test_a_long_gap_stays_a_gap_and_its_neighbours_stay():
    time = np.arange(20_000) * 1e-3
    values = np.sin(time)
    values[5000:9000] = np.nan
    kept_time, kept = decimate(time, values)
    inside = (kept_time > 5.1) & (kept_time < 8.9)
    assert np.isnan(kept[inside]).all()
    assert inside.any()
    assert np.isfinite(kept[(kept_time < 4.9) | (kept_time > 9.1)]).all()
