"""Which joints belong to which chain, for all kinds of contact sets."""

from time import perf_counter

import numpy as np
import pytest
from stances import HUMANOIDS, STANCES, stances

from poise.dynamics import Partitions
from poise.errors import UnknownNameError


def joints_between(robot, frame):
    """Names of the joints that move a frame against the base, by walking up the tree."""
    model = robot.model
    joint, names = model.frames[robot.frame_id(frame)].parentJoint, set()
    while joint > (1 if robot.floating_base else 0):
        names.add(model.names[joint])
        joint = model.parents[joint]
    return names


@pytest.mark.parametrize("stance", STANCES)
@pytest.mark.parametrize("name", HUMANOIDS)
def test_constraint_chain_is_what_moves_a_contact_against_the_base(get_robot, name, stance):
    robot = get_robot(name)
    frames = stances(robot)[stance]
    partition = Partitions(robot).of(frames)
    wanted = set().union(*(joints_between(robot, f) for f in frames))
    assert set(partition.constraint) == wanted
    others = set(robot.joint_names) - wanted
    assert set(partition.kept) | set(partition.unconstrained) == others
    assert not set(partition.kept) & set(partition.unconstrained)


@pytest.mark.parametrize("stance", STANCES)
@pytest.mark.parametrize("name", HUMANOIDS)
def test_every_coordinate_is_in_one_part_and_the_base_comes_first(get_robot, name, stance):
    robot = get_robot(name)
    partition = Partitions(robot).of(stances(robot)[stance])
    both = np.concatenate((partition.a, partition.u))
    assert sorted(both.tolist()) == list(range(robot.nv))
    assert partition.a[:6].tolist() == list(range(6))
    assert partition.nr == partition.na + 6 * len(partition.chains)
    names = [robot.joint_names[i - 6] for i in partition.u]
    assert names == list(partition.unconstrained)


@pytest.mark.parametrize("stance", STANCES)
@pytest.mark.parametrize("name", HUMANOIDS)
def test_a_chain_hangs_on_one_body_and_has_more_joints_than_its_centroid(get_robot, name, stance):
    robot = get_robot(name)
    partition = Partitions(robot).of(stances(robot)[stance])
    free = set(partition.kept) | set(partition.unconstrained)
    ends = []
    for chain in partition.chains:
        assert len(chain.joints) > 6
        assert chain.z.stop - chain.z.start == 6
        assert partition.unconstrained[chain.u] == chain.joints
        for joint in chain.joints:
            ends.append(chain.u.stop)
            joint_id = robot.model.getJointId(joint)
            while robot.model.names[joint_id] in free:
                joint_id = robot.model.parents[joint_id]
            assert robot.model.names[joint_id] == chain.body
    assert len(ends) == partition.nu


def test_double_support_leaves_waist_arms_and_neck(get_robot):
    partition = Partitions(get_robot("humanoid33")).of(("left_sole", "right_sole"))
    assert (partition.na, partition.nu, partition.nr) == (18, 21, 24)
    assert [chain.body for chain in partition.chains] == ["root_joint"]
    assert partition.kept == ()
    assert (partition.a.tolist(), partition.u.tolist()) == ([*range(18)], [*range(18, 39)])


def test_a_waist_shared_by_a_hand_in_contact_is_in_the_constraint_chain(get_robot):
    partition = Partitions(get_robot("humanoid33")).of(("left_sole", "right_sole", "left_hand"))
    assert {"waist_yaw", "waist_pitch", "waist_roll", "left_elbow"} <= set(partition.constraint)
    (chain,) = partition.chains
    assert chain.body == "waist_roll"
    assert {"neck_yaw", "right_clavicle", "right_wrist_roll"} <= set(chain.joints)


def test_a_swing_leg_of_six_joints_is_kept_beside_what_hangs_on_the_torso(get_robot):
    robot = get_robot("humanoid33")
    partition = Partitions(robot).of(("left_sole", "right_hand"))
    assert partition.kept == robot.joint_names[6:12]
    assert all(name.startswith("right_") for name in partition.kept)
    assert [chain.body for chain in partition.chains] == ["waist_roll"]


def test_hanging_by_a_hand_leaves_a_chain_on_the_base_and_one_on_the_torso(get_robot):
    partition = Partitions(get_robot("humanoid33")).of(("right_hand",))
    assert [(c.body, len(c.joints)) for c in partition.chains] == [
        ("root_joint", 12),
        ("waist_roll", 10),
    ]
    assert partition.nr == partition.na + 12


def test_flight_leaves_the_base_and_one_chain_of_all_joints(get_robot):
    robot = get_robot("humanoid33")
    partition = Partitions(robot).of(())
    assert (partition.na, partition.nu) == (6, robot.nj)
    assert partition.constraint == ()


def test_contacts_that_leave_a_neck_reduce_nothing(get_robot):
    robot = get_robot("humanoid33")
    partition = Partitions(robot).of((*robot.soles, *robot.hands))
    assert partition.kept == ("neck_yaw", "neck_pitch")
    assert (partition.nu, partition.nr, partition.chains) == (0, robot.nv, ())


def test_contacts_that_constrain_every_joint_reduce_nothing(get_robot):
    robot = get_robot("g1")
    partition = Partitions(robot).of((*robot.soles, *robot.hands))
    assert partition.constraint == robot.joint_names
    assert (partition.kept, partition.nr, partition.chains) == ((), robot.nv, ())


def test_a_fixed_base_has_no_virtual_chain(get_robot):
    robot = get_robot("upper17")
    free = Partitions(robot).of(())
    assert (free.na, free.nu, free.nr) == (0, 17, 6)
    assert [chain.body for chain in free.chains] == ["universe"]
    held = Partitions(robot).of((robot.hands[0],))
    assert held.nu == 0
    assert len(held.kept) == 6
    arm = Partitions(get_robot("arm6")).of(())
    assert (arm.nr, arm.constraint, len(arm.kept)) == (6, (), 6)


def test_a_contact_on_the_base_constrains_no_joint(get_robot):
    robot = get_robot("humanoid33")
    partitions = Partitions(robot)
    assert partitions.of((robot.pelvis,)) is partitions.of(())


def test_an_unknown_frame_is_refused_with_those_that_exist(get_robot):
    with pytest.raises(UnknownNameError, match="left_sole") as caught:
        Partitions(get_robot("humanoid33")).of(("right_sole", "left_soul"))
    assert caught.value.got == "left_soul"


def test_a_partition_is_made_once_for_each_set_of_constrained_joints(get_robot):
    robot = get_robot("humanoid33")
    partitions = Partitions(robot)
    left, right = robot.soles
    both = partitions.of((left, right))
    assert partitions.of((right, left)) is both
    assert partitions.of([left, right, robot.pelvis]) is both
    assert partitions.of((left,)) is not both
    assert partitions.of((left, right)) is both


def test_contacts_that_change_every_tick_make_nothing_new(get_robot):
    robot = get_robot("humanoid33")
    partitions = Partitions(robot)
    sets = list(stances(robot).values())
    first = [partitions.of(frames) for frames in sets]
    begin = perf_counter()
    for _ in range(1000):
        assert all(partitions.of(f) is p for f, p in zip(sets, first, strict=True))
    # A hundred times what it takes here; making one takes several hundred microseconds.
    assert (perf_counter() - begin) / (1000 * len(sets)) < 100e-6
