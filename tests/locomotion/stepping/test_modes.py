"""A run goes through the modes."""

from itertools import pairwise

import pytest
from walker import up_and_down, walk

from poise.apps.teleoperation import MODES
from poise.locomotion import Mode


@pytest.fixture(scope="module")
def stepped(get_robot):
    return walk(get_robot("biped20"), up_and_down(), 4.0)


def test_a_lifted_device_shifts_lifts_and_lands(stepped):
    log = stepped.log
    seen = [MODES[log.mode[0]]]
    seen += [MODES[b] for a, b in pairwise(log.mode) if a != b]
    assert seen == [Mode.D, Mode.TL, Mode.SL, Mode.D]
    assert not stepped.fell


def test_the_foot_stays_down_until_the_weight_has_shifted(stepped):
    log = stepped.log
    shifting = log.when(Mode.TL)
    assert log.soles[shifting, 1, 2].max() < 0.005
    assert log.soles[log.when(Mode.SL), 1, 2].max() > 0.05


def test_the_zmp_stays_in_the_foot_that_carries(stepped):
    log = stepped.log
    alone = log.when(Mode.SL) & (log.time > log.entries(Mode.SL)[0] + 0.5)
    offset = abs(log.zmp[alone] - log.soles[alone, 0, :2])
    assert offset[:, 0].max() < 0.15
    assert offset[:, 1].max() < 0.12
