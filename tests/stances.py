"""Where a humanoid may touch the world, for tests of the reduced dynamics."""

import numpy as np

HUMANOIDS = ("humanoid33", "g1", "talos")


def stances(robot):
    """Frames in contact, by the name of the stance."""
    left, right = robot.soles
    left_hand, right_hand = robot.hands
    return {
        "double support": (left, right),
        "left support": (left,),
        "right support": (right,),
        "hand contact": (left, right, left_hand),
        "one foot and one hand": (left, right_hand),
        "hanging by a hand": (right_hand,),
        "flight": (),
        "everything": (left, right, left_hand, right_hand),
    }


STANCES = (
    "double support", "left support", "right support", "hand contact", "one foot and one hand",
    "hanging by a hand", "flight", "everything",
)  # fmt: skip


def contact_rows(robot, dynamics, frames):
    """Jacobian and drift of all contacts, along their own axes."""
    jacobians, drifts = [np.zeros((0, robot.nv))], [np.zeros(0)]
    for frame in frames:
        kinematics = dynamics.frame(robot.frame_id(frame))
        turn = np.kron(np.eye(2), kinematics.rotation.T)
        jacobians.append(turn @ kinematics.jacobian)
        drifts.append(turn @ kinematics.bias)
    return np.concatenate(jacobians), np.concatenate(drifts)


def relative(actual, expected):
    """Largest difference, relative to the largest number that was expected."""
    return float(np.abs(actual - expected).max() / np.abs(expected).max())
