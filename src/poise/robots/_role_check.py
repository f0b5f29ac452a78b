"""`check_roles`: soles and hands on the wrong side, soles upside down or on one leg."""

from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from poise.errors import RobotError
from poise.robots._robot import Robot

_ASIDE = 0.01
"""What is this far to one side of another is certainly there [m]."""

_OPPOSED = -0.5
"""Cosine of the angle between two feet that cannot point ahead both: 120 degrees."""

_FEWEST = 3
"""Hands with fewer joints of their own are no two arms': they may be fingers that turn over."""

_LEG = 2
"""Soles with fewer joints in common, below the pelvis, may be those of two legs, one locked."""

_BY_NAME = "their names say left and right"
_SPELLINGS = (("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT"))


def check_roles(robot: Robot) -> None:
    """Check that soles and hands are where walkers and teleoperation take them to be.

    Only what is certain is refused: limbs may cross, and a fixed base has no known direction.

    Args:
        robot: with a home posture, in which its soles' mean direction is x.

    Raises:
        RobotError: the robot hangs below its soles, two soles are on one link or one leg, or point
            against each other, or what is left by its name or place in the list is on the right.
    """
    if not robot.floating_base:
        return
    data = robot.model.createData()
    com = pin.centerOfMass(robot.model, data, robot.q_home)
    pin.updateFramePlacements(robot.model, data)
    soles = list(robot.soles)
    if com[2] <= 0.0:
        pelvis = float(data.oMf[robot.frame_id(robot.pelvis)].translation[2])
        raise RobotError(
            f"robot {robot.name!r} is upside down on its soles ({', '.join(soles)})",
            got=f"COM {com[2]:.3g} m and pelvis {pelvis:.3g} m above them in the home posture",
            wanted="soles whose z points up into the foot; mind their `rpy`",
        )
    if len(soles) == 2:
        first, second = soles
        _check_legs(robot, first, second)
        _check_directions(robot, data, first, second)
        _check_side(robot, data, first, second, f"{first!r} is listed first, where the left one is")
    for left, right in _named_pairs(soles):
        _check_side(robot, data, left, right, _BY_NAME)
    for left, right in _named_pairs(robot.hands):
        if min(len(own) for own in _own_joints(robot, left, right)) >= _FEWEST:
            _check_side(robot, data, left, right, _BY_NAME)


def _check_legs(robot: Robot, first: str, second: str) -> None:
    """Soles on two links may still share all joints: their legs may be locked."""
    wanted = (
        "the links at the ends of two legs; or one sole alone, where that link is all the robot "
        "stands on"
    )
    link = robot.roles[first].link
    if robot.roles[second].link == link:
        raise RobotError(
            f"soles {first!r} and {second!r} of robot {robot.name!r} are on one link",
            got=link,
            wanted=wanted,
        )
    above, below = sorted((first, second), key=lambda sole: len(robot.joints_above(sole)))
    shared = set(robot.joints_above(above))
    moving = shared - set(robot.joints_above(robot.pelvis))
    if len(moving) >= _LEG and shared < set(robot.joints_above(below)):
        raise RobotError(
            f"sole {below!r} of robot {robot.name!r} is on the leg of {above!r}, further down",
            got=f"{robot.roles[above].link} and {robot.roles[below].link}, below "
            f"{', '.join(robot.model.names[j] for j in sorted(moving))}",
            wanted=wanted,
        )


def _check_directions(robot: Robot, data: pin.Data, first: str, second: str) -> None:
    ahead = [data.oMf[robot.frame_id(sole)].rotation[:, 0] for sole in (first, second)]
    cosine = float(ahead[0] @ ahead[1])
    if cosine < _OPPOSED:
        raise RobotError(
            f"soles {first!r} and {second!r} of robot {robot.name!r} point against each other",
            got=f"{np.degrees(np.arccos(max(cosine, -1.0))):.0f} degrees between their x axes in "
            "the home posture",
            wanted="x of both soles towards the toes; mind their `rpy`",
        )


def _named_pairs(names: Iterable[str]) -> list[tuple[str, str]]:
    """Left and right names that are alike but for these words."""
    there = list(names)
    return [
        (name, other)
        for name in there
        for left, right in _SPELLINGS
        if left in name and (other := name.replace(left, right)) in there
    ]


def _own_joints(robot: Robot, one: str, other: str) -> tuple[list[int], list[int]]:
    """The joints that move one frame and not the other, from the trunk outwards."""
    above, beside = robot.joints_above(one), robot.joints_above(other)
    return [j for j in above if j not in beside], [j for j in beside if j not in above]


def _check_side(robot: Robot, data: pin.Data, left: str, right: str, why: str) -> None:
    """Refuse what is on the wrong side with its limb: a limb that crosses over ends there alone."""
    places = [data.oMf[robot.frame_id(name)].translation for name in (left, right)]
    apart = float(places[0][1] - places[1][1])
    own = _own_joints(robot, left, right)
    roots = [float(data.oMi[joints[0]].translation[1]) for joints in own if joints]
    crossed = len(roots) == 2 and roots[0] - roots[1] > _ASIDE
    if apart < -_ASIDE and not crossed:
        raise RobotError(
            f"{left!r} and {right!r} of robot {robot.name!r} are on the wrong sides ({why})",
            got=f"{left!r} on {robot.roles[left].link!r}, {-apart:.3g} m to the right of {right!r} "
            f"on {robot.roles[right].link!r} in the home posture, seen along the soles' mean x",
            wanted="left on the left, the left sole listed first, and x of the soles towards the "
            "toes",
        )
