"""The estimator on a simulated walk: its errors against the truth, faults of sensors, the loop."""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

pytest.importorskip("mujoco")

from odd import odd
from unchecked import run_unchecked

from poise.control import WholeBodyController
from poise.dynamics import RobotState, SensorReadings
from poise.errors import ConfigurationError, UnknownNameError
from poise.estimation import (
    ContactBelief,
    EstimatorConfig,
    EstimatorStatus,
    MomentumObserver,
    PayloadEstimator,
    StateEstimator,
)
from poise.locomotion import Gait, Stride, Walker, plan_footsteps, walking_stack
from poise.robots import GRAVITY
from poise.sim import Plant, PlantConfig, SensorConfig, rollout
from poise.stack import default_stack

PERIOD = 0.002
VELOCITY, TILT, DRIFT = 0.05, math.radians(0.5), 0.02


def walk(robot, *, steps, seed=0):
    """A walk, measured with noise: measured states, truths of the same moments."""
    sensors = SensorConfig.typical()
    plant = Plant(robot, PlantConfig(control_dt=PERIOD, sensors=sensors), seed=seed)
    stack = walking_stack(robot)
    stride = Stride(steps=steps, length=0.15)
    plan = plan_footsteps(robot, [stride], Gait(step_time=0.8, double_support=0.15, crouch=0.02))
    walker = Walker(robot, stack, plan=plan)
    controller = WholeBodyController(robot, stack)
    measured, truths = [], [plant.true_state()]
    for tick in rollout(plant, controller, walker, duration=plan.duration):
        measured.append(tick.state)
        truths.append(tick.truth)
    assert not plant.fallen
    return measured, truths[:-1]


@pytest.fixture(scope="module")
def walked(get_robot):
    """A walk under the truth, for many estimators to look at."""
    robot = get_robot("humanoid33")
    return robot, *walk(robot, steps=3)


def rotation(state):
    return pin.Quaternion(state.q[3:7]).toRotationMatrix()


def errors(estimates, truths):
    """Base velocity [m/s], tilt [rad] and position [m], a row a tick."""
    velocity = np.array([e.v[:3] - t.v[:3] for e, t in zip(estimates, truths, strict=True)])
    up = [(rotation(e)[2], rotation(t)[2]) for e, t in zip(estimates, truths, strict=True)]
    tilt = np.array([np.linalg.norm(np.cross(a, b)) for a, b in up])
    position = np.array([e.q[:3] - t.q[:3] for e, t in zip(estimates, truths, strict=True)])
    return velocity, tilt, position


def rms(rows):
    return float(np.sqrt(np.mean(np.sum(np.atleast_2d(rows.T) ** 2, axis=0))))


def assert_within_bounds(estimates, truths):
    velocity, tilt, position = errors(estimates, truths)
    way = sum(
        np.linalg.norm(b.q[:2] - a.q[:2])
        for a, b in zip(truths[::50], truths[50::50], strict=False)
    )
    assert rms(velocity) < VELOCITY
    assert rms(tilt) < TILT
    assert np.linalg.norm(position[-1]) < DRIFT * way


# --- against the truth --------------------------------------------------------------------------


def test_a_walk_is_estimated_within_bounds(walked):
    robot, measured, truths = walked
    estimator = StateEstimator(robot, q_start=truths[0].q)
    estimates = [estimator.update(state) for state in measured]
    assert_within_bounds(estimates, truths)
    assert estimator.status.ok
    for estimate, state in zip(estimates, measured, strict=True):
        np.testing.assert_array_equal(estimate.q[7:], state.q[7:])
        np.testing.assert_array_equal(estimate.v[6:], state.v[6:])
        assert estimate.time == state.time
    spin = np.array([e.v[3:6] - t.v[3:6] for e, t in zip(estimates, truths, strict=True)])
    assert rms(spin[500:]) < 0.015


def test_the_base_that_a_plant_measures_is_not_looked_at(walked):
    robot, measured, truths = walked
    lied = []
    for state in measured[:300]:
        q, v = state.q.copy(), state.v.copy()
        q[:7], v[:6] = np.nan, np.nan
        lied.append(replace(state, q=q, v=v))
    one, other = (StateEstimator(robot, q_start=truths[0].q) for _ in range(2))
    for state, lie in zip(measured[:300], lied, strict=True):
        seen, told = one.update(state), other.update(lie)
        np.testing.assert_array_equal(seen.q, told.q)
        np.testing.assert_array_equal(seen.v, told.v)


def test_the_same_measurements_give_the_same_estimates_after_a_reset(walked):
    robot, measured, truths = walked
    estimator = StateEstimator(robot, q_start=truths[0].q)
    first = [estimator.update(state) for state in measured[:200]]
    estimator.reset()
    for state, before in zip(measured[:200], first, strict=True):
        np.testing.assert_array_equal(estimator.update(state).q, before.q)


WALK_ON_THE_ESTIMATE = """
import json, sys
from dataclasses import asdict
from studies.locomotion.estimated_walk import Trial, run_trial
print(json.dumps(asdict(run_trial(Trial(robot=sys.argv[1], seed=1, seconds=8.0)))))
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["humanoid33", "g1"])
def test_a_robot_walks_on_the_estimate(get_robot, name):
    get_robot(name)
    found = run_unchecked(WALK_ON_THE_ESTIMATE, name)
    assert not found["fell"]
    assert found["way"] > 0.7
    assert found["velocity_rms"] < VELOCITY
    assert found["tilt_rms"] < TILT
    assert found["height"] < DRIFT * found["way"]


def test_yaw_and_position_begin_as_told(get_robot):
    robot = get_robot("humanoid33")
    q = robot.q_home.copy()
    q[:2] = 3.0, -2.0
    q[3:7] = pin.Quaternion(pin.utils.rotate("z", 1.2)).coeffs()
    plant = Plant(robot)
    plant.reset(q)
    estimate = StateEstimator(robot, q_start=q).update(plant.state())
    np.testing.assert_allclose(estimate.q, q, atol=1e-9)


def test_standing_still_says_the_bias_of_the_gyro_and_where_up_is(get_robot):
    robot = get_robot("humanoid33")
    sensors = SensorConfig(gyro_noise=5e-3, accelerometer_noise=0.05, gyro_bias=0.02)
    config = PlantConfig(actuation="position", control_dt=PERIOD, sensors=sensors)
    plant = Plant(robot, config, seed=5)
    for _ in range(250):
        plant.step(None)
    states = []
    for _ in range(250):
        plant.step(None)
        states.append(plant.state())
    truth, estimator = plant.true_state(), StateEstimator(robot)
    estimator.start(states)
    bias = states[0].readings.angular_velocity - states[0].v[3:6]
    np.testing.assert_allclose(estimator.filter.gyro_bias, bias, atol=2e-3)
    estimate = estimator.update(plant.state())
    _, tilt, _ = errors([estimate], [truth])
    assert tilt[0] < math.radians(0.1)


def swaying(robot):
    """True states of a robot that bends its knees on stiff servos."""
    plant = Plant(robot, PlantConfig(actuation="position", control_dt=PERIOD))
    bend = np.array([("knee" in n) - 0.5 * ("pitch" in n) * ("hip" in n or "ankle" in n)
                     for n in robot.joint_names])  # fmt: skip
    truths = [plant.true_state()]
    for k in range(600):
        angle = 0.1 * (1.0 - math.cos(2.0 * math.pi * 1.5 * k * PERIOD))
        plant.step(None, robot.q_home[7:] + angle * bend)
        truths.append(plant.true_state())
    return truths


def test_a_unit_mounted_elsewhere_gives_the_same_base(get_robot):
    """G1's unit sits off the pelvis: its readings are those of a point that swings around it."""
    robot = get_robot("g1")
    frame = robot.model.frames[robot.frame_id("imu_in_pelvis")]
    R, p = frame.placement.rotation, frame.placement.translation
    assert np.linalg.norm(p) > 0.03
    truths = swaying(robot)
    spins = np.array([t.v[3:6] for t in truths])
    turning = np.diff(spins, axis=0, prepend=spins[:1]) / PERIOD
    config = EstimatorConfig(imu="imu_in_pelvis")
    there = StateEstimator(robot, config, q_start=truths[0].q)
    here = StateEstimator(robot, q_start=truths[0].q)
    estimates, others = [], []
    for truth, w, dw in zip(truths, spins, turning, strict=True):
        force = truth.readings.specific_force + np.cross(dw, p) + np.cross(w, np.cross(w, p))
        readings = SensorReadings(R.T @ w, R.T @ force, truth.readings.torque)
        estimates.append(there.update(replace(truth, readings=readings)))
        others.append(here.update(truth))
    velocity, tilt, position = errors(estimates, truths)
    assert rms(velocity) < 0.02
    assert rms(tilt) < math.radians(0.3)
    assert np.abs(position).max() < 0.01
    velocity, tilt, position = errors(estimates, others)
    assert rms(velocity) < 1e-3
    assert rms(tilt) < math.radians(0.02)
    assert np.abs(position).max() < 1e-3


# --- contacts -----------------------------------------------------------------------------------


def cells(change):
    def corrupted(state):
        contacts = {name: wrench.copy() for name, wrench in state.contacts.items()}
        if 1.5 < state.time < 4.0:
            change(contacts)
        return replace(state, contacts=contacts)

    return corrupted


def stuck(contacts):
    for wrench in contacts.values():
        wrench[2] = max(wrench[2], 300.0)


def dead(contacts):
    contacts["left_sole"][:] = 0.0


def mad(contacts):
    contacts["left_sole"][:] = np.nan


@pytest.mark.parametrize("change", [stuck, dead, mad])
def test_wrong_contacts_are_survived(walked, change):
    robot, measured, truths = walked
    estimator, corrupt = StateEstimator(robot, q_start=truths[0].q), cells(change)
    estimates = [estimator.update(corrupt(state)) for state in measured]
    assert_within_bounds(estimates, truths)
    velocity, _, _ = errors(estimates, truths)
    assert np.abs(velocity).max() < 0.1


def test_without_force_sensors_the_torques_say_what_is_in_contact(walked):
    robot, measured, truths = walked
    estimator, observer_error = StateEstimator(robot, q_start=truths[0].q), []
    estimates, agree = [], []
    for state, truth in zip(measured, truths, strict=True):
        estimates.append(estimator.update(replace(state, contacts={})))
        for name, wrench in truth.contacts.items():
            pressed = wrench[2] / robot.weight
            if pressed < 0.02 or pressed > 0.25:
                agree.append((estimator.probability[name] > 0.5) == (pressed > 0.25))
            if state.time > 0.5:
                observer_error.append(estimator.wrenches[name][2] - wrench[2])
    assert_within_bounds(estimates, truths)
    assert np.mean(agree) > 0.97
    assert np.sqrt(np.mean(np.square(observer_error))) < 0.15 * robot.weight


def test_with_neither_forces_nor_torques_all_soles_are_contacts_until_they_move(walked):
    robot, measured, truths = walked
    estimator, estimates = StateEstimator(robot, q_start=truths[0].q), []
    for state in measured:
        readings = state.readings._replace(torque=np.zeros(0))
        estimates.append(estimator.update(replace(state, contacts={}, readings=readings)))
    velocity, tilt, _ = errors(estimates, truths)
    assert rms(velocity) < VELOCITY
    assert rms(tilt) < TILT


def test_feet_that_slip_are_noticed_and_the_estimate_survives(get_robot):
    """A push on ice: the feet go half a hand's breadth and more."""
    robot = get_robot("humanoid33")
    sensors = SensorConfig.typical()
    plant = Plant(robot, PlantConfig(control_dt=PERIOD, sensors=sensors, friction=0.05), seed=3)
    plant.push("pelvis", (0.0, 0.5 * robot.weight, 0.0), 0.15, start=0.8)
    stack = walking_stack(robot)
    estimator = StateEstimator(robot)
    truths, estimates, walks = [plant.true_state()], [], []
    for tick in rollout(
        plant, WholeBodyController(robot, stack), estimator=estimator, duration=1.4
    ):
        truths.append(tick.truth)
        estimates.append(tick.estimate)
        walks.append(min(estimator.probability.values()))
    data = robot.model.createData()
    feet = []
    for state in (truths[0], truths[-1]):
        pin.framesForwardKinematics(robot.model, data, state.q)
        feet.append(data.oMf[robot.frame_id("left_sole")].translation.copy())
    assert np.linalg.norm(feet[1] - feet[0]) > 0.05
    assert min(walks[400:]) < 0.5
    velocity, tilt, _ = errors(estimates, truths[:-1])
    assert rms(velocity) < VELOCITY
    assert rms(tilt) < TILT


def test_contact_has_hysteresis(get_robot):
    robot = get_robot("humanoid33")
    belief = ContactBelief()
    estimator, plant = StateEstimator(robot), Plant(robot, PlantConfig(control_dt=PERIOD))
    q, held = plant.true_state(), []
    loads = np.concatenate([np.linspace(0.0, 0.2, 50), np.linspace(0.2, 0.0, 50)])
    still = SensorReadings(np.zeros(3), np.array([0.0, 0.0, 9.81]), np.zeros(robot.nj))
    for k, load in enumerate(loads):
        wrench = np.array([0.0, 0.0, load * robot.weight, 0.0, 0.0, 0.0])
        contacts = {"left_sole": wrench, "right_sole": np.zeros(6)}
        estimator.update(RobotState(q.q, np.zeros(robot.nv), contacts, k * PERIOD, still))
        held.append(bool(estimator.filter.held[0]))
    begun, ended = held.index(True), len(held) - held[::-1].index(True)
    assert loads[begun] > belief.load > loads[ended]
    assert all(held[begun:ended])


@pytest.mark.parametrize("tare", [True, False])
def test_load_cells_are_zeroed_in_a_walk_unless_somebody_else_has_done_that(walked, tare):
    robot, measured, _ = walked
    off = 0.01 * robot.weight * np.array([1.0, -1.0, 1.0, 0.05, 0.05, 0.05])
    estimator = StateEstimator(robot, EstimatorConfig(tare=tare))
    for state in measured:
        contacts = {sole: wrench + off for sole, wrench in state.contacts.items()}
        known = replace(state, contacts=contacts)
        found = estimator.update(known)
    zeros = estimator.tare.zeros
    assert len(zeros) == (2 if tare else 0)
    for sole in robot.soles:
        true, expected = state.contacts[sole], found.contacts[sole] - (0.0 if tare else off)
        # Of noise of the air's samples little is left in the mean.
        np.testing.assert_allclose(expected, true, rtol=0.0, atol=0.1 * np.abs(off).max())


def test_the_momentum_observer_finds_the_weight_of_a_standing_robot(get_robot):
    robot = get_robot("humanoid33")
    plant = Plant(robot, PlantConfig(actuation="position", control_dt=PERIOD))
    for _ in range(400):
        plant.step(None)
    observer = MomentumObserver(robot)
    for _ in range(50):
        state = plant.true_state()
        observer.update(state, state.readings.torque, PERIOD)
        plant.step(None)
    found = observer.wrenches
    assert sum(w[2] for w in found.values()) == pytest.approx(robot.weight, rel=0.02)
    for name, wrench in plant.sole_wrenches().items():
        np.testing.assert_allclose(found[name][2], wrench[2], atol=0.02 * robot.weight)


# --- bad input ----------------------------------------------------------------------------------


def test_a_unit_that_says_nothing_for_a_while_is_stood_in_for(walked):
    robot, measured, truths = walked
    estimator, estimates, seen = StateEstimator(robot, q_start=truths[0].q), [], set()
    bad = SensorReadings(np.full(3, np.nan), np.zeros(3), np.zeros(robot.nj))
    for state in measured:
        if 2.0 < state.time < 2.05:
            state = replace(state, readings=None if state.time < 2.02 else bad)
        estimates.append(estimator.update(state))
        seen.add(estimator.status)
    assert EstimatorStatus.NO_IMU in seen
    assert_within_bounds(estimates, truths)
    velocity, _, _ = errors(estimates, truths)
    assert np.abs(velocity).max() < 0.3


@pytest.mark.parametrize("jump", [0.3, -0.5])
def test_a_clock_that_jumps_is_said_and_survived(walked, jump):
    robot, measured, truths = walked
    estimator, estimates, said = StateEstimator(robot, q_start=truths[0].q), [], []
    for state in measured:
        if state.time > 2.0:
            state = replace(state, time=state.time + jump)
        estimates.append(estimator.update(state))
        said.append(estimator.status)
    assert said.count(EstimatorStatus.CLOCK_JUMP) == 1
    assert_within_bounds(estimates, truths)


def test_a_clock_that_nobody_sets_is_said(walked):
    robot, measured, truths = walked
    estimator, said = StateEstimator(robot, q_start=truths[0].q), []
    for state in measured[:100]:
        estimator.update(replace(state, time=0.0))
        said.append(estimator.status)
    assert said[0].ok
    assert set(said[1:]) == {EstimatorStatus.CLOCK_STILL}
    for state in measured[100:110]:
        estimate = estimator.update(state)
    assert estimator.status.ok
    # The same state twice changes nothing.
    np.testing.assert_array_equal(estimator.update(measured[109]).q, estimate.q)
    assert estimator.status.ok


def test_a_state_of_no_use_comes_back_as_it_is(walked):
    robot, measured, truths = walked
    estimator = StateEstimator(robot, q_start=truths[0].q)
    estimator.update(measured[0])
    good = measured[1]
    nan = good.q.copy()
    nan[9] = np.nan
    for bad in (
        replace(good, q=nan),
        replace(good, q=good.q[:-1]),
        replace(good, v=1e9 * np.ones_like(good.v)),
        replace(good, time=math.nan),
    ):
        assert estimator.update(bad) is bad
        assert estimator.status is EstimatorStatus.BAD_STATE
    assert np.isfinite(estimator.update(good).q).all()
    assert estimator.status.ok


@pytest.mark.parametrize(
    "wrench",
    [np.zeros(3), "none", np.full(6, np.nan)],
    ids=str,
)
def test_a_wrench_that_is_none_says_nothing_and_ends_no_loop(walked, wrench):
    robot, measured, truths = walked
    config, payload = EstimatorConfig(vote=False), PayloadEstimator(robot)
    estimator = StateEstimator(robot, config, q_start=truths[0].q, payload=payload)
    estimator.update(measured[0])
    estimator.update(measured[1])
    left, right = robot.soles
    bad = odd(measured[2], contacts={left: wrench, right: measured[2].contacts[right]})
    assert bad.wrench(left) is None
    assert np.isfinite(estimator.update(bad).q).all()
    assert estimator.status.ok
    assert estimator.probability[left] == 0.0


@pytest.mark.parametrize(
    "readings",
    [SensorReadings(None, None, None), SensorReadings(np.zeros(2), np.zeros(3), np.zeros(0))],
    ids=["nothing", "two numbers"],
)
def test_readings_that_are_none_end_no_loop(walked, readings):
    robot, measured, truths = walked
    estimator = StateEstimator(robot, q_start=truths[0].q)
    estimator.update(measured[0])
    good = measured[1]
    bad = odd(good, readings=readings)
    assert np.isfinite(estimator.update(bad).q).all()
    assert estimator.status is EstimatorStatus.NO_IMU
    silent = SensorReadings(good.readings.angular_velocity, good.readings.specific_force, None)
    estimator.update(odd(measured[2], readings=silent, contacts={}))
    assert estimator.status.ok


@pytest.mark.parametrize("force", [280.0, np.inf])
def test_readings_beyond_all_bounds_do_not_spoil_it_for_good(walked, force):
    """One tick of 280 m/s^2 along each axis is an error of half a metre a second."""
    robot, measured, truths = walked
    estimator = StateEstimator(robot, q_start=truths[0].q)
    for state in measured[:300]:
        estimator.update(state)
    shock = measured[300].readings._replace(specific_force=np.full(3, force))
    estimator.update(replace(measured[300], readings=shock))
    assert estimator.status is (EstimatorStatus.OK if force < 500.0 else EstimatorStatus.NO_IMU)
    estimates = [estimator.update(state) for state in measured[301:1101]]
    velocity, tilt, _ = errors(estimates, truths[301:1101])
    # A second later.
    assert np.abs(velocity[500:]).max() < 0.05
    assert tilt[-1] < math.radians(1.0)


def test_numbers_that_are_no_longer_sound_begin_anew_where_it_last_was(walked):
    """On a block of 0.3 m, of which it was not told."""
    robot, measured, truths = walked
    estimator = StateEstimator(robot, q_start=truths[0].q)
    estimator.start(measured[:50])
    estimator.filter.position[2] += 0.3
    before = estimator.update(measured[50])
    estimator.filter.velocity[:] = np.nan
    after = estimator.update(measured[51])
    assert estimator.status is EstimatorStatus.RESTARTED
    np.testing.assert_allclose(after.q[:3], before.q[:3], atol=1e-3)
    assert np.isfinite(estimator.update(measured[52]).q).all()
    assert estimator.status.ok
    # And from the beginning after a reset.
    estimator.reset()
    estimator.start(measured[:50])
    np.testing.assert_allclose(estimator.update(measured[50]).q[:3], truths[50].q[:3], atol=5e-3)


def test_what_cannot_be_estimated_is_refused(get_robot):
    with pytest.raises(ConfigurationError, match="fixed base"):
        StateEstimator(get_robot("arm6"))
    robot = get_robot("humanoid33")
    with pytest.raises(UnknownNameError, match="nowhere"):
        StateEstimator(robot, EstimatorConfig(imu="nowhere"))
    with pytest.raises(ConfigurationError, match="not on the base link"):
        StateEstimator(robot, EstimatorConfig(imu="left_sole"))
    with pytest.raises(ConfigurationError, match="end < begin"):
        ContactBelief(begin=0.3, end=0.5)


def test_joint_velocities_are_smoothed_where_that_is_asked_for(walked):
    robot, measured, truths = walked
    config = EstimatorConfig(joint_bandwidth=20.0)
    estimator = StateEstimator(robot, config, q_start=truths[0].q)
    states = measured[:500]
    smooth = np.array([estimator.update(state).v[6:] for state in states])
    rough = np.array([state.v[6:] for state in states])
    expected, gain = rough[0].copy(), -math.expm1(-2.0 * math.pi * 20.0 * PERIOD)
    for k, row in enumerate(rough):
        expected += gain * (row - expected) if k else 0.0
        np.testing.assert_allclose(smooth[k], expected, atol=1e-12)
    # After a clock that goes back it begins anew.
    np.testing.assert_array_equal(estimator.update(measured[10]).v[6:], measured[10].v[6:])
    assert estimator.status is EstimatorStatus.CLOCK_JUMP


def rolled(robot, faster, since, time):
    """On the outer edge of the left sole, rolling over it as one body, faster and faster."""
    angle, rate = 0.5 * faster * since**2, faster * since
    sole = robot.soles["left_sole"]
    home = robot.q_home
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, home)
    edge = data.oMf[robot.frame_id("left_sole")].act(np.array([0.0, 0.5 * sole.width, 0.0]))
    turn = pin.exp3(np.array([angle, 0.0, 0.0]))
    base = turn @ pin.Quaternion(home[3:7]).toRotationMatrix()
    q = home.copy()
    q[:3] = edge + turn @ (home[:3] - edge)
    q[3:7] = pin.Quaternion(base).coeffs()
    spin = np.array([rate, 0.0, 0.0])
    arm = q[:3] - edge
    v = np.zeros(robot.nv)
    v[:3], v[3:6] = base.T @ np.cross(spin, arm), base.T @ spin
    force = base.T @ (
        np.cross([faster, 0.0, 0.0], arm)
        + np.cross(spin, np.cross(spin, arm))
        + [0.0, 0.0, GRAVITY]
    )
    wrenches = {"left_sole": np.array([0.0, 0.0, robot.weight, 0.0, 0.0, 0.0])}
    wrenches["right_sole"] = np.zeros(6)
    readings = SensorReadings(v[3:6].copy(), force, np.zeros(0))
    return RobotState(q, v, wrenches, time, readings)


class Shaken:
    """Asks a standing robot to turn its pelvis and torso to and fro, as fast as it can."""

    def __init__(self, stack):
        self.stack, self._tasks = stack, {task.name: task for _, task in stack.tasks()}

    def lead(self, state):
        for name, axis, rate in (
            ("pelvis orientation", np.array([0.0, 0.3, 1.4]), 17.0),
            ("torso orientation", np.array([0.5, 1.0, 0.0]), 14.0),
        ):
            angle = math.sin(rate * state.time)
            twist = np.append(np.zeros(3), rate * math.cos(rate * state.time) * axis)
            accel = np.append(np.zeros(3), -rate * rate * angle * axis)
            self._tasks[name].set_target(None, pin.exp3(angle * axis), twist, accel)


def test_soles_that_rock_under_a_shaken_robot_are_no_bias_of_the_gyro(get_robot):
    robot, biases = get_robot("g1"), {}
    for shake in (0.0, ContactBelief().shake):
        plant = Plant(robot, PlantConfig(control_dt=PERIOD))
        config = EstimatorConfig(contact=ContactBelief(shake=shake))
        estimator = StateEstimator(robot, config, q_start=robot.q_home)
        stack = default_stack(robot)
        turned = found = 0.0
        for tick in rollout(
            plant,
            WholeBodyController(robot, stack),
            Shaken(stack),
            estimator=estimator,
            duration=1.0,
        ):
            turned = max(turned, np.linalg.norm(tick.truth.v[3:6]))
            found = max(found, np.linalg.norm(estimator.filter.gyro_bias))
        assert not plant.fallen
        assert turned > 4.0
        biases[shake] = found
    # The gyro has none.
    assert biases[ContactBelief().shake] < 0.01 < 0.015 < biases[0.0]


def test_a_sole_that_rolls_over_its_edge_is_no_bias_of_the_gyro(get_robot_without):
    robot = get_robot_without("left_ankle_roll", "right_ankle_roll")
    assert all(sole.leans for sole in robot.soles.values())
    estimator, dt = StateEstimator(robot), 0.002
    for k in range(100):
        estimator.update(rolled(robot, 0.0, 0.0, dt * k))
    for k in range(150):
        true = rolled(robot, 1.0, dt * k, 0.2 + dt * k)
        found = estimator.update(true)
    assert estimator.status.ok
    assert np.linalg.norm(estimator.filter.gyro_bias) < 0.01
    assert np.linalg.norm(found.v[:6] - true.v[:6]) < 0.05


def test_a_base_that_points_backwards_is_estimated(get_robot):
    # Of iCub the base link points backwards, and the frame that is called pelvis ahead.
    robot = get_robot("icub")
    plant = Plant(robot, PlantConfig(control_dt=PERIOD))
    plant.push(robot.torso, (0.0, 0.05 * robot.weight, 0.0), duration=0.1)
    controller, estimator = WholeBodyController(robot), StateEstimator(robot)
    before = plant.true_state()
    for tick in rollout(plant, controller, estimator=estimator, duration=0.4):
        assert np.linalg.norm(tick.estimate.v[:6] - before.v[:6]) < 0.01
        before = tick.truth
    assert not plant.fallen
