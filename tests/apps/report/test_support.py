import numpy as np
from synthetic_run import rectangle, walking_record

from poise.apps.report import SupportPhase
from poise.apps.report._plots._zmp import support_over_time


def test_bounds_follow_the_phases_and_are_missing_in_flight():
    record = walking_record(
        duration=2.0,
        support=(
            SupportPhase(start=0.0, end=0.5, vertices=rectangle(0.0, 0.0)),
            SupportPhase(start=0.5, end=1.0, vertices=np.zeros((0, 2))),
            SupportPhase(start=1.0, end=2.0, vertices=rectangle(1.0, 0.0)),
        ),
    )
    low, high = support_over_time(record)
    first, flight = record.time < 0.5, (record.time >= 0.5) & (record.time < 1.0)
    np.testing.assert_allclose(low[first], np.tile([-0.12, -0.06], (first.sum(), 1)))
    np.testing.assert_allclose(high[record.time >= 1.0, 0], 1.12)
    assert np.isnan(low[flight]).all()
    assert np.isnan(record.zmp_margin[flight]).all()
    assert np.isfinite(record.zmp_margin[~flight]).all()
