"""Equalities and tendons of a user's MuJoCo model that act on the robot."""

from collections.abc import Collection, Iterable

import mujoco
import numpy as np

from poise.errors import RobotError, UnknownNameError
from poise.robots import Robot
from poise.sim._mapping import StateMap

_OBJECTS = {
    "JOINT": mujoco.mjtObj.mjOBJ_JOINT,
    "TENDON": mujoco.mjtObj.mjOBJ_TENDON,
    "FLEX": mujoco.mjtObj.mjOBJ_FLEX,
}  # Things that equalities tie, by what the names of their kinds begin with


def check_equalities(
    robot: Robot, model: mujoco.MjModel, mapping: StateMap, accepted: Collection[str]
) -> list[str]:
    """Refuse active equalities that act on the robot, but for those accepted by name.

    A robot has no equalities: its joints move independently. One in the model acts on it if it
    couples a joint of the robot, or bodies that a joint of the robot, or its base, moves
    separately. Equalities of other things, or of what one link of the robot carries, do not.
    """
    names = [model.equality(k).name or f"equality {k}" for k in range(model.neq)]
    for name in accepted:
        if name not in names:
            raise UnknownNameError("unknown equality of the model", got=name, choices=names)
    own = {*mapping.joints, mapping.free_joint}
    acting = {
        names[k]: _describe(model, k, names[k])
        for k in range(model.neq)
        if model.eq_active0[k] and own & _coupled_joints(model, k)
    }
    refused = [text for name, text in acting.items() if name not in accepted]
    if refused:
        raise RobotError(
            f"equalities of the MuJoCo model act on robot {robot.name!r}, whose joints move "
            "independently to the controller",
            got=refused,
            wanted='each deactivated (active="false"), its joints locked in the description that '
            "the robot is loaded with, or its name in accept_equalities",
        )
    return [text for name, text in acting.items() if name in accepted]


def pulling_tendons(model: mujoco.MjModel, mapping: StateMap) -> list[str]:
    """Names of tendons that act on the robot's joints without an actuator."""
    own = {*mapping.joints, mapping.free_joint}
    kinds = ("limited", "stiffness", "damping", "frictionloss", "armature")
    pulls = np.any([getattr(model, f"tendon_{kind}") for kind in kinds], axis=0)
    acting = (int(k) for k in np.flatnonzero(pulls) if own & _tendon_joints(model, int(k)))
    return [_name(model, mujoco.mjtObj.mjOBJ_TENDON, k) for k in acting]


def _describe(model: mujoco.MjModel, equality: int, name: str) -> str:
    kind = mujoco.mjtEq(model.eq_type[equality]).name.removeprefix("mjEQ_").lower()
    what = _kind_of_objects(model, equality)
    things = (_name(model, what, i) for i in _objects(model, equality))
    return f"{name} ({kind}): {', '.join(things)}"


def _name(model: mujoco.MjModel, what: mujoco.mjtObj, index: int) -> str:
    kind = what.name.removeprefix("mjOBJ_").lower()
    return mujoco.mj_id2name(model, what, index) or f"{kind} {index}"


def _objects(model: mujoco.MjModel, equality: int) -> list[int]:
    return [int(i) for i in (model.eq_obj1id[equality], model.eq_obj2id[equality]) if i >= 0]


def _kind_of_objects(model: mujoco.MjModel, equality: int) -> mujoco.mjtObj:
    """Kind of the things that an equality ties; MJCF text says it of bodies and sites only."""
    kind = mujoco.mjtEq(model.eq_type[equality]).name.removeprefix("mjEQ_")
    told = {name: obj for name, obj in _OBJECTS.items() if kind.startswith(name)}
    return next(iter(told.values()), mujoco.mjtObj(model.eq_objtype[equality]))


def _coupled_joints(model: mujoco.MjModel, equality: int) -> set[int]:
    """Joints in whose coordinates the constraint's Jacobian has entries."""
    objects, what = _objects(model, equality), _kind_of_objects(model, equality)
    if what == mujoco.mjtObj.mjOBJ_JOINT:
        return set(objects)
    if what == mujoco.mjtObj.mjOBJ_TENDON:
        return set().union(*(_tendon_joints(model, tendon) for tendon in objects))
    if what == mujoco.mjtObj.mjOBJ_SITE:
        return _separating_joints(model, model.site_bodyid[objects].tolist())
    if what == mujoco.mjtObj.mjOBJ_FLEX:
        return _separating_joints(model, _flex_bodies(model, objects[0]))
    return _separating_joints(model, objects)


def _tendon_joints(model: mujoco.MjModel, tendon: int) -> set[int]:
    start = int(model.tendon_adr[tendon])
    joints, bodies = set[int](), list[int]()
    for k in range(start, start + int(model.tendon_num[tendon])):
        kind, index = model.wrap_type[k], int(model.wrap_objid[k])
        if kind == mujoco.mjtWrap.mjWRAP_JOINT:
            joints.add(index)
        elif kind == mujoco.mjtWrap.mjWRAP_SITE:
            bodies.append(int(model.site_bodyid[index]))
        elif kind in (mujoco.mjtWrap.mjWRAP_SPHERE, mujoco.mjtWrap.mjWRAP_CYLINDER):
            bodies.append(int(model.geom_bodyid[index]))
    return joints | _separating_joints(model, bodies)


def _flex_bodies(model: mujoco.MjModel, flex: int) -> list[int]:
    """Bodies that a flex's vertices and nodes are fixed to; an interpolated vertex has none."""
    vertex, node = model.flex_vertadr[flex], model.flex_nodeadr[flex]
    bodies = [
        *model.flex_vertbodyid[vertex : vertex + model.flex_vertnum[flex]],
        *model.flex_nodebodyid[node : node + model.flex_nodenum[flex]],
    ]
    return [int(body) for body in bodies if body >= 0]


def _separating_joints(model: mujoco.MjModel, bodies: Iterable[int]) -> set[int]:
    """Joints that move some of the bodies and not all."""
    above = [_joints_above(model, body) for body in bodies]
    return set().union(*above) - set.intersection(*above) if above else set()


def _joints_above(model: mujoco.MjModel, body: int) -> set[int]:
    joints = set[int]()
    while body > 0:
        first = int(model.body_jntadr[body])
        joints.update(range(first, first + int(model.body_jntnum[body])))
        body = int(model.body_parentid[body])
    return joints
