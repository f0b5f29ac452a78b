"""`arm_chains`, `neck_chain`: joints of arms and neck."""

import numpy as np
from jaxtyping import Int64

from poise.robots import Robot

_HEADS = ("head", "neck")
"""Names of frames that a head carries."""


def arm_chains(robot: Robot) -> dict[str, Int64[np.ndarray, " k"]]:
    """Joints of each arm, from the torso on, by its hand; no joint that moves both hands."""
    torso = robot.joints_above(robot.torso)
    above = {hand: robot.joints_above(hand) for hand in robot.hands}
    own: dict[str, Int64[np.ndarray, " k"]] = {}
    for hand, joints in above.items():
        others = set(torso).union(*(above[h] for h in above if h != hand))
        index = [j - _first(robot) for j in joints if j not in others]
        if len(index) >= 3:
            own[hand] = np.array(index, dtype=np.int64)
    return own


def neck_chain(robot: Robot) -> dict[str, Int64[np.ndarray, " k"]]:
    """Joints between the torso and its head, by a frame of the head; empty without a neck.

    The head is what frames of that name are on that most joints beyond the torso move, none of
    which moves a hand or a sole.
    """
    torso = set(robot.joints_above(robot.torso))
    others = torso.union(*(robot.joints_above(name) for name in (*robot.hands, *robot.soles)))
    found, best = set[int](), ""
    for each in robot.model.frames:
        if any(word in each.name.lower() for word in _HEADS):
            above = set(robot.model.supports[each.parentJoint].tolist()) - {0}
            own = above - others
            if torso <= above and len(own) > len(found):
                found, best = own, each.name
    index = np.array(sorted(j - _first(robot) for j in found), dtype=np.int64)
    return {best: index} if found else {}


def _first(robot: Robot) -> int:
    """Pinocchio's index of the first actuated joint: joint 0 is the world."""
    return 2 if robot.floating_base else 1
