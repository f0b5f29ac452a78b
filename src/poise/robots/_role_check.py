"""`check_roles`: soles and hands on the wrong side, soles upside down or on one leg."""

from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from poise.errors import RobotError
from poise.robots._limbs import Pair
from poise.robots._robot import Robot

_ASIDE, _OPPOSED = 0.01, -0.5
"""Distance to one side that is certainly there, as offsets are rounded finer [m]; and cosine of 120
degrees between two feet, which cannot point ahead both."""

_ARM, _LEG = 3, 2
"""Hands with fewer joints of their own may be fingers that turn over, and soles with fewer joints
in common below the pelvis those of two legs of which one is locked."""


def check_roles(robot: Robot) -> None:
    """Refuse soles and hands that are certainly not where walkers take them to be.

    Limbs may cross, and a fixed base has no known direction.
    """
    if not robot.floating_base:
        return
    data = robot.model.createData()
    com = pin.centerOfMass(robot.model, data, robot.q_home)
    pin.updateFramePlacements(robot.model, data)
    soles, by_name = list(robot.soles), "their names say left and right"
    if com[2] <= 0.0:
        pelvis = float(data.oMf[robot.frame_id(robot.pelvis)].translation[2])
        raise RobotError(
            f"robot {robot.name!r} is upside down on its soles ({', '.join(soles)})",
            got=f"COM {com[2]:.3g} m and pelvis {pelvis:.3g} m above them in the home posture",
            wanted="soles whose z points up into the foot; mind their `rpy`",
        )
    if len(soles) == 2:
        _check_soles(robot, data, soles[0], soles[1])
        why = f"{soles[0]!r} is listed first, where the left one is"
        _check_side(robot, data, soles[0], soles[1], why)
    for left, right in _named_pairs(soles):
        _check_side(robot, data, left, right, by_name)
    for left, right in _named_pairs(robot.hands):
        if min(len(own) for own in _own(robot, left, right)) >= _ARM:
            _check_side(robot, data, left, right, by_name)


def _check_soles(robot: Robot, data: pin.Data, first: str, second: str) -> None:
    """Refuse two soles of one foot or leg, and feet that point apart."""
    pair = f"soles {first!r} and {second!r} of robot {robot.name!r}"
    alone = "or one sole alone, where that link is all the robot stands on"
    legs = f"the links at the ends of two legs; {alone}"
    # Soles on two links may still share all joints: their legs may be locked.
    above, below = sorted((first, second), key=lambda sole: len(robot.joints_above(sole)))
    links = [robot.roles[sole].link for sole in (above, below)]
    shared = set(robot.joints_above(above))
    moving = sorted(shared - set(robot.joints_above(robot.pelvis)))
    cosine = float(np.dot(*(data.oMf[robot.frame_id(s)].rotation[:, 0] for s in (first, second))))
    if links[0] == links[1]:
        raise RobotError(f"{pair} are on one link", got=links[0], wanted=legs)
    if len(moving) >= _LEG and shared < set(robot.joints_above(below)):
        said = f"sole {below!r} of robot {robot.name!r} is on the leg of {above!r}, further down"
        joints = ", ".join(robot.model.names[j] for j in moving)
        raise RobotError(said, got=f"{' and '.join(links)}, below {joints}", wanted=legs)
    if cosine < _OPPOSED:
        degrees = f"{np.degrees(np.arccos(max(cosine, -1.0))):.0f} degrees"
        raise RobotError(
            f"{pair} point against each other",
            got=f"{degrees} between their x axes in the home posture",
            wanted="x of both soles towards the toes; mind their `rpy`",
        )


def _own(robot: Robot, one: str, other: str) -> Pair:
    """The joints that move one frame and not another, for each of two frames."""
    above, beside = robot.joints_above(one), robot.joints_above(other)
    return tuple(j for j in above if j not in beside), tuple(j for j in beside if j not in above)


def _named_pairs(names: Iterable[str]) -> list[tuple[str, str]]:
    """Left and right names that are alike but for these words."""
    there = {name.lower(): name for name in names}
    swapped = ((name, low.replace("left", "right")) for low, name in there.items() if "left" in low)
    return [(name, there[other]) for name, other in swapped if other in there]


def _check_side(robot: Robot, data: pin.Data, left: str, right: str, why: str) -> None:
    """Refuse what is on the wrong side with its limb: a limb that crosses over ends there alone."""
    places = [data.oMf[robot.frame_id(name)].translation for name in (left, right)]
    apart = float(places[0][1] - places[1][1])
    roots = [float(data.oMi[own[0]].translation[1]) for own in _own(robot, left, right) if own]
    crossed = len(roots) == 2 and roots[0] - roots[1] > _ASIDE
    if apart < -_ASIDE and not crossed:
        links = [repr(robot.roles[name].link) for name in (left, right)]
        where = f"{left!r} on {links[0]}, {-apart:.3g} m to the right of {right!r} on {links[1]}"
        raise RobotError(
            f"{left!r} and {right!r} of robot {robot.name!r} are on the wrong sides ({why})",
            got=f"{where} in the home posture, seen along the soles' mean x",
            wanted="left on the left, the left sole listed first, x of the soles towards the toes",
        )
