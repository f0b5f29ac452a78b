"""A biped of 11 joints, written by hand: these tests depend on no loader and no catalog."""

import numpy as np
import pinocchio as pin

from poise.robots import FrameRole, ModelSource, Robot, Sole

THIGH, SHANK, ANKLE = 0.35, 0.35, 0.08
SOLE_LENGTH, SOLE_WIDTH = 0.22, 0.12
MASS = 12.0 + 15.0 + 2 * (0.5 + 5.0 + 3.0 + 0.3 + 1.2)


def _link(name, mass, size, center=(0, 0, 0), collision=False):
    x, y, z = size
    inertia = [mass / 12 * (b * b + c * c) for b, c in ((y, z), (x, z), (x, y))]
    origin = f'<origin xyz="{center[0]} {center[1]} {center[2]}"/>'
    box = f'{origin}<geometry><box size="{x} {y} {z}"/></geometry>'
    return (
        f'<link name="{name}"><inertial>{origin}<mass value="{mass}"/>'
        f'<inertia ixx="{inertia[0]}" iyy="{inertia[1]}" izz="{inertia[2]}" '
        f'ixy="{0.05 * min(inertia)}" ixz="0" iyz="0"/></inertial><visual>{box}</visual>'
        + (f"<collision>{box}</collision>" if collision else "")
        + "</link>"
    )


def _joint(name, parent, child, axis, xyz, effort=150.0):
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz[0]} {xyz[1]} {xyz[2]}"/><axis xyz="{axis}"/>'
        f'<limit lower="-2.5" upper="2.5" velocity="20" effort="{effort}"/></joint>'
    )


def _leg(side, y):
    links = [
        _link(f"{side}_hip", 0.5, (0.08, 0.08, 0.08)),
        _link(f"{side}_thigh", 5.0, (0.1, 0.1, THIGH), (0, 0, -THIGH / 2), collision=True),
        _link(f"{side}_shank", 3.0, (0.08, 0.08, SHANK), (0.01, 0, -SHANK / 2)),
        _link(f"{side}_ankle", 0.3, (0.05, 0.05, 0.05)),
        # The document's own collision box is wrong on purpose: it must not be what touches.
        _link(
            f"{side}_foot",
            1.2,
            (SOLE_LENGTH, SOLE_WIDTH, 0.12),
            (0.03, 0, -ANKLE + 0.02),
            collision=True,
        ),
    ]
    joints = [
        _joint(f"{side}_hip_roll", "base", f"{side}_hip", "1 0 0", (0, y, -0.05)),
        _joint(f"{side}_hip_pitch", f"{side}_hip", f"{side}_thigh", "0 1 0", (0, 0, 0)),
        _joint(f"{side}_knee", f"{side}_thigh", f"{side}_shank", "0 1 0", (0, 0, -THIGH)),
        _joint(f"{side}_ankle_pitch", f"{side}_shank", f"{side}_ankle", "0 1 0", (0, 0, -SHANK)),
        _joint(f"{side}_ankle_roll", f"{side}_ankle", f"{side}_foot", "1 0 0", (0, 0, 0)),
    ]
    return "".join(links), "".join(joints)


def document():
    right, left = _leg("right", -0.1), _leg("left", 0.1)
    # The right leg stands first: Pinocchio orders branches by name, MuJoCo by the document.
    return (
        '<robot name="small_biped">'
        + _link("base", 12.0, (0.2, 0.3, 0.15))
        + right[0]
        + left[0]
        + _link("chest", 15.0, (0.2, 0.35, 0.4), (0, 0, 0.25), collision=True)
        + '<link name="tip"/>'
        + right[1]
        + left[1]
        + _joint("waist", "base", "chest", "0 0 1", (0, 0, 0.08))
        + '<joint name="tip_joint" type="fixed"><parent link="chest"/><child link="tip"/>'
        + '<origin xyz="0.2 0 0.3" rpy="0.1 0.2 0.3"/></joint></robot>'
    )


def _roles():
    def role(name, link, position=(0.0, 0.0, 0.0), rotation=None):
        return FrameRole(
            name=name,
            link=link,
            position=np.array(position, dtype=np.float64),
            rotation=np.eye(3) if rotation is None else rotation,
        )

    return {
        r.name: r
        for r in (
            role("left_sole", "left_foot", (0.03, 0.0, -ANKLE)),
            role("right_sole", "right_foot", (0.03, 0.0, -ANKLE)),
            role("left_hand", "tip", (0.0, 0.1, 0.0), pin.utils.rotate("x", 0.4)),
            role("pelvis", "base"),
            role("torso", "chest", (0.0, 0.0, 0.2)),
        )
    }


def small_biped(text=None, **changes):
    text = document() if text is None else text
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    model.armature = np.r_[np.zeros(6), np.linspace(0.01, 0.03, model.nv - 6)]
    roles = _roles()
    for r in roles.values():
        parent = model.getFrameId(r.link)
        frame = model.frames[parent]
        placement = frame.placement * pin.SE3(r.rotation, r.position)
        model.addFrame(
            pin.Frame(r.name, frame.parentJoint, parent, placement, pin.FrameType.OP_FRAME)
        )
    q_home = pin.neutral(model)
    for side in ("left", "right"):
        for joint, angle in (("hip_pitch", -0.3), ("knee", 0.6), ("ankle_pitch", -0.3)):
            q_home[model.joints[model.getJointId(f"{side}_{joint}")].idx_q] = angle
    data = model.createData()
    pin.framesForwardKinematics(model, data, q_home)
    q_home[2] -= data.oMf[model.getFrameId("left_sole")].translation[2]
    facts = {
        "name": "small_biped",
        "model": model,
        "floating_base": True,
        "joint_names": tuple(model.names)[2:],
        "q_min": model.lowerPositionLimit[7:].copy(),
        "q_max": model.upperPositionLimit[7:].copy(),
        "v_max": model.velocityLimit[6:].copy(),
        "tau_max": model.effortLimit[6:].copy(),
        "soles": {
            n: Sole(name=n, length=SOLE_LENGTH, width=SOLE_WIDTH)
            for n in ("left_sole", "right_sole")
        },
        "hands": ("left_hand",),
        "pelvis": "pelvis",
        "torso": "torso",
        "roles": roles,
        "q_home": q_home,
        "licence": "Apache-2.0",
        "source": ModelSource(kind="urdf", text=text),
    }
    return Robot(**(facts | changes))


def random_state(robot, rng):
    q = pin.integrate(robot.model, robot.q_home, rng.uniform(-0.7, 0.7, robot.nv))
    return q, rng.uniform(-1.0, 1.0, robot.nv)


def torque(values):
    from poise.control import Command, CommandStatus

    return Command(status=CommandStatus.OK, torque=np.asarray(values, dtype=np.float64))


def velocity(values):
    from poise.control import Command, CommandStatus

    return Command(status=CommandStatus.OK, velocity=np.asarray(values, dtype=np.float64))
