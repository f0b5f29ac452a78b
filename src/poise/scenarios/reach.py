"""How far an arm reaches, from the robot's own kinematics."""

import numpy as np
from jaxtyping import Float64

from poise.dynamics.dynamics import Dynamics
from poise.errors import ScenarioError
from poise.robots.robot import Robot


def reach_point(
    robot: Robot,
    dynamics: Dynamics,
    hand: str,
    direction: Float64[np.ndarray, "3"],
    share: float,
) -> Float64[np.ndarray, "3"]:
    """A point along a direction from the shoulder, at a share of the arm's length.

    The shoulder is the first joint between torso and hand; the arm's length is the sum of its
    links' lengths, an upper bound that offsets between joint axes keep from being reached exactly.

    Args:
        robot: the robot.
        dynamics: its state, up to date.
        hand: frame of the hand.
        direction: unit vector in the world.
        share: share of the arm's length; above one is out of reach.

    Returns:
        The point in the world [m].

    Raises:
        ScenarioError: the frame has no arm of its own.
    """
    chain = require_arm(robot, hand)
    model = robot.model
    hand_frame = model.frames[robot.frame_id(hand)]
    length = float(np.linalg.norm(hand_frame.placement.translation))
    length += sum(float(np.linalg.norm(model.jointPlacements[j].translation)) for j in chain[1:])
    shoulder = dynamics.joint_position(chain[0])
    return shoulder + share * length * direction


def require_arm(robot: Robot, hand: str) -> list[int]:
    """Pinocchio's indices of the joints from the torso to a hand, shoulder first.

    Args:
        robot: the robot.
        hand: frame of the hand.

    Raises:
        ScenarioError: the frame has no arm of its own.
    """
    model = robot.model
    torso = model.frames[robot.frame_id(robot.torso)].parentJoint
    torso_chain = set(model.supports[torso].tolist())
    hand_joint = model.frames[robot.frame_id(hand)].parentJoint
    chain = [j for j in model.supports[hand_joint].tolist() if j not in torso_chain]
    if not chain:
        raise ScenarioError(
            "no joint between torso and frame to reach with",
            got=hand,
            wanted="a frame at the end of an arm",
            choices=robot.hands,
        )
    return chain
