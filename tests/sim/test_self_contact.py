"""Links of the robot that touch one another."""

import numpy as np
import pinocchio as pin
import pytest

import poise
from poise.sim import Block, BlockWatch, Plant, PlantConfig, Recorder

INWARDS = {"left_shoulder_roll": -0.26, "left_shoulder_yaw": -0.6, "left_elbow": -1.2}
"""Joints of humanoid33 that take the left forearm into the trunk [rad]."""


@pytest.fixture(scope="module")
def humanoid():
    return poise.load_robot("humanoid33")


def posture(robot, joints):
    q = robot.q_home.copy()
    for name, angle in joints.items():
        q[robot.nq - robot.nj + robot.joint_index(name)] = angle
    return q


def reaching_inwards(robot, *, self_contact, airborne=False, seconds=0.6):
    """A plant whose servos take the left arm into the trunk; the largest force on each pair."""
    config = PlantConfig(actuation="position", self_contact=self_contact)
    plant, most = Plant(robot, config), {}
    start = robot.q_home.copy()
    start[2] += 3.0 if airborne else 0.0
    plant.reset(start)
    goal = posture(robot, INWARDS)[-robot.nj :]
    while plant.time < seconds:
        part = min(plant.time / 0.4, 1.0)
        plant.step(None, position=start[-robot.nj :] + part * (goal - start[-robot.nj :]))
        for pair, force in plant.self_contacts.items():
            most[pair] = max(force, most.get(pair, 0.0))
    return plant, most


def test_links_pass_through_one_another_unless_told_otherwise(humanoid):
    plant, most = reaching_inwards(humanoid, self_contact=False)
    assert most == {}
    roll = humanoid.joint_index("left_shoulder_roll")
    assert plant.true_state().q[-humanoid.nj + roll] == pytest.approx(-0.26, abs=0.02)


def test_an_arm_stops_at_the_trunk_and_says_how_hard_it_presses(humanoid):
    plant, most = reaching_inwards(humanoid, self_contact=True)
    assert all("left" in one or "left" in other for one, other in most)
    assert max(most.values()) > 20.0
    assert not plant.fallen
    # Contacts are stiff: covers give way by less than half a centimetre.
    assert plant.data.contact.dist.min(initial=0.0) > -5e-3
    roll = humanoid.joint_index("left_shoulder_roll")
    assert plant.true_state().q[-humanoid.nj + roll] > -0.2


def test_what_links_do_to_each_other_moves_no_centre_of_mass(humanoid):
    plant, most = reaching_inwards(humanoid, self_contact=True, airborne=True, seconds=0.5)
    assert max(most.values()) > 20.0
    state, data = plant.true_state(), humanoid.model.createData()
    momentum = pin.computeCentroidalMomentum(humanoid.model, data, state.q, state.v).linear
    fallen = -plant.mass * 9.81 * 0.5
    np.testing.assert_allclose(momentum, [0.0, 0.0, fallen], rtol=0, atol=0.005 * abs(fallen))


@pytest.mark.parametrize("name", ["humanoid33", "biped20", "upper17", "g1", "human"])
def test_no_robot_touches_itself_at_home(name):
    plant = Plant(poise.load_robot(name), PlantConfig(self_contact=True))
    plant.reset()
    assert plant.self_contacts == {}


@pytest.mark.parametrize(("self_contact", "stopped"), [(False, False), (True, True)])
def test_a_link_that_is_drawn_only_is_stopped_by_a_block(humanoid, self_contact, stopped):
    data = humanoid.model.createData()
    pin.framesForwardKinematics(humanoid.model, data, humanoid.q_home)
    hand = data.oMf[humanoid.frame_id("left_hand")].translation
    ahead = (float(hand[0]) + 0.12, float(hand[1]))
    block = Block(center=ahead, size=(0.1, 0.1, 0.1), top=float(hand[2]) + 0.05, told=False)
    config = PlantConfig(actuation="position", self_contact=self_contact, blocks=(block,))
    plant = Plant(humanoid, config)
    watch, start = BlockWatch(plant), humanoid.q_home[-humanoid.nj :]
    pitch, touched = humanoid.joint_index("left_shoulder_pitch"), False
    while plant.time < 0.5:
        goal = start.copy()
        goal[pitch] -= min(plant.time, 0.3)
        plant.step(None, position=goal)
        touched |= watch.touched()
    assert touched == stopped
    q = plant.true_state().q[-humanoid.nj :]
    assert (q[pitch] > start[pitch] - 0.25) == stopped


def test_a_record_says_which_links_touched_and_how_hard(humanoid):
    plant = Plant(humanoid, PlantConfig(actuation="position", self_contact=True))
    recorder = Recorder()
    recorder.begin(plant)
    recorder.look()
    plant.reset(posture(humanoid, INWARDS))
    recorder.look()
    force = recorder.record["self_contact"]
    assert force[0] == 0.0
    assert force[1] == max(plant.self_contacts.values()) > 0.0
    recorder.end()
