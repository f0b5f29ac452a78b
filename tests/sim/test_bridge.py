"""A controller in a user's own MuJoCo loop: any order, any actuators, and what is refused."""

import re
import warnings

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from small_biped import random_state, torque, velocity

import poise
from poise.errors import ConfigurationError, RobotError, UnknownNameError
from poise.sim import MujocoBridge, Plant, PlantConfig
from poise.sim._build import build_model
from poise.sim._document import parse_document

SEEDS = range(2)


def user_spec(robot, *, integrator=mujoco.mjtIntegrator.mjINT_IMPLICITFAST):
    """The robot as a user would have it: a floor, feet, no actuators."""
    spec = parse_document(robot.source)
    spec.option.integrator = integrator
    spec.option.timestep = 1e-3
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_AUTO
    # Friction that holds, as the plant has it.
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
    spec.worldbody.first_body().add_freejoint()
    for element in [*spec.geoms, *spec.meshes]:
        spec.delete(element)
    for name, sole in robot.soles.items():
        role = robot.roles[name]
        spec.body(role.link).add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=(sole.length / 2, sole.width / 2, 0.01),
            pos=role.position + role.rotation @ [0.0, 0.0, 0.01],
            mass=0.0,
        )
    for joint, inertia in zip(robot.joint_names, robot.model.armature[6:], strict=True):
        spec.joint(joint).armature = inertia
    return spec


def add_motors(spec, robot, names=None, gear=1.0):
    for name in robot.joint_names if names is None else names:
        motor = spec.add_actuator(name=f"{name}_motor", target=name)
        motor.trntype, motor.gear[0] = mujoco.mjtTrn.mjTRN_JOINT, gear
    return spec


def add_servos(spec, robot, kp=100.0, kv=2.0, gear=1.0):
    for name, limit in zip(robot.joint_names, robot.tau_max, strict=True):
        servo = spec.add_actuator(name=name, target=name, forcerange=(-limit, limit))
        servo.trntype, servo.gear[0] = mujoco.mjtTrn.mjTRN_JOINT, gear
        servo.set_to_position(kp=kp, kv=kv)
    return spec


def add_floor(spec):
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
    return spec


def scene(robot, *, wrapped=False):
    """Objects first, the robot attached behind them under a prefix, its branches turned round."""
    spec = add_motors(user_spec(robot), robot)
    if wrapped:
        root = spec.worldbody.first_body()
        free = root.first_joint()
        spec.delete(free)
    world = mujoco.MjSpec()
    world.option.timestep, world.option.integrator = 1e-3, 3
    world.option.cone, world.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
    ball = world.worldbody.add_body(name="ball", pos=(2.0, 0.0, 1.0))
    ball.add_freejoint()
    ball.add_geom(size=(0.1, 0.1, 0.1))
    door = world.worldbody.add_body(name="door", pos=(3.0, 0.0, 1.0))
    door.add_joint(name="hinge")
    door.add_geom(size=(0.1, 0.1, 0.1), pos=(0.2, 0.0, 0.0))
    if wrapped:
        body = world.worldbody.add_body(name="carrier", pos=(0.0, 0.0, 1.0))
        body.add_freejoint()
        frame = body.add_frame(pos=(0.1, -0.2, 0.3), quat=(0.9, 0.1, -0.2, 0.3))
    else:
        frame = world.worldbody.add_frame()
    frame.attach_body(spec.worldbody.first_body(), "here/", "")
    return add_floor(world)


def shuffled(spec, robot):
    """The same robot with its motors and joints in another order."""
    order = np.random.default_rng(1).permutation(robot.nj)
    return add_motors(spec, robot, [robot.joint_names[k] for k in order])


def quiet_bridge(robot, model, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return MujocoBridge(robot, model, **options)


def test_the_same_model_moves_to_the_last_bit_as_in_a_plant(biped):
    plant = Plant(biped)
    bridge, data = MujocoBridge(biped, plant.model), mujoco.MjData(plant.model)
    data.qpos[:], data.qvel[:] = plant.data.qpos, plant.data.qvel
    data.qacc_warmstart[:] = plant.data.qacc_warmstart
    mujoco.mj_forward(plant.model, data)
    ours, theirs = poise.WholeBodyController(biped), poise.WholeBodyController(biped)
    for _ in range(100):
        plant.step(ours.step(plant.state()))
        command = theirs.step(bridge.state(data))
        given = bridge.apply(command, data)
        np.testing.assert_array_equal(given, command.torque)
        mujoco.mj_step(plant.model, data)
        np.testing.assert_array_equal(data.qpos, plant.data.qpos)
        state = bridge.state(data)
        for name, wrench in plant.sole_wrenches().items():
            np.testing.assert_allclose(state.contacts[name], wrench, rtol=0, atol=1e-9)


@pytest.mark.parametrize("wrapped", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_states_and_frames_in_a_scene_are_as_pinocchio_says(biped, seed, wrapped):
    model = scene(biped, wrapped=wrapped).compile()
    bridge, data = quiet_bridge(biped, model), mujoco.MjData(model)
    rng = np.random.default_rng(seed)
    data.qvel[:] = rng.normal(size=model.nv)
    q, v = random_state(biped, rng)
    ball, hinge = data.joint("hinge").qpos.copy(), data.qvel[:6].copy()
    bridge.place(data, q, v)
    state = bridge.state(data)
    np.testing.assert_allclose(state.q, q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(state.v, v, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(data.joint("hinge").qpos, ball)
    np.testing.assert_array_equal(data.qvel[:6], hinge)
    ours = biped.model.createData()
    pin.forwardKinematics(biped.model, ours, q, v)
    pin.updateFramePlacements(biped.model, ours)
    for link in ("base", "chest", "left_foot", "right_foot"):
        frame = biped.frame_id(link)
        body = model.body(f"here/{link}").id
        np.testing.assert_allclose(data.xpos[body], ours.oMf[frame].translation, atol=1e-12)
        motion = np.empty(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, motion, 0)
        expected = pin.getFrameVelocity(biped.model, ours, frame, pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(motion, [*expected.angular, *expected.linear], atol=1e-11)


ACTUATORS = {
    "motors": lambda spec, robot: add_motors(spec, robot),
    "geared motors": lambda spec, robot: add_motors(spec, robot, gear=-12.5),
    "motors in another order": shuffled,
    "servos": add_servos,
    "motors beside velocity servos": lambda spec, robot: with_dampers(
        add_motors(spec, robot), robot
    ),
    "general actuators": lambda spec, robot: add_general(spec, robot),
}


def with_dampers(spec, robot):
    for name in robot.joint_names:
        servo = spec.add_actuator(name=f"{name}_speed", target=name, ctrlrange=(-30.0, 30.0))
        servo.trntype = mujoco.mjtTrn.mjTRN_JOINT
        servo.set_to_velocity(kv=5.0)
    return spec


def add_general(spec, robot):
    for name in robot.joint_names:
        general = spec.add_actuator(name=name, target=name)
        general.trntype = mujoco.mjtTrn.mjTRN_JOINT
        general.gaintype, general.biastype = (
            mujoco.mjtGain.mjGAIN_AFFINE,
            mujoco.mjtBias.mjBIAS_AFFINE,
        )
        general.gainprm[:3], general.biasprm[:3] = (20.0, 1.0, 0.5), (3.0, -7.0, -1.5)
    return spec


@pytest.mark.parametrize("kind", ACTUATORS)
@pytest.mark.parametrize("seed", SEEDS)
def test_actuators_of_each_kind_give_the_torque(biped, kind, seed):
    model = ACTUATORS[kind](user_spec(biped), biped).compile()
    bridge, data = quiet_bridge(biped, model), mujoco.MjData(model)
    rng = np.random.default_rng(seed)
    bridge.place(data, *random_state(biped, rng))
    wanted = rng.uniform(-30.0, 30.0, biped.nj)
    given = bridge.apply(torque(wanted), data)
    np.testing.assert_allclose(given, wanted, rtol=0, atol=1e-10)
    mujoco.mj_forward(model, data)
    acting = data.qfrc_actuator[bridge.map.dof_order][6:]
    np.testing.assert_allclose(acting, wanted, rtol=0, atol=1e-10)


def test_servos_give_the_torque_at_the_end_of_an_implicit_step(biped):
    """Their damping acts at the end of the step, and the controller knows how fast that will be."""
    robot, ends = biped, []
    for add in (add_motors, lambda spec, robot: add_servos(spec, robot, kv=8.0)):
        model = add(user_spec(robot), robot).compile()
        bridge, data = quiet_bridge(robot, model), mujoco.MjData(model)
        q = robot.q_home.copy()
        q[2] += 2.0
        bridge.place(data, q)
        wanted = np.linspace(-20.0, 20.0, robot.nj)
        tau = np.r_[np.zeros(6), wanted]
        acceleration = pin.aba(robot.model, robot.model.createData(), q, np.zeros(robot.nv), tau)
        command = poise.Command(
            poise.CommandStatus.OK, torque=wanted, acceleration=np.array(acceleration)
        )
        bridge.apply(command, data)
        mujoco.mj_step(model, data)
        ends.append(bridge.state(data).v)
    assert np.abs(ends[0]).max() > 0.1
    np.testing.assert_allclose(ends[1], ends[0], rtol=0, atol=1e-9)


def test_ranges_cut_the_torque_and_the_answer_says_so(biped):
    spec = add_servos(user_spec(biped), biped)
    knee = spec.actuator("left_knee")
    knee.ctrllimited, knee.ctrlrange = True, (-2.5, 0.7)
    spec.actuator("right_knee").forcerange = (-15.0, 15.0)
    spec.joint("waist").actfrclimited, spec.joint("waist").actfrcrange = True, (-7.0, 7.0)
    model = spec.compile()
    with pytest.warns(UserWarning, match="torque limits of 3 joints"):
        bridge = MujocoBridge(biped, model)
    data = mujoco.MjData(model)
    bridge.place(data)
    wanted = np.full(biped.nj, 40.0)
    given = bridge.apply(torque(wanted), data)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(
        data.qfrc_actuator[bridge.map.dof_order][6:], given, rtol=0, atol=1e-12
    )
    short = {n: t for n, t in zip(biped.joint_names, given, strict=True) if t < 39.9}
    assert short == pytest.approx({"left_knee": 10.0, "right_knee": 15.0, "waist": 7.0})


def test_nan_never_reaches_the_controls(biped):
    model = add_servos(user_spec(biped), biped).compile()
    bridge, data = quiet_bridge(biped, model), mujoco.MjData(model)
    bridge.place(data)
    bridge.apply(torque(np.full(biped.nj, 5.0)), data)
    before = data.ctrl.copy()
    given = bridge.apply(torque(np.full(biped.nj, np.nan)), data)
    assert bridge.rejected == 1
    np.testing.assert_allclose(given, 0.0, atol=1e-12)
    assert np.isfinite(data.ctrl).all()
    bridge.apply(torque(np.full(biped.nj, 5.0)), data)
    np.testing.assert_array_equal(data.ctrl, before)
    data.qpos[9] = np.nan
    bridge.apply(torque(np.full(biped.nj, 7.0)), data)
    assert bridge.rejected == 2
    np.testing.assert_array_equal(data.ctrl, before)


def test_a_joint_without_an_actuator_gets_its_torque_and_a_word(biped):
    moved = [name for name in biped.joint_names if name != "waist"]
    model = add_motors(user_spec(biped), biped, moved).compile()
    with pytest.warns(UserWarning, match=r"no actuator moves.*qfrc_applied: waist"):
        bridge = MujocoBridge(biped, model)
    data = mujoco.MjData(model)
    bridge.place(data)
    wanted = np.linspace(-20.0, 20.0, biped.nj)
    np.testing.assert_array_equal(bridge.apply(torque(wanted), data), wanted)
    total = (data.qfrc_applied + 0.0)[bridge.map.dof_order][6:]
    mujoco.mj_forward(model, data)
    total += data.qfrc_actuator[bridge.map.dof_order][6:]
    np.testing.assert_allclose(total, wanted, rtol=0, atol=1e-12)


def test_servos_follow_velocities_from_where_the_joints_are(biped):
    model = add_servos(user_spec(biped), biped, kp=400.0, kv=20.0)
    model.option.gravity = (0.0, 0.0, 0.0)
    model = model.compile()
    bridge, data = quiet_bridge(biped, model), mujoco.MjData(model)
    bridge.place(data)
    wanted = np.full(biped.nj, 0.1)
    for _ in range(1000):
        bridge.apply(velocity(wanted), data)
        mujoco.mj_step(model, data)
    moved = bridge.state(data).q[7:] - biped.q_home[7:]
    np.testing.assert_allclose(moved, 0.1, rtol=0, atol=2e-3)
    # From its new place after it was put elsewhere, and not from where the targets were.
    bridge.place(data)
    bridge.apply(velocity(np.zeros(biped.nj)), data)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qfrc_actuator, 0.0, atol=1e-9)


def test_commands_and_data_that_do_not_fit_are_refused(biped):
    model = add_motors(user_spec(biped), biped).compile()
    bridge, data = quiet_bridge(biped, model), mujoco.MjData(model)
    for command, message in (
        (velocity(np.zeros(biped.nj)), r"cannot be sent a velocity.*left_knee.*no servo"),
        (torque(np.zeros(3)), "wrong command"),
        (poise.Command(poise.CommandStatus.OK), "neither torque nor velocity"),
    ):
        with pytest.raises(ConfigurationError, match=message):
            bridge.apply(command, data)
    with pytest.raises(ConfigurationError, match="another model"):
        bridge.state(mujoco.MjData(scene(biped).compile()))


def edit(change):
    """The motors' model with something changed."""

    def make(robot):
        spec = add_motors(user_spec(robot), robot)
        change(spec)
        return spec.compile()

    return make


def set_axis(spec):
    spec.joint("left_knee").axis = (0, -1, 0)


def set_zero(spec):
    spec.joint("left_knee").ref = 0.3


def make_fixed(spec):
    spec.delete(spec.worldbody.first_body().first_joint())


def add_muscle(spec):
    actuator = spec.actuator("left_knee_motor")
    actuator.set_to_muscle(tausmooth=0.0)


def add_tendon(spec):
    tendon = spec.add_tendon(name="cable")
    tendon.wrap_joint("left_knee", 1.0)
    tendon.wrap_joint("left_hip_pitch", -1.0)
    spec.delete(spec.actuator("left_knee_motor"))
    spec.add_actuator(name="winch", target="cable", trntype=mujoco.mjtTrn.mjTRN_TENDON)


def move_waist(spec):
    chest = spec.body("chest")
    chest.pos = chest.pos + np.array([0.0, 0.0, 0.011])


REFUSALS = {
    "a joint of another name": (
        lambda spec: setattr(spec.joint("waist"), "name", "middle"),
        r"not in the MuJoCo model; got \['waist'\]; choices:.*middle",
    ),
    "a joint that turns the other way": (set_axis, r"stand or turn elsewhere.*left_knee"),
    "a joint with another zero": (set_zero, r"stand or turn elsewhere.*left_ankle_pitch"),
    "a joint elsewhere": (move_waist, r"waist: 10 mm, .*load the robot from the MJCF"),
    "a base that is not free": (make_fixed, r"floating base.*body 'base'.*no free joint"),
    "a slide for a hinge": (
        lambda spec: setattr(spec.joint("left_ankle_roll"), "type", mujoco.mjtJoint.mjJNT_SLIDE),
        r"of another kind in the MuJoCo.*'left_ankle_roll'",
    ),
    "a muscle": (add_muscle, r"cannot be sent.*left_knee_motor of joint left_knee.*MUSCLE"),
    "a tendon": (add_tendon, r"through tendons.*winch on left_hip_pitch, left_knee"),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_what_cannot_work_is_refused_before_anything_moves(biped, case):
    change, message = REFUSALS[case]
    if "name" in case:
        spec = user_spec(biped)
        change(spec)
        model = spec.compile()
    else:
        model = edit(change)(biped)
    with pytest.raises(RobotError, match=message):
        MujocoBridge(biped, model)


def test_of_two_robots_in_a_scene_one_has_to_be_named(biped):
    world = mujoco.MjSpec()
    world.option.timestep, world.option.integrator = 1e-3, 3
    world.option.cone, world.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
    for prefix in ("a/", "b/"):
        spec = add_motors(user_spec(biped), biped)
        world.worldbody.add_frame().attach_body(spec.worldbody.first_body(), prefix, "")
    model = world.compile()
    with pytest.raises(RobotError, match=r"several robots.*choices: a/, b/"):
        MujocoBridge(biped, model)
    bridge, data = quiet_bridge(biped, model, prefix="b/"), mujoco.MjData(model)
    bridge.apply(torque(np.ones(biped.nj)), data)
    assert set(data.ctrl[: biped.nj]) == {0.0}
    assert set(data.ctrl[biped.nj :]) == {1.0}


EQ, OBJ = mujoco.mjtEq, mujoco.mjtObj


def couple(spec, kind, what, one, other="", name="linkage"):
    """An equality; the anchor of one that has any is beside the origin."""
    equality = spec.add_equality(name=name, type=kind, objtype=what, name1=one, name2=other)
    if kind == EQ.mjEQ_CONNECT:
        equality.data[0] = 0.1
    if kind in (EQ.mjEQ_JOINT, EQ.mjEQ_TENDON):
        equality.data[:5] = (0.0, 1.0, 0.0, 0.0, 0.0)


def couple_sites(spec):
    for link in ("left_foot", "right_foot"):
        spec.body(link).add_site(name=f"{link}_site")
    couple(spec, EQ.mjEQ_WELD, OBJ.mjOBJ_SITE, "left_foot_site", "right_foot_site")


def couple_tendons(spec):
    cable = spec.add_tendon(name="cable")
    cable.wrap_joint("left_knee", 1.0)
    couple(spec, EQ.mjEQ_TENDON, OBJ.mjOBJ_TENDON, "cable")


def couple_by_cloth(spec):
    cloth = spec.add_flex(name="cloth", dim=2, elem=[0, 1, 2])
    cloth.vertbody = ["left_foot", "right_foot", "chest"]
    couple(spec, EQ.mjEQ_FLEX, OBJ.mjOBJ_FLEX, "cloth")


COUPLINGS = {
    "(connect): left_foot, right_foot": lambda spec: couple(
        spec, EQ.mjEQ_CONNECT, OBJ.mjOBJ_BODY, "left_foot", "right_foot"
    ),
    "(weld): left_foot_site, right_foot_site": couple_sites,
    "(joint): left_knee, right_knee": lambda spec: couple(
        spec, EQ.mjEQ_JOINT, OBJ.mjOBJ_JOINT, "left_knee", "right_knee"
    ),
    "(joint): left_knee, left_hip_pitch": lambda spec: couple(
        spec, EQ.mjEQ_JOINT, OBJ.mjOBJ_UNKNOWN, "left_knee", "left_hip_pitch"
    ),
    "(tendon): cable": couple_tendons,
    "(flex): cloth": couple_by_cloth,
}


@pytest.mark.parametrize("text", COUPLINGS)
def test_an_equality_on_the_robot_is_refused_unless_accepted_or_inactive(biped, text):
    model = edit(COUPLINGS[text])(biped)
    named = rf"act on robot.*linkage {re.escape(text)}.*accept_equalities"
    with pytest.raises(RobotError, match=named):
        MujocoBridge(biped, model)
    bridge = quiet_bridge(biped, model, accept_equalities=["linkage"])
    assert f"an equality that was accepted: linkage {text}" in bridge.differences
    model.eq_active0[:] = 0
    assert not any("equality" in line for line in quiet_bridge(biped, model).differences)


def test_each_equality_on_the_robot_is_named(biped):
    def change(spec):
        couple(spec, EQ.mjEQ_JOINT, OBJ.mjOBJ_JOINT, "left_knee", "right_knee")
        couple(spec, EQ.mjEQ_CONNECT, OBJ.mjOBJ_BODY, "left_foot", "right_foot", name="")

    model = edit(change)(biped)
    with pytest.raises(RobotError, match=r"linkage \(joint\).*equality 1 \(connect\)"):
        MujocoBridge(biped, model)
    with pytest.raises(RobotError, match=r"got \['linkage \(joint\): left_knee, right_knee'\];"):
        MujocoBridge(biped, model, accept_equalities=["equality 1"])
    with pytest.raises(UnknownNameError, match="'linkege'; choices: linkage, equality 1"):
        MujocoBridge(biped, model, accept_equalities=["linkege"])


def add_fingers(spec):
    """Two fingers that the robot lacks, on each foot one, and an object beside it."""
    for link in ("left_foot", "right_foot"):
        for k in range(2):
            finger = spec.body(link).add_body(name=f"{link}_finger{k}")
            finger.add_joint(name=f"{link}_finger{k}", axis=(0, 0, 1))
            finger.add_geom(size=(0.01, 0.01, 0.01), mass=1e-4, contype=0, conaffinity=0)
    ball = spec.worldbody.add_body(name="ball", pos=(2.0, 0.0, 1.0))
    ball.add_freejoint()
    ball.add_geom(size=(0.1, 0.1, 0.1))


HARMLESS = {
    "a loop within what one link carries": (
        EQ.mjEQ_CONNECT, OBJ.mjOBJ_BODY, "left_foot_finger0", "left_foot_finger1",
    ),
    "other things": (EQ.mjEQ_WELD, OBJ.mjOBJ_BODY, "ball", "world"),
}  # fmt: skip


@pytest.mark.parametrize("case", HARMLESS)
def test_an_equality_that_moves_no_joint_of_the_robot_is_left_alone(biped, case):
    def change(spec):
        add_fingers(spec)
        couple(spec, *HARMLESS[case])

    model = edit(change)(biped)
    bridge = quiet_bridge(biped, model)
    assert not any("equality" in line for line in bridge.differences)
    # MuJoCo's own constraint Jacobian has no entry in the robot's coordinates.
    data = mujoco.MjData(model)
    bridge.place(data, *random_state(biped, np.random.default_rng(0)))
    jacobian = data.efc_J.reshape(data.nefc, model.nv)
    rows = jacobian[data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY]
    assert np.abs(rows).max() > 0.05
    np.testing.assert_allclose(rows[:, bridge.map.dof_order], 0.0, atol=1e-12)


def shift_foot_frame(spec):
    """Another origin of the foot's body; its joint, its mass and what it stands on stay."""
    foot, shift = spec.body("left_foot"), np.array([0.0, 0.0, 0.02])
    foot.pos, foot.ipos = foot.pos + shift, foot.ipos - shift
    for part in (*foot.joints, *foot.geoms):
        part.pos = part.pos - shift


def move_mass(spec):
    """From one shank to the other, whose centres of mass and heights are the same."""
    for side, mass in (("left", 2.9), ("right", 3.1)):
        spec.body(f"{side}_shank").mass = mass


def add_spring(spec):
    cable = spec.add_tendon(name="cable")
    cable.wrap_joint("left_knee", 1.0)
    cable.stiffness = (50.0, 0.0, 0.0)


DIFFERENCES = {
    "frames of 1 links, most left_foot: 20 mm": shift_foot_frame,
    "mass: 47 kg in the model, 47 kg to the controller; most what left_knee": move_mass,
    "tendons that resist or limit its joints: cable": add_spring,
    "centre of mass at home": lambda spec: setattr(spec.body("chest"), "ipos", (0.1, 0, 0.25)),
    "armature of 1 joints, most waist": lambda spec: setattr(spec.joint("waist"), "armature", 0.5),
    "joint damping of 1 joints": lambda spec: setattr(spec.joint("waist"), "damping", (0.5, 0, 0)),
    "upper position limits of 1 joints, most waist": lambda spec: setattr(
        spec.joint("waist"), "range", (-2.5, 1.0)
    ),
    "gravity: ": lambda spec: setattr(spec.option, "gravity", (0, 0, -1.6)),
    "time step: 10 ms": lambda spec: setattr(spec.option, "timestep", 0.01),
}


@pytest.mark.parametrize("sentence", DIFFERENCES)
def test_what_the_controller_does_not_know_is_said(biped, sentence):
    with pytest.warns(UserWarning, match="the controller does not know") as told:
        bridge = MujocoBridge(biped, edit(DIFFERENCES[sentence])(biped))
    assert len(told) == 1
    assert [line for line in bridge.differences if line.startswith(sentence)] == list(
        bridge.differences
    )


@pytest.mark.parametrize(
    ("version", "solver", "jacobian", "lines"),
    [
        ("4.0.0", mujoco.mjtSolver.mjSOL_NEWTON, mujoco.mjtJacobian.mjJAC_SPARSE, 1),
        ("4.0.0", mujoco.mjtSolver.mjSOL_NEWTON, mujoco.mjtJacobian.mjJAC_AUTO, 0),
        ("4.0.1", mujoco.mjtSolver.mjSOL_NEWTON, mujoco.mjtJacobian.mjJAC_SPARSE, 0),
    ],
)
def test_a_sparse_constraint_jacobian_is_said_where_mujoco_goes_wrong_with_it(
    biped, monkeypatch, version, solver, jacobian, lines
):
    monkeypatch.setattr(mujoco, "__version__", version)
    model = edit(lambda spec: None)(biped)
    model.opt.solver = solver
    model.opt.jacobian = jacobian
    bridge = quiet_bridge(biped, model)
    assert len(bridge.differences) == lines
    assert all(line.startswith("constraint Jacobian: sparse") for line in bridge.differences)
    # The model is the user's: nothing in it is changed.
    assert model.opt.jacobian == jacobian


@pytest.mark.parametrize("kind", ["motors", "servos"])
def test_a_robot_is_placed_loaded_and_at_rest(biped, kind):
    model = add_floor(ACTUATORS[kind](user_spec(biped), biped)).compile()
    bridge, data = quiet_bridge(biped, model), mujoco.MjData(model)
    bridge.place(data)
    state = bridge.state(data)
    up = sum(wrench[2] for wrench in state.contacts.values())
    assert up == pytest.approx(biped.weight, rel=1e-3)
    assert np.abs(data.qacc).max() < 1e-2
    assert np.abs(state.q - biped.q_home).max() < 1e-3


def test_soft_servos_that_are_told_velocities_do_not_sag_first(biped):
    model = add_floor(add_servos(user_spec(biped), biped, kp=800.0, kv=20.0)).compile()
    bridge, data = quiet_bridge(biped, model), mujoco.MjData(model)
    bridge.place(data)
    start = bridge.state(data).q
    while data.time < 0.2:
        bridge.apply(velocity(np.zeros(biped.nj)), data)
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(bridge.state(data).q, start, rtol=0, atol=1e-4)


def squat(robot, model, seconds=1.0):
    """Down and up by 6 cm in a second, in a plain loop; returns the largest errors of CoM [m]."""
    bridge, data = quiet_bridge(robot, model), mujoco.MjData(model)
    bridge.place(data)
    controller = poise.WholeBodyController(robot)
    com = controller.stack.task("com")
    start, error = controller.dynamics.com.copy(), 0.0
    while data.time < seconds:
        w = 2.0 * np.pi / seconds
        c, s = np.cos(w * data.time), np.sin(w * data.time)
        com.set_target(
            start - [0.0, 0.0, 0.03 * (1.0 - c)],
            velocity=[0.0, 0.0, -0.03 * w * s],
            acceleration=[0.0, 0.0, -0.03 * w * w * c],
        )
        command = controller.step(bridge.state(data))
        assert command.status.ok
        bridge.apply(command, data)
        mujoco.mj_step(model, data)
        error = max(error, float(np.linalg.norm(com.error)))
    assert bridge.rejected == 0
    return error


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("kind", ["motors", "motors in another order", "servos", "scene"])
@pytest.mark.parametrize("name", ["g1", "humanoid33"])
def test_robots_squat_in_a_plain_loop(get_robot, name, kind):
    robot = get_robot(name)
    if kind == "scene":
        model = scene(robot, wrapped=True).compile()
    else:
        model = add_floor(ACTUATORS[kind](user_spec(robot), robot)).compile()
    assert squat(robot, model) < 2e-3


def test_a_fixed_base_is_driven_and_has_to_stand_where_it_should(get_robot):
    robot = get_robot("arm6")
    model = build_model(robot, PlantConfig())
    bridge, data = MujocoBridge(robot, model), mujoco.MjData(model)
    bridge.place(data)
    given = bridge.apply(torque(np.arange(6.0)), data)
    np.testing.assert_array_equal(given, np.arange(6.0))
    np.testing.assert_array_equal(bridge.state(data).q, robot.q_home)
    world = mujoco.MjSpec()
    spec = parse_document(robot.source)
    world.option.jacobian = spec.option.jacobian
    world.worldbody.add_frame(pos=(0, 0, 1)).attach_body(spec.worldbody.first_body(), "a/", "")
    with pytest.raises(RobotError, match=r"fixed base.*stands elsewhere.*1\.0"):
        MujocoBridge(robot, world.compile())
