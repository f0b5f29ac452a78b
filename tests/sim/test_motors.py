"""Motors with drives of their own, against plain loops at 10 kHz and geometry."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from small_biped import torque

from poise.errors import ConfigurationError, UnknownNameError
from poise.hardware import MotorCommand
from poise.robots import load_robot
from poise.sim import Linkage, Motor, MotorConfig, Plant, PlantConfig

G, PERIOD = 9.81, 1e-4
INERTIA, ARMATURE, MASS, LENGTH = 0.02, 0.01, 2.0, 0.3
SWING = INERTIA + ARMATURE + MASS * LENGTH**2
"""Moment of inertia of the pendulum about its joint [kg m^2]."""

_LINK = (
    '<link name="{0}"><inertial><origin xyz="0 0 {1}"/><mass value="2"/><inertia ixx="0.02" '
    'iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="{0}_joint" '
    'type="revolute"><parent link="base"/><child link="{0}"/><axis xyz="{2}"/>'
    '<limit lower="-50" upper="50" velocity="20" effort="50"/></joint>'
)
JOINTS = "a_joint", "b_joint", "pendulum_joint"


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    """Two wheels, which nothing else turns, and a pendulum."""
    links = (("a", 0, "0 0 1"), ("b", 0, "0 0 1"), ("pendulum", -LENGTH, "0 1 0"))
    text = "".join(_LINK.format(*link) for link in links)
    path = tmp_path_factory.mktemp("wheels") / "wheels.urdf"
    path.write_text(f'<robot name="wheels"><link name="base"/>{text}</robot>', encoding="utf-8")
    facts = {"base": "fixed", "pelvis": "base", "torso": "base", "armature": ARMATURE}
    found = load_robot(path, description=facts)
    assert found.joint_names == JOINTS
    return found


def make_plant(robot, *, seed=0, control_dt=1e-3, linkages=(), torque_bandwidth=None, **fields):
    ways = {k: fields.pop(k) for k in ("latency", "jitter", "velocity_bandwidth") if k in fields}
    motors = MotorConfig(motors=(Motor(joints=".*", **fields),), linkages=linkages, **ways)
    config = PlantConfig(control_dt=control_dt, motors=motors, torque_bandwidth=torque_bandwidth)
    return Plant(robot, config, seed=seed)


def set_points(robot, **fields):
    zero = np.zeros(robot.nj)
    return MotorCommand(**{k: zero + fields.get(k, 0.0) for k in ("q", "dq", "kp", "kd", "tau")})


@dataclass
class Loop:
    """A drive and its joint, one plain step after another."""

    inertia: float
    weight: float = 0.0  # m g l [N m]
    limit: float = np.inf
    friction: float = 0.0
    damping: float = 0.0
    ripple: float = 0.0
    wave: float = 0.0
    bandwidth: float = np.inf  # of velocities [Hz]
    count: float = 0.0  # of the encoder [rad]

    def run(self, seconds, angle, speed, q, kp, kd, tau):
        """Angles, every millisecond."""
        seen, measured, found = self.read(angle), speed, []
        keep = np.exp(-2.0 * np.pi * self.bandwidth * PERIOD)
        for k in range(round(seconds / PERIOD)):
            asked = min(max(tau + kp * (q - seen) - kd * measured, -self.limit), self.limit)
            push = asked + self.ripple * np.sin(self.wave * angle) - self.damping * speed
            push -= self.weight * np.sin(angle)
            free = speed + PERIOD * push / self.inertia
            slowed = max(abs(free) - PERIOD * self.friction / self.inertia, 0.0)
            speed = np.copysign(slowed, free)
            angle += PERIOD * speed
            last, seen = seen, self.read(angle)
            measured = keep * measured + (1.0 - keep) * (seen - last) / PERIOD
            if k % 10 == 9:
                found.append(angle)
        return np.array(found)

    def read(self, angle):
        return self.count * np.round(angle / self.count) if self.count else angle


def follow(plant, command, seconds, joint):
    found = []
    while plant.time < seconds - 1e-9:
        plant.drive(command)
        found.append(plant.true_state().q[joint])
    return np.array(found)


CASES = {
    "springs": ({}, {"kp": 20.0, "kd": 0.1, "q": 0.5}),
    "limits": ({"limit": 2.0}, {"kp": 200.0, "kd": 1.0, "q": 1.0}),
    "frictions": ({"friction": 0.5, "damping": 0.1}, {"kp": 20.0, "q": 0.5}),
    "ripple": ({"ripple": 0.3, "gear": 10.0, "cycles": 6.0}, {"kp": 5.0, "kd": 0.1, "q": 1.0}),
    "filter": ({"velocity_bandwidth": 50.0}, {"kp": 50.0, "kd": 1.0, "q": 0.5}),
}


@pytest.mark.parametrize("joint", [0, 2])
@pytest.mark.parametrize("case", CASES)
def test_a_joint_moves_as_in_a_plain_loop(robot, case, joint):
    fields, command = CASES[case]
    plant = make_plant(robot, **fields)
    names = "limit", "friction", "damping", "ripple"
    loop = Loop(
        SWING if joint == 2 else INERTIA + ARMATURE,
        weight=MASS * G * LENGTH if joint == 2 else 0.0,
        wave=fields.get("gear", 1.0) * fields.get("cycles", 0.0),
        bandwidth=fields.get("velocity_bandwidth", np.inf),
        **{name: fields[name] for name in names if name in fields},
    )
    found = follow(plant, set_points(robot, **command), 0.4, joint)
    wanted = loop.run(0.4, 0.0, 0.0, **{"q": 0.0, "kp": 0.0, "kd": 0.0, "tau": 0.0} | command)
    # The physics' own steps are ten times as long: it holds speeds and the weight for 1 ms.
    assert np.abs(found - wanted).max() < 0.03 * np.ptp(wanted)


def test_damping_acts_within_a_physics_step(robot):
    """Three times what stops the wheel in one step of ideal drives at 1 kHz, which reverse it."""
    kd, start = 3.0 * (INERTIA + ARMATURE) / 1e-3, np.array([1.0, -0.5, 0.0])
    plant, ideal = make_plant(robot, limit=200.0), Plant(robot, PlantConfig())
    for each in (plant, ideal):
        each.reset(v=start)
        each.drive(set_points(robot, kd=kd))
    np.testing.assert_allclose(plant.true_state().v[:2], 0.7**10 * start[:2], rtol=1e-9)
    assert ideal.true_state().v[0] < -0.5


@pytest.mark.parametrize("latency", [0.0, 0.3e-3, 1e-3, 2.7e-3])
def test_a_command_arrives_exactly_late(robot, latency):
    plant = make_plant(robot, latency=latency)
    given = []
    for _ in range(5):
        plant.step(torque(np.full(3, 2.0)))
        given.append(plant.applied_torque[0])
    # Means of steps of 1 ms from a torque that begins at the latency.
    wanted = 2.0 * np.clip(1e3 * ((1 + np.arange(5)) * 1e-3 - latency), 0.0, 1.0)
    np.testing.assert_allclose(given, wanted, atol=1e-9)


def test_jitter_is_drawn_by_the_seed_and_a_command_that_is_overtaken_is_lost(robot):
    runs = []
    for seed in (1, 1, 2):
        plant = make_plant(robot, seed=seed, latency=0.5e-3, jitter=3e-3)
        given = []
        for k in range(60):
            plant.step(torque(np.full(3, 0.01 * k)))
            given.append(plant.applied_torque[0])
        runs.append(given)
    assert runs[0] == runs[1] != runs[2]
    given, sent = np.array(runs[0]), 0.01 * np.arange(60)
    assert (np.diff(given) >= -1e-12).all()
    late = (sent - given)[5:] / 0.01  # in steps of 1 ms
    assert late.min() > -0.51
    assert late.max() < 3.5
    assert np.ptp(late) > 0.5


def test_encoders_count_turns_of_the_rotor(robot):
    resolution, gear = 2.0 * np.pi / 2**10, 12.0
    plant = make_plant(robot, resolution=resolution, gear=gear)
    plant.reset(np.array([0.3, -0.2, 0.0]), np.array([1.0, -2.0, 0.0]))
    step, errors = resolution / gear, []
    for _ in range(100):
        plant.drive(set_points(robot))
        measured, true = plant.state(), plant.true_state()
        np.testing.assert_allclose(measured.q / step, np.round(measured.q / step), atol=1e-6)
        # A difference of counts in 0.1 ms.
        counts = measured.v * PERIOD / step
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
        errors.append(measured.q[:2] - true.q[:2])
    assert 0.3 * step < np.abs(errors).max() <= 0.5 * step + 1e-9


def test_the_filter_of_velocities_averages_counts(robot):
    fields = {"resolution": 2.0 * np.pi / 2**10, "gear": 12.0}
    plant = make_plant(robot, velocity_bandwidth=20.0, **fields)
    plant.reset(v=np.array([1.0, -2.0, 0.0]))
    speeds = []
    for _ in range(200):
        plant.drive(set_points(robot))
        speeds.append(plant.state().v[:2])
    # Counts of 0.5 mrad in 0.1 ms, of which the filter lets 1.2% through.
    assert 1e-3 < np.std(speeds, axis=0).max() < 0.0125 * 5.2
    np.testing.assert_allclose(np.mean(speeds, axis=0), [1.0, -2.0], atol=0.01)


def test_the_limits_of_a_linkage_are_a_rotated_box(robot):
    """Each motor has 10 N m: the torques of the joints are within |a| + |b| <= 20."""
    linkage = Linkage(joints=("a_joint", "b_joint"), rates=((1.0, 1.0), (1.0, -1.0)))
    plant = make_plant(robot, limit=10.0, linkages=(linkage,))
    for asked, given in (
        ((15.0, 0.0), (15.0, 0.0)),
        ((0.0, -19.0), (0.0, -19.0)),
        ((30.0, 0.0), (20.0, 0.0)),
        ((15.0, 15.0), (10.0, 10.0)),
        ((-12.0, 4.0), (-12.0, 4.0)),
    ):
        plant.reset()
        plant.step(torque(np.array([*asked, 0.0])))
        np.testing.assert_allclose(plant.applied_torque[:2], given, atol=1e-9)
        assert plant.saturated.any() == (asked != given)


def test_a_linkage_measures_and_holds_its_joints(robot):
    """Unequal rates: set-points and measurements are of joints, friction is of motors."""
    linkage = Linkage(joints=("a_joint", "b_joint"), rates=((1.0, 0.5), (0.8, -0.6)))
    plant = make_plant(robot, linkages=(linkage,), friction=0.01, velocity_bandwidth=400.0)
    target = np.array([0.3, -0.2, 0.1])
    for _ in range(500):
        plant.drive(set_points(robot, q=target, kp=30.0, kd=1.0))
    np.testing.assert_allclose(plant.state().q, plant.true_state().q, atol=1e-5)
    # Friction t of the motors holds R^T t: at most 0.01 x 1.8 N m of 30 N m/rad.
    np.testing.assert_allclose(plant.true_state().q[:2], target[:2], atol=0.018 / 30.0)
    assert np.abs(plant.true_state().v[:2]).max() < 1e-6


def test_friction_holds_until_it_breaks_away(robot):
    plant = make_plant(robot, friction=0.5)
    for _ in range(100):
        plant.step(torque(np.array([0.49, -0.49, 0.0])))
    np.testing.assert_array_equal(np.abs(plant.true_state().v[:2]) < 1e-12, True)
    for _ in range(100):
        plant.step(torque(np.array([0.8, -0.8, 0.0])))
    moved = 0.3 / (INERTIA + ARMATURE) * 0.1
    np.testing.assert_allclose(plant.true_state().v[:2], [moved, -moved], rtol=1e-9)


def test_friction_holds_a_standing_robot(biped):
    """Joints in a chain that the ground closes, each with more than the load."""
    plant = make_plant(biped, friction=150.0, control_dt=2e-3)
    plant.reset()
    for _ in range(250):
        plant.step(torque(np.zeros(biped.nj)))
    assert not plant.fallen
    assert np.abs(plant.true_state().v).max() < 1e-3
    assert np.abs(plant.true_state().q - plant.reset().q).max() < 5e-3


def test_the_ripple_goes_with_the_angle_of_the_rotor(robot):
    plant = make_plant(robot, ripple=0.4, cycles=6.0, gear=5.0, friction=50.0)
    for angle in np.linspace(0.0, 0.2, 9):
        plant.reset(np.array([angle, 0.0, 0.0]))
        plant.step(torque(np.array([1.0, 0.0, 0.0])))
        # Friction holds the wheel, and is all but ripple and current.
        held = plant._motors._state.impulse[0] / PERIOD
        assert held == pytest.approx(-1.0 - 0.4 * np.sin(30.0 * angle), abs=1e-9)
        assert abs(plant.applied_torque[0]) < 1e-9


def test_the_torque_follows_with_the_bandwidth(robot):
    plant = make_plant(robot, torque_bandwidth=20.0)
    plant.step(torque(np.array([1.0, 0.0, 0.0])))
    times = PERIOD * np.arange(1, 11)
    wanted = np.mean(1.0 - np.exp(-2.0 * np.pi * 20.0 * times))
    assert plant.applied_torque[0] == pytest.approx(wanted, rel=1e-9)


def test_torques_alone_are_set_points_without_gains(robot):
    plants = [make_plant(robot, friction=0.1, ripple=0.2, latency=0.4e-3) for _ in range(2)]
    for k in range(50):
        asked = np.array([0.5, np.sin(0.1 * k), -1.0])
        plants[0].step(torque(asked))
        plants[1].drive(set_points(robot, tau=asked))
    first, second = (plant.true_state() for plant in plants)
    assert first.q.tolist() == second.q.tolist()


def test_ideal_drives_act_once_a_period_on_the_true_state(robot):
    plant, twin = (Plant(robot, PlantConfig(control_dt=2e-3)) for _ in range(2))
    command = set_points(robot, q=0.3, dq=0.1, kp=20.0, kd=0.5, tau=1.0)
    for _ in range(50):
        now = twin.true_state()
        asked = 1.0 + 20.0 * (0.3 - now.q) + 0.5 * (0.1 - now.v)
        twin.step(torque(np.clip(asked, -robot.tau_max, robot.tau_max)))
        plant.drive(command)
    assert plant.true_state().q.tolist() == twin.true_state().q.tolist()


def test_readings_are_of_currents_and_the_applied_torque_has_the_rest(biped):
    plant = make_plant(biped, friction=0.3, ripple=0.2)
    asked = 0.05 * biped.tau_max
    for _ in range(5):
        plant.step(torque(asked))
    np.testing.assert_allclose(plant.state().readings.torque, asked, rtol=1e-12)
    off = np.abs(plant.applied_torque - asked)
    assert 0.1 < off.max() <= 0.5 + 1e-9
    np.testing.assert_array_equal(plant.true_state().readings.torque, plant.applied_torque)


def test_set_points_that_are_no_numbers_are_refused(robot):
    plant = make_plant(robot)
    plant.drive(set_points(robot, tau=1.0))
    plant.drive(set_points(robot, tau=np.nan))
    assert plant.rejected_commands == 1
    np.testing.assert_array_equal(plant.applied_torque, 0.0)


WHEELS = Motor(joints=".*")
LINKAGE = Linkage(joints=("a_joint", "b_joint"), rates=((1.0, 1.0), (1.0, -1.0)))


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Motor(joints="("), "regular expression"),
        (lambda: Motor(joints=".*", friction=-1.0), "friction"),
        (lambda: replace(LINKAGE, rates=((1.0, 1.0), (1.0, 1.0))), "independently"),
        (lambda: MotorConfig(motors=(WHEELS,), latency=-1.0), "latency"),
        (
            lambda: PlantConfig(motors=MotorConfig(motors=(WHEELS,)), actuation="velocity"),
            "motors does not go with velocity",
        ),
        (
            lambda: PlantConfig(motors=MotorConfig(motors=(WHEELS,)), physics_dt=2.5e-4),
            "multiple of the period of the drives",
        ),
    ],
)
def test_values_that_cannot_be_are_refused(make, says):
    with pytest.raises(ConfigurationError, match=says):
        make()


def test_motors_and_linkages_that_do_not_fit_a_robot_are_refused(robot):
    for config, says in (
        (MotorConfig(motors=(Motor(joints="a_.*"),)), "no motor drives.*b_joint"),
        (
            MotorConfig(motors=(WHEELS,), linkages=(replace(LINKAGE, joints=("a_joint", "c")),)),
            "linkage.*'c'.*a_joint",
        ),
    ):
        with pytest.raises(UnknownNameError, match=says):
            Plant(robot, PlantConfig(motors=config))
    with pytest.raises(ConfigurationError, match="two linkages"):
        Plant(robot, PlantConfig(motors=MotorConfig(motors=(WHEELS,), linkages=(LINKAGE,) * 2)))


def test_the_motors_of_g1_stand_by_their_own_damping(get_robot):
    robot = get_robot("g1")
    plant = Plant(robot, PlantConfig(control_dt=2e-3, motors=MotorConfig.g1()))
    held = set_points(robot, q=robot.q_home[-robot.nj :], kp=100.0, kd=2.0)
    for _ in range(100):
        plant.drive(held)
    assert not plant.fallen
    assert np.abs(plant.true_state().v).max() < 0.5
