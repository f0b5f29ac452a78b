import dataclasses
import subprocess
import sys
import warnings

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from small_biped import MASS, SOLE_LENGTH, SOLE_WIDTH, document, small_biped, torque, velocity

from poise.sim import Block, Plant, PlantConfig, SensorConfig

G = 9.81


def airborne(robot):
    q = robot.q_home.copy()
    q[2] += 3.0
    return q


def standing(robot, seconds=1.0, **config):
    plant = Plant(robot, PlantConfig(actuation="position", **config))
    while plant.time < seconds:
        plant.step(None)
    return plant


def momentum(plant):
    """Linear momentum in the world [N s], by Pinocchio from the plant's state."""
    robot, state = plant.robot, plant.true_state()
    data = robot.model.createData()
    return pin.computeCentroidalMomentum(robot.model, data, state.q, state.v).linear.copy()


def energy(plant):
    mujoco.mj_energyPos(plant.model, plant.data)
    mujoco.mj_energyVel(plant.model, plant.data)
    return float(plant.data.energy.sum())


def test_the_constraint_jacobian_of_many_joints_is_dense(get_robot):
    """MuJoCo's own choice is a sparse one from 60 degrees of freedom on."""
    model = Plant(get_robot("humanoid60")).model
    assert model.nv >= 60
    assert not mujoco.mj_isSparse(model)


def test_flight_without_torque_keeps_momentum_and_nearly_energy(biped):
    plant = Plant(biped, PlantConfig(physics_dt=1e-4, contact_time_constant=5e-3))
    rng = np.random.default_rng(3)
    plant.reset(airborne(biped), rng.uniform(-0.5, 0.5, biped.nv))
    p0, e0 = momentum(plant), energy(plant)
    while plant.time < 0.3:
        plant.step(torque(np.zeros(biped.nj)))
    mujoco.mj_forward(plant.model, plant.data)
    np.testing.assert_allclose(
        momentum(plant) - p0, [0.0, 0.0, -MASS * G * 0.3], rtol=0, atol=2e-3 * MASS * G * 0.3
    )
    scale = MASS * G * 0.45
    assert abs(energy(plant) - e0) < 2e-3 * scale


def test_a_stiff_servo_stands_for_a_second(biped):
    plant = standing(biped)
    assert not plant.fallen
    assert not plant.diverged
    assert plant.contacts() == {"left_sole": True, "right_sole": True}
    assert np.abs(plant.state().v).max() < 0.02
    total = sum(w[2] for w in plant.sole_wrenches().values())
    assert total == pytest.approx(MASS * G, rel=0.01)


def test_contact_points_are_the_corners_of_the_sole_on_the_ground(biped):
    plant = standing(biped)
    points = np.array([c.pos for c in plant.data.contact])
    assert len(points) == 8
    for name in biped.soles:
        center = plant.data.site(name).xpos
        world_R_sole = plant.data.site(name).xmat.reshape(3, 3)
        near = points[np.linalg.norm(points - center, axis=1) < 0.15]
        corners = (near - center) @ world_R_sole
        np.testing.assert_allclose(np.abs(corners[:, 0]), SOLE_LENGTH / 2, rtol=0, atol=1e-3)
        np.testing.assert_allclose(np.abs(corners[:, 1]), SOLE_WIDTH / 2, rtol=0, atol=1e-3)
        np.testing.assert_allclose(corners[:, 2], 0.0, rtol=0, atol=2e-4)
    np.testing.assert_allclose(points[:, 2], 0.0, rtol=0, atol=2e-4)


def test_zmp_of_known_contact_forces_is_their_centre(biped):
    plant = standing(biped)
    force, moment = np.zeros(3), np.zeros(3)
    for i, contact in enumerate(plant.data.contact):
        local = np.zeros(6)
        mujoco.mj_contactForce(plant.model, plant.data, i, local)
        # The force is on the second body of the pair; the ground may be either.
        sign = 1.0 if plant.model.geom_bodyid[contact.geom[1]] != 0 else -1.0
        f = sign * contact.frame.reshape(3, 3).T @ local[:3]
        force += f
        moment += np.cross(contact.pos, f)
    expected = np.array([-moment[1], moment[0]]) / force[2]
    np.testing.assert_allclose(plant.zmp(), expected, rtol=0, atol=1e-9)


def test_sole_wrenches_are_the_sum_of_contact_forces_in_the_soles_frame(biped):
    plant = Plant(biped, PlantConfig(actuation="position", floor_slope=(0.05, 0.1)))
    while plant.time < 0.4:
        plant.step(None)
    for name in biped.soles:
        body = plant.model.body(biped.roles[name].link).id
        site = plant.data.site(name)
        wrench = np.zeros(6)
        for i, contact in enumerate(plant.data.contact):
            if body not in plant.model.geom_bodyid[contact.geom]:
                continue
            local = np.zeros(6)
            mujoco.mj_contactForce(plant.model, plant.data, i, local)
            sign = 1.0 if plant.model.geom_bodyid[contact.geom[1]] == body else -1.0
            f = sign * contact.frame.reshape(3, 3).T @ local[:3]
            wrench += np.r_[f, np.cross(contact.pos - site.xpos, f)]
        world_R_sole = site.xmat.reshape(3, 3)
        expected = np.r_[world_R_sole.T @ wrench[:3], world_R_sole.T @ wrench[3:]]
        np.testing.assert_allclose(plant.sole_wrenches()[name], expected, rtol=0, atol=1e-8)
        np.testing.assert_array_equal(plant.state().contacts[name], plant.sole_wrenches()[name])


@pytest.mark.parametrize("duration", [0.1, 0.0503])
@pytest.mark.parametrize("body", ["chest", "torso"])
def test_a_push_changes_momentum_by_force_times_duration(biped, body, duration):
    force = (40.0, -25.0, 10.0)
    plant = Plant(biped)
    plant.reset(airborne(biped))
    plant.push(body, force, duration, start=0.02)
    while plant.time < 0.2:
        plant.step(None)
    gained = momentum(plant) + np.array([0.0, 0.0, MASS * G * plant.time])
    np.testing.assert_allclose(gained, np.array(force) * duration, rtol=2e-3, atol=0.02)


def test_a_push_on_a_link_acts_at_its_centre_of_mass_and_on_a_frame_at_its_origin(biped):
    for body, point in (("chest", "com"), ("left_hand", "frame")):
        plant = Plant(biped)
        plant.reset(airborne(biped))
        plant.push(body, (30.0, 0.0, 0.0), 1.0)
        plant.step(None)
        link = plant.model.body("chest" if point == "com" else "tip").id
        where = plant.data.xipos[link] if point == "com" else plant.data.site(body).xpos
        expected = np.zeros(plant.model.nv)
        mujoco.mj_applyFT(
            plant.model, plant.data, np.array([30.0, 0, 0]), np.zeros(3), where, link, expected
        )
        np.testing.assert_allclose(plant.data.qfrc_applied, expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("tick", [14, 15])
def test_a_push_that_was_scheduled_moves_the_robot_as_one_that_is_given_in_time(biped, tick):
    # At all of these but the first, 5 physics steps from the tick before end a rounding later.
    config = PlantConfig(actuation="position", control_dt=0.005, physics_dt=0.001)
    ends = []
    for scheduled in (False, True):
        plant = Plant(biped, config)
        plant.reset(airborne(biped))
        if scheduled:
            plant.push("torso", (80.0, 0.0, 0.0), 0.1, start=tick * config.control_dt)
        for _ in range(tick):
            plant.step(None)
        if not scheduled:
            plant.push("torso", (80.0, 0.0, 0.0), 0.1)
        for _ in range(30):
            plant.step(None)
        ends.append(plant.true_state().q)
    np.testing.assert_array_equal(*ends)


def test_reset_forgets_pushes_and_starts_again_exactly(biped):
    plant = Plant(biped, PlantConfig(actuation="position"))
    first = [plant.reset().q]
    for _ in range(50):
        plant.step(None)
        first.append(plant.state().q)
    plant.push("torso", (500.0, 0.0, 0.0), 0.2)
    for _ in range(50):
        plant.step(None)
    again = [plant.reset().q]
    for _ in range(50):
        plant.step(None)
        again.append(plant.state().q)
    assert plant.time == pytest.approx(0.05)
    np.testing.assert_array_equal(first, again)


def test_torque_saturates_at_the_robots_limit(biped):
    plant = Plant(biped)
    plant.reset(airborne(biped))
    wanted = np.zeros(biped.nj)
    wanted[[0, 3]] = 1e4, -1e4
    wanted[5] = 10.0
    plant.step(torque(wanted))
    np.testing.assert_array_equal(
        plant.applied_torque, np.clip(wanted, -biped.tau_max, biped.tau_max)
    )
    np.testing.assert_array_equal(np.flatnonzero(plant.saturated), [0, 3])


def test_velocity_actuation_follows_a_velocity(biped):
    plant = Plant(biped, PlantConfig(actuation="velocity"))
    plant.reset(airborne(biped))
    waist = biped.joint_index("waist")
    wanted = np.zeros(biped.nj)
    wanted[waist] = 0.5
    start = plant.state().q[7 + waist]
    while plant.time < 0.5:
        plant.step(velocity(wanted))
    assert plant.state().v[6 + waist] == pytest.approx(0.5, abs=0.03)
    assert plant.state().q[7 + waist] - start == pytest.approx(0.25, abs=0.02)


def test_position_actuation_goes_where_it_is_told(biped):
    plant = Plant(biped, PlantConfig(actuation="position"))
    plant.reset(airborne(biped))
    waist = biped.joint_index("waist")
    target = biped.q_home[7:].copy()
    target[waist] = 0.3
    plant.step(None, position=target)
    while plant.time < 0.6:
        plant.step(None)
    np.testing.assert_allclose(plant.state().q[7:], target, rtol=0, atol=0.02)


def test_servos_of_positions_pull_with_a_commanded_torque(biped):
    rng = np.random.default_rng(3)
    plant = Plant(biped, PlantConfig(actuation="position"))
    plant.reset(airborne(biped), 0.1 * rng.normal(size=biped.nv))
    wanted = 0.2 * biped.tau_max * rng.uniform(-1.0, 1.0, biped.nj)
    plant.step(torque(wanted))
    np.testing.assert_allclose(plant.applied_torque, wanted, rtol=0, atol=1e-9)
    plant.step(torque(np.full(biped.nj, np.nan)))
    assert plant.rejected_commands == 1
    assert np.isfinite(plant.applied_torque).all()


def test_a_payload_adds_its_mass_and_moves_the_centre_of_mass(biped):
    payload = PlantConfig.Payload(frame="left_hand", mass=2.5, offset=(0.0, 0.0, 0.1))
    bare, loaded = Plant(biped), Plant(biped, PlantConfig(payloads=(payload,)))
    # In the air: on the ground the heavier one sinks in deeper.
    for plant in (bare, loaded):
        plant.reset(airborne(biped))
    assert loaded.mass - bare.mass == pytest.approx(2.5, abs=1e-12)
    hand = bare.data.site("left_hand")
    where = hand.xpos + hand.xmat.reshape(3, 3) @ np.array([0.0, 0.0, 0.1])
    expected = (bare.com * bare.mass + 2.5 * where) / loaded.mass
    np.testing.assert_allclose(loaded.com, expected, rtol=0, atol=1e-12)


def test_model_error_changes_the_plant_and_not_the_robot(biped):
    before = [(i.mass, i.lever.copy(), i.inertia.copy()) for i in biped.model.inertias]
    plain = Plant(biped)
    config = PlantConfig(
        mass_scale=1.1,
        link_errors=(
            PlantConfig.LinkError(
                link="chest", mass_scale=1.2, inertia_scale=1.5, com_offset=(0.01, 0.0, -0.02)
            ),
        ),
    )
    plant = Plant(biped, config)
    chest = plant.model.body("chest").id
    np.testing.assert_allclose(
        plant.model.body_mass[chest], 1.1 * 1.2 * plain.model.body_mass[chest], rtol=1e-12
    )
    np.testing.assert_allclose(
        plant.model.body_inertia[chest],
        1.1 * 1.2 * 1.5 * plain.model.body_inertia[chest],
        rtol=1e-12,
    )
    np.testing.assert_allclose(
        plant.model.body_ipos[chest] - plain.model.body_ipos[chest], [0.01, 0, -0.02], atol=1e-12
    )
    assert plant.mass == pytest.approx(1.1 * (MASS + 0.2 * 15.0), abs=1e-9)
    for each in (plant, plain):
        each.reset(airborne(biped))
    shift = plant.data.xipos[chest] - plain.data.xipos[chest]
    np.testing.assert_allclose(shift, [0.01, 0.0, -0.02], rtol=0, atol=1e-9)
    for inertia, (mass, lever, matrix) in zip(biped.model.inertias, before, strict=True):
        assert inertia.mass == mass
        np.testing.assert_array_equal(inertia.lever, lever)
        np.testing.assert_array_equal(inertia.inertia, matrix)


def test_joint_damping_and_friction_take_energy_out(biped):
    speeds = []
    for config in (PlantConfig(), PlantConfig(joint_damping=2.0), PlantConfig(joint_friction=2.0)):
        plant = Plant(biped, config)
        v = np.zeros(biped.nv)
        v[6 + biped.joint_index("waist")] = 3.0
        plant.reset(airborne(biped), v)
        while plant.time < 0.1:
            plant.step(None)
        speeds.append(plant.state().v[6 + biped.joint_index("waist")])
    assert speeds[1] < 0.9 * speeds[0]
    assert speeds[2] < 0.9 * speeds[0]


def test_a_tilted_block_is_a_ramp_through_the_middle_of_its_top(biped):
    slope, yaw = 0.14, 0.6
    ramp = Block(
        center=(2.0, 1.0), size=(1.5, 1.0, 0.3), yaw=yaw, tilt=(0.0, -slope), top=0.1, told=False
    )
    plant = Plant(biped, PlantConfig(blocks=(ramp,)))
    for along, aside in ((-0.6, 0.3), (0.0, 0.0), (0.6, -0.3)):
        x = 2.0 + along * np.cos(yaw) - aside * np.sin(yaw)
        y = 1.0 + along * np.sin(yaw) + aside * np.cos(yaw)
        down, hit = np.array([0.0, 0.0, -1.0]), np.array([-1], dtype=np.int32)
        start = np.array([x, y, 2.0])
        depth = mujoco.mj_ray(plant.model, plant.data, start, down, None, 1, -1, hit)
        assert 2.0 - depth == pytest.approx(0.1 + along * np.tan(slope), abs=1e-9)


def test_a_run_that_blows_up_is_reported_and_goes_on_quietly(biped, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    plant = Plant(biped)
    plant.push("torso", (1e9, 0.0, 0.0), 0.1)
    while plant.time < 0.05:
        plant.step(torque(np.zeros(biped.nj)))
        plant.state()
    assert plant.diverged
    assert plant.fallen
    assert plant.warnings
    assert plant.time == pytest.approx(0.05)
    assert not list(tmp_path.iterdir())
    assert capfd.readouterr() == ("", "")
    plant.reset()
    plant.step(torque(np.zeros(biped.nj)))
    assert not plant.diverged


def test_the_imu_of_a_standing_robot_feels_gravity_upwards(biped):
    gyro, accelerometer = standing(biped).imu
    np.testing.assert_allclose(gyro, 0.0, atol=1e-5)
    assert np.linalg.norm(accelerometer) == pytest.approx(G, rel=1e-3)
    assert accelerometer[2] > 9.7


def test_the_state_is_the_same_when_asked_twice_and_nobody_can_change_the_plant_by_it(biped):
    plant = Plant(biped, PlantConfig(sensors=SensorConfig(gyro_noise=0.1)))
    plant.step(None)
    assert plant.state() is plant.state()
    before = plant.data.qpos.copy()
    plant.state().q[:] = 7.0
    plant.true_state().q[:] = 7.0
    np.testing.assert_array_equal(plant.data.qpos, before)


def test_the_torque_follows_its_command_with_the_bandwidth(biped):
    plant = Plant(biped, PlantConfig(torque_bandwidth=20.0))
    plant.reset(airborne(biped))
    # The first command is there at once; a later one by 1 - exp(-2 pi f t).
    plant.step(torque(np.zeros(biped.nj)))
    asked = 0.1 * biped.tau_max
    given = []
    for _ in range(10):
        plant.step(torque(asked))
        given.append(plant.applied_torque / asked)
    reached = 1.0 - np.exp(-2.0 * np.pi * 20.0 * 1e-3 * np.arange(1, 11))
    np.testing.assert_allclose(given, np.repeat(reached[:, None], biped.nj, axis=1), rtol=1e-9)


@pytest.mark.parametrize("actuation", ["torque", "position"])
def test_joints_without_rotor_inertia_are_named_once_under_torque_control(biped, actuation):
    model = biped.model.copy()
    model.armature[6:8] = 0.0
    light = dataclasses.replace(biped, model=model)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("default")
        for _ in range(2):
            Plant(light, PlantConfig(actuation=actuation))
    if actuation == "position":
        assert told == []
    else:
        (word,) = told
        assert f"no reflected rotor inertia ({', '.join(biped.joint_names[:2])})" in str(
            word.message
        )
        assert "`armature: 0.01`" in str(word.message)


def test_a_process_with_one_plant_needs_at_most_350_megabytes(get_robot):
    """The most memory that the process ever held (VmHWM), imports and compiling included."""
    get_robot("g1")
    code = (
        "import poise\n"
        "plant = poise.Plant(poise.load_robot('g1'))\n"
        "for _ in range(100):\n    plant.step(None)\n"
        "print(open('/proc/self/status').read())\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    peak = next(line for line in done.stdout.splitlines() if line.startswith("VmHWM:"))
    assert int(peak.split()[1]) * 1024 < 350e6


@pytest.mark.parametrize(("name", "self_contact"), [("g1", False), ("talos", True)])
def test_pictures_change_no_bit_of_a_fall(get_robot, name, self_contact):
    plant = Plant(get_robot(name), PlantConfig(self_contact=self_contact))
    shown = plant.drawn_model()
    assert shown.nmesh > plant.model.nmesh
    data, touched = mujoco.MjData(shown), 0
    data.qpos[:], data.qvel[:] = plant.data.qpos, plant.data.qvel
    data.qacc_warmstart[:] = plant.data.qacc_warmstart
    for _ in range(1000):
        plant.step(None)
        mujoco.mj_step(shown, data)
        touched = max(touched, data.ncon)
    np.testing.assert_array_equal(plant.data.qpos, data.qpos)
    np.testing.assert_array_equal(plant.data.qvel, data.qvel)
    assert touched > 8  # more than the corners of its soles


@pytest.mark.parametrize("count", [4, 200_001])
def test_a_binary_stl_whose_header_begins_as_text_is_drawn_whatever_its_size(tmp_path, count):
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    triangles = np.zeros(count, kind)
    triangles["corners"] = np.random.default_rng(0).normal(size=(count, 3, 3))
    path = tmp_path / "base.stl"
    content = b"solid base".ljust(80) + count.to_bytes(4, "little") + triangles.tobytes()
    path.write_bytes(content)
    box = '<visual><origin xyz="0 0 0"/><geometry><box size="0.2 0.3 0.15"/></geometry></visual>'
    mesh = f'<visual><geometry><mesh filename="{path}"/></geometry></visual>'
    text = document()
    assert box in text
    shown = Plant(small_biped(text.replace(box, mesh))).drawn_model()
    assert shown.nmeshface == count


def test_zmp_in_the_air_is_not_a_number(biped):
    plant = Plant(biped)
    plant.reset(airborne(biped))
    plant.step(None)
    assert np.isnan(plant.zmp()).all()
    assert plant.contacts() == {"left_sole": False, "right_sole": False}


def test_low_friction_lets_the_feet_slide(biped):
    moved = []
    for friction in (0.02, 1.0):
        plant = Plant(biped, PlantConfig(actuation="position", friction=friction))
        plant.push("pelvis", (40.0, 0.0, 0.0), 0.3, start=0.3)
        start = plant.data.site("left_sole").xpos.copy()
        while plant.time < 0.6:
            plant.step(None)
        moved.append(np.linalg.norm(plant.data.site("left_sole").xpos - start))
    assert moved[0] > 0.02
    assert moved[1] < 0.002


def test_a_command_with_nan_does_nothing_and_is_counted(biped):
    plant = Plant(biped)
    bad = np.zeros(biped.nj)
    bad[2] = np.nan
    plant.step(torque(bad))
    assert plant.rejected_commands == 1
    np.testing.assert_array_equal(plant.applied_torque, 0.0)
    assert not plant.diverged
