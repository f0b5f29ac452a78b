"""The payload that soles say, against plants that carry one."""

import numpy as np
import pytest

import poise
from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.estimation import PayloadBelief, PayloadEstimator, StateEstimator
from poise.sim import Plant, PlantConfig, SensorConfig, rollout

Load = PlantConfig.Payload


def stood(robot, seconds, estimator, **plant):
    """Stands with the estimate in the loop; the plant, and how far its CoM is from before."""
    body = Plant(robot, PlantConfig(control_dt=0.002, **plant), seed=1)
    controller = poise.WholeBodyController(robot, poise.default_stack(robot))
    for _ in rollout(body, controller, estimator=estimator, duration=seconds):
        pass
    assert not body.fallen
    com = Dynamics(robot)
    com.update(RobotState(robot.q_home, np.zeros(robot.nv)))
    return body, body.com - com.com


def told_com(robot, body, estimator):
    """Where the centre of mass is over the ground, as who computes with the payload has it."""
    told, state = Dynamics(robot), body.true_state()
    told.update(RobotState(state.q, state.v, payload=estimator.payload))
    return told.com[:2]


@pytest.mark.parametrize("name", ["g1", "humanoid33"])
def test_mass_and_centre_of_a_load_in_a_hand_are_found(get_robot, name):
    robot = get_robot(name)
    estimator = PayloadEstimator(robot)
    body, off = stood(robot, 5.0, estimator, payloads=(Load(frame=robot.hands[0], mass=3.0),))
    # The hand sank as it took the load, and tells some of it from the body's.
    assert estimator.mass + estimator.held.sum() == pytest.approx(3.0, abs=0.05)
    np.testing.assert_allclose(told_com(robot, body, estimator), body.com[:2], atol=1e-3)
    # It stands over its feet, where without it stands 8 to 16 mm aside.
    assert np.abs(off[:2]).max() < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("scale", [0.8, 1.2])
def test_a_robot_that_is_lighter_or_heavier_stands_as_high(get_robot, scale):
    robot = get_robot("g1")
    estimator = StateEstimator(robot, payload=PayloadEstimator(robot))
    _, off = stood(robot, 6.0, estimator, mass_scale=scale, sensors=SensorConfig.typical())
    assert estimator.payload.mass == pytest.approx((scale - 1.0) * robot.mass, rel=0.02)
    assert np.abs(off).max() < 3e-3


def loads(robot, force, *, times, wrench=None):
    """States at rest in which each sole carries half of a force."""
    share = np.array([0.0, 0.0, 0.5 * force, 0.0, 0.0, 0.0]) if wrench is None else wrench
    felt = dict.fromkeys(robot.soles, share)
    return [RobotState(robot.q_home, np.zeros(robot.nv), felt, t) for t in times]


def test_what_is_told_changes_no_faster_than_it_may(get_robot):
    robot = get_robot("g1")
    estimator = PayloadEstimator(robot, PayloadBelief(mass_rate=0.05, offset_rate=0.01))
    told, times = [], 0.002 * np.arange(2000)
    for state in loads(robot, 1.5 * robot.weight, times=times):
        payload = estimator.update(state).payload
        told.append(0.0 if payload is None else payload.mass / robot.mass)
    assert told[-1] <= 0.05 * times[-1] + 1e-9
    # In steps worth telling, of a few thousandths.
    assert 0.0 < np.abs(np.diff(told)).max() < 0.004
    assert len(set(told)) < 200
    assert estimator.mass == pytest.approx(0.5 * robot.mass, rel=0.05)


@pytest.mark.parametrize("force", [5.0, 0.4])
def test_it_stays_within_its_bounds(get_robot, force):
    robot = get_robot("g1")
    estimator = PayloadEstimator(robot)
    for state in loads(robot, force * robot.weight, times=0.002 * np.arange(6000)):
        estimator.update(state)
    found = estimator.payload.mass / robot.mass
    assert -0.4 - 1e-9 <= found <= 0.6 + 1e-9
    assert np.abs(estimator.offset).max() <= 0.08 / 0.6 + 1e-9


@pytest.mark.parametrize(
    "wrench", [np.zeros(6), np.full(6, np.nan), np.array([0.0, 0.0, 20.0, 0.0, 0.0, 0.0])]
)
def test_in_the_air_and_without_numbers_nothing_is_learned(get_robot, wrench):
    robot = get_robot("g1")
    estimator = PayloadEstimator(robot)
    for state in loads(robot, 0.0, times=0.002 * np.arange(1000), wrench=wrench):
        assert estimator.update(state).payload is None
    for t in 0.002 * np.arange(1000):
        assert estimator.update(RobotState(robot.q_home, np.zeros(robot.nv), {}, t)).payload is None
    assert estimator.mass == 0.0


def test_clocks_that_jump_and_strange_states_do_no_harm(get_robot):
    robot = get_robot("g1")
    estimator = PayloadEstimator(robot)
    states = loads(robot, robot.weight, times=[0.0, 0.002, 5.0, 1.0, 1.0, np.nan, 1.002, 1.004])
    states.append(RobotState(np.zeros(3), np.zeros(3), {}, 1.006))
    for state in states:
        assert np.isfinite(estimator.update(state).q).all()
    assert abs(estimator.mass) < 0.01
    estimator.reset()
    assert estimator.payload is None


def test_a_fixed_base_is_refused(get_robot):
    with pytest.raises(ConfigurationError, match="payload"):
        PayloadEstimator(get_robot("panda"))


@pytest.mark.slow
def test_a_push_is_no_offset(get_robot):
    robot = get_robot("humanoid33")
    told = []
    for push in (0.01, 1e3):
        estimator = PayloadEstimator(robot, PayloadBelief(push=push))
        plant = Plant(robot, PlantConfig(control_dt=0.002), seed=1)
        plant.push(robot.torso, (0.03 * robot.weight, 0.0, 0.0), duration=3.0, start=1.0)
        controller = poise.WholeBodyController(robot, poise.default_stack(robot))
        ticks = rollout(plant, controller, estimator=estimator, duration=4.2)
        off = (told_com(robot, plant, estimator) - plant.com[:2] for _ in ticks)
        told.append(max(float(np.abs(way).max()) for way in off))
    # One that believed all that the soles say would take it for a centimetre.
    assert told[0] < 0.003
    assert told[1] > 0.01


def test_stamps_that_come_twice_and_soles_that_drop_out_take_no_time_to_settle_anew(get_robot):
    robot = get_robot("humanoid33")
    wrench = np.array([0.0, 0.0, 0.6 * robot.weight, 0.0, 0.0, 0.0])
    contacts = dict.fromkeys(robot.soles, wrench)
    lost = dict(zip(robot.soles, (wrench, np.full(6, np.nan)), strict=True))
    clean, spoiled = PayloadEstimator(robot), PayloadEstimator(robot)
    still = np.zeros(robot.nv)
    for tick in range(1000):
        state = RobotState(robot.q_home, still, contacts, 0.002 * tick)
        clean.update(state)
        spoiled.update(state)
        if tick % 100 == 0:
            spoiled.update(state)
            spoiled.update(RobotState(robot.q_home, still, lost, 0.002 * tick + 0.001))
    assert clean.mass > 0.1 * robot.mass
    assert spoiled.mass == pytest.approx(clean.mass, rel=1e-3)
