"""Faulty and missing load cells: wrenches against the truth, and robots that stand on them."""

import math
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco")

from poise.control import WholeBodyController
from poise.dynamics import SensorReadings
from poise.estimation import EstimatorConfig, PayloadEstimator, StateEstimator
from poise.locomotion import Walker, walking_stack
from poise.sim import Plant, PlantConfig, SensorConfig, rollout

PERIOD, BEGIN = 0.002, 1.0

FAULTS = {
    "zero": lambda wrench: np.zeros(6),
    "stuck": lambda wrench: np.array([0.0, 0.0, 160.0, 0.0, 0.0, 0.0]),
    "larger": lambda wrench: 1.3 * wrench,
    "gone": lambda wrench: None,
}


def corrupted(state, fault, soles):
    """A state whose load cells have a fault."""
    contacts = dict(state.contacts)
    for sole in soles:
        wrench = FAULTS[fault](contacts.pop(sole))
        if wrench is not None:
            contacts[sole] = wrench
    return replace(state, contacts=contacts)


class Estimated:
    """An estimator behind faulty cells; `before` it all is well."""

    def __init__(self, robot, q_start, fault, soles, config=None):
        payload = PayloadEstimator(robot)
        self.estimator = StateEstimator(robot, config, q_start=q_start, payload=payload)
        self.fault, self.soles = fault, soles
        self.rows = []

    def update(self, state):
        bad = corrupted(state, self.fault, self.soles) if state.time >= BEGIN else state
        found = self.estimator.update(bad)
        self.rows.append((state, found, self.estimator.vote.estimated))
        return found


def stand(robot, fault, soles, *, velocity=0.0, seconds=2.2, config=None, push=0.0):
    plant = Plant(robot, PlantConfig(control_dt=PERIOD, sensors=SensorConfig.typical()), seed=5)
    if push:
        plant.push(robot.torso, (0.0, push * robot.mass / 0.1, 0.0), 0.1, BEGIN)
    stack = walking_stack(robot)
    walker, controller = Walker(robot, stack), WholeBodyController(robot, stack)
    estimated = Estimated(robot, plant.true_state().q, fault, soles, config)
    walker.set_velocity(velocity)
    for _ in rollout(plant, controller, walker, estimator=estimated, duration=seconds):
        if plant.fallen:
            break
    return plant, estimated


@pytest.mark.parametrize("fault", list(FAULTS))
@pytest.mark.parametrize("foot", [0, 1])
def test_a_robot_walks_with_a_faulty_cell_and_its_wrench_is_estimated(get_robot, fault, foot):
    robot = get_robot("g1")
    sole = tuple(robot.soles)[foot]
    plant, estimated = stand(robot, fault, (sole,), velocity=0.2, seconds=3.5)
    assert not plant.fallen
    late = [row for row in estimated.rows if sole in row[2]]
    assert late, "never noticed"
    assert {names for _, _, names in estimated.rows} == {(), (sole,)}
    off = [found.contacts[sole][2] - true.contacts[sole][2] for true, found, _ in late]
    assert math.sqrt(np.mean(np.square(off))) < 0.1 * robot.weight
    assert (
        estimated.estimator.payload.payload is None
        or abs(estimated.estimator.payload.mass) < 0.1 * robot.mass
    )


@pytest.mark.parametrize("name", ["g1", "humanoid33"])
def test_a_dead_cell_of_a_standing_robot_is_found_before_its_foot_counts_as_hanging(
    get_robot, name
):
    robot = get_robot(name)
    sole = next(iter(robot.soles))
    plant, estimated = stand(robot, "zero", (sole,))
    assert not plant.fallen
    first = next(true.time for true, _, names in estimated.rows if names)
    assert first < BEGIN + 0.05


def test_without_the_vote_a_dead_cell_topples_a_standing_robot(get_robot):
    robot = get_robot("g1")
    config = EstimatorConfig(vote=False)
    plant, _ = stand(robot, "zero", (next(iter(robot.soles)),), config=config)
    assert plant.fallen


def test_a_robot_without_cells_has_wrenches_of_joint_torques(get_robot):
    robot = get_robot("g1")
    plant, estimated = stand(robot, "gone", tuple(robot.soles), velocity=0.2, seconds=3.0)
    assert not plant.fallen
    true, found, names = estimated.rows[-1]
    assert names == tuple(robot.soles)
    total = sum(wrench[2] for wrench in found.contacts.values())
    assert total == pytest.approx(sum(w[2] for w in true.contacts.values()), rel=0.2)


def test_a_push_finds_no_fault(get_robot):
    robot = get_robot("g1")
    plant, estimated = stand(robot, "gone", (), push=0.3)
    assert not plant.fallen
    assert {names for _, _, names in estimated.rows} == {()}


def test_a_cell_that_agrees_again_is_believed_again(get_robot):
    robot = get_robot("humanoid33")
    sole = next(iter(robot.soles))
    plant = Plant(robot, PlantConfig(control_dt=PERIOD, sensors=SensorConfig.typical()), seed=5)
    stack = walking_stack(robot)
    walker, controller = Walker(robot, stack), WholeBodyController(robot, stack)
    estimator, estimated = StateEstimator(robot, q_start=plant.true_state().q), []

    def update(state):
        bad = corrupted(state, "zero", (sole,)) if 0.5 < state.time < 0.7 else state
        found = estimator.update(bad)
        estimated.append(estimator.vote.estimated)
        return found

    for _ in rollout(plant, controller, walker, estimator=update, duration=3.2):
        pass
    assert (sole,) in estimated
    assert estimated[-1] == ()


@pytest.mark.parametrize(
    "torque", [np.zeros(0), np.full(29, np.nan), np.zeros(3)], ids=["empty", "nan", "other"]
)
def test_torques_of_no_use_leave_wrenches_as_they_are(get_robot, torque):
    robot = get_robot("g1")
    plant = Plant(robot, PlantConfig(control_dt=PERIOD))
    estimator, state = StateEstimator(robot), plant.true_state()
    readings = SensorReadings(np.zeros(3), np.array([0.0, 0.0, 9.81]), torque)
    sole = next(iter(robot.soles))
    for k in range(60):
        bad = corrupted(replace(state, time=k * PERIOD, readings=readings), "zero", (sole,))
        found = estimator.update(bad)
    assert estimator.vote.estimated == ()
    np.testing.assert_array_equal(found.contacts[sole], np.zeros(6))
