"""Which joints belong to which chain, for all kinds of contact sets."""

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
def test_coordinates_are_split_by_what_moves_a_contact_and_by_bodies(get_robot, name, stance):
    robot = get_robot(name)
    frames = stances(robot)[stance]
    partition = Partitions(robot).of(frames)
    wanted = set().union(*(joints_between(robot, f) for f in frames))
    assert set(partition.constraint) == wanted
    free = set(partition.kept) | set(partition.unconstrained)
    assert free == set(robot.joint_names) - wanted
    assert not set(partition.kept) & set(partition.unconstrained)
    assert sorted([*partition.a, *partition.u]) == list(range(robot.nv))
    assert partition.a[:6].tolist() == list(range(6))
    assert partition.nr == partition.na + 6 * len(partition.chains)
    assert [robot.joint_names[i - 6] for i in partition.u] == list(partition.unconstrained)
    assert sum(len(chain.joints) for chain in partition.chains) == partition.nu
    for chain in partition.chains:
        assert len(chain.joints) > 6
        assert chain.z.stop - chain.z.start == 6
        assert partition.unconstrained[chain.u] == chain.joints
        for joint in chain.joints:
            joint_id = robot.model.getJointId(joint)
            while robot.model.names[joint_id] in free:
                joint_id = robot.model.parents[joint_id]
            assert robot.model.names[joint_id] == chain.body


@pytest.mark.parametrize(
    ("name", "frames", "constraint", "kept", "chains"),
    [
        ("humanoid33", ("left_sole", "right_sole"), 12, 0, {"root_joint": 21}),
        ("humanoid33", ("left_sole", "right_hand"), 17, 6, {"waist_roll": 10}),
        ("humanoid33", ("right_hand",), 11, 0, {"root_joint": 12, "waist_roll": 10}),
        ("humanoid33", (), 0, 0, {"root_joint": 33}),
        ("humanoid33", ("left_sole", "right_sole", "left_hand", "right_hand"), 31, 2, {}),
        ("g1", (), 0, 0, {"root_joint": 29}),
        ("upper17", (), 0, 0, {"universe": 17}),
        ("arm6", (), 0, 6, {}),
    ],
)
def test_numbers_of_joints_of_each_part(get_robot, name, frames, constraint, kept, chains):
    partition = Partitions(get_robot(name)).of(frames)
    assert (len(partition.constraint), len(partition.kept)) == (constraint, kept)
    assert {chain.body: len(chain.joints) for chain in partition.chains} == chains


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


def test_a_fixed_base_has_no_virtual_chain(get_robot):
    robot = get_robot("upper17")
    free, held = Partitions(robot).of(()), Partitions(robot).of((robot.hands[0],))
    assert (free.na, free.nu, free.nr) == (0, 17, 6)
    assert (held.nu, len(held.kept)) == (0, 6)


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
