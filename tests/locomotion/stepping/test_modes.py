"""The modes: the diagram, and that runs go through it."""

from itertools import pairwise

import pytest
from walker import up_and_down, walk

from poise.apps.teleoperation import MODES
from poise.errors import ConfigurationError
from poise.locomotion import Mode
from poise.locomotion._walking._modes import TRANSITIONS, ModeEvent, StepMachine, draw_modes


def test_every_mode_can_be_reached_and_left():
    assert set(TRANSITIONS.values()) == set(Mode)
    assert {before for before, _ in TRANSITIONS} == set(Mode)


def test_an_event_out_of_place_changes_nothing():
    machine = StepMachine()
    assert not machine.advance(ModeEvent.LANDED, 1.0)
    assert machine.mode is Mode.D
    assert machine.since == 0.0


@pytest.mark.parametrize("fmt", ["mermaid", "dot"])
def test_the_diagram_names_every_mode_and_transition(fmt):
    text = draw_modes(fmt)
    assert text.count("->") == len(TRANSITIONS)
    for mode in Mode:
        assert mode.name in text


def test_another_format_is_refused():
    with pytest.raises(ConfigurationError, match="mermaid"):
        draw_modes("ascii")


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


@pytest.mark.slow
def test_a_device_that_is_lowered_before_the_foot_left_gives_both_feet_back(get_robot):
    run = walk(get_robot("biped20"), up_and_down(lift=0.5, lower=1.2, height=0.03)[:2], 0.75)
    assert run.teleoperator.mode is Mode.TL
    from poise.locomotion import WayPoint

    points = [*up_and_down(lift=0.5)[:2], WayPoint(at=0.7, right=(0.0, 0.0, 0.0))]
    run = walk(get_robot("biped20"), points, 1.2)
    assert run.teleoperator.mode is Mode.D
    assert not run.log.when(Mode.SL).any()
