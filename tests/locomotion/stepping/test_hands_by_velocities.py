"""Hands and head where velocities are commanded: arms go as led, legs make up for it."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from led_hands import Arms
from msgspec import structs
from slow import slow
from walker import hands as device_of, up_and_down

from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, replay_teleop, run_teleop
from poise.dynamics import Dynamics, RobotState
from poise.locomotion import (
    GazeLeader,
    HandLeader,
    HandStatus,
    Mode,
    OperatorGuard,
    OperatorSample,
    StepTeleoperator,
    TrackedPose,
    WayPoint,
)
from poise.robots import capsules_of
from poise.sim import Plant, Recorder, rollout

DT = 0.005
DOWN = (0.0, 0.0, -0.03)
NOBODY = (None, None)


def hand(x, y=0.0, z=0.0, clutch=True):
    return TrackedPose.of((x, y, z), clutch)


def open_hands():
    return hand(0.0, clutch=False), hand(0.0, clutch=False)


def circling(time, start=0.3):
    """Hands that go around in opposite directions at some 0.6 m/s."""
    if time < start:
        return open_hands()
    angle = 6.0 * (time - start)
    x, z = 0.1 * np.sin(angle), 0.1 - 0.1 * np.cos(angle)
    return hand(x, 0.0, z), hand(-x, 0.0, z)


def circling_nowhere(time):
    """Likewise with open clutches."""
    return tuple(structs.replace(each, clutch=False) for each in circling(time))


def raised(time):
    """Both hands go forward and up, and stay there."""
    if time < 0.3:
        return open_hands()
    part = min((time - 0.3) / 0.5, 1.0)
    return tuple(hand(0.12 * part, 0.0, 0.15 * part) for _ in NOBODY)


STAND = (WayPoint(at=0.2, left=DOWN, right=DOWN),)


def operator(make, points=STAND, rest=None):
    """Feet by way-points; hands by what is made of the time; rest from a time on."""

    def device(teleoperator):
        feet = device_of(*points)(teleoperator)

        class Both:
            def sample(self, time):
                both = make(time)
                if both is None:
                    return None
                resting = rest is not None and time >= rest
                return structs.replace(feet.sample(time), hands=both, rest=resting)

        return Both()

    return device


def arms_of(robot):
    """Places of the arms' joints among the robot's."""
    return [robot.joint_index(name) for name in HandLeader(robot, dt=DT).task.joints]


def misses(run, robot):
    """How far each hand is from where it is led to at the end, on the true robot [m]."""
    dynamics = Dynamics(robot)
    dynamics.update(RobotState(run.log.q[-1], np.zeros(robot.nv)))
    off = np.mean([dynamics.frame(robot.frame_id(s)).position for s in robot.soles], axis=0)
    off = off - run.log.soles[-1].mean(axis=0)
    return [
        np.linalg.norm(
            dynamics.frame(robot.frame_id(name)).position - off - run.record[f"target/{name}"][-1]
        )
        for name in robot.hands
    ]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["biped20", "g1"])
def test_hands_at_rest_change_no_command(get_robot, name):
    """To the last bit those of a robot whose arms nobody leads."""
    robot, plant = get_robot(name), VELOCITY_TELEOP_PLANT.with_noise()
    commands = [
        run_teleop(each, operator(circling_nowhere, up_and_down()), plant, duration=2.0, seed=4)
        for each in (robot, replace(robot, hands=()))
    ]
    np.testing.assert_array_equal(*(run.log.command for run in commands))
    assert not commands[0].log.command[:, arms_of(robot)].any()


@pytest.mark.parametrize("name", ["biped20", slow("g1"), slow("humanoid33")])
def test_hands_get_where_they_are_led_while_a_foot_is_lifted(get_robot, name, tmp_path):
    robot, path = get_robot(name), tmp_path / "hands.mcap"
    device, plant = operator(raised, up_and_down()), VELOCITY_TELEOP_PLANT.with_noise()
    run = run_teleop(robot, device, plant, duration=2.4, seed=1, recording=path)
    assert not run.fell
    assert len(run.log.entries(Mode.SL)) == 1
    assert run.teleoperator.status.hands == (HandStatus.LED, HandStatus.LED)
    assert max(misses(run, robot)) < 0.01
    if name == "g1":
        assert np.array_equal(replay_teleop(path, robot).log.command, run.log.command)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["biped20", "g1"])
def test_legs_make_up_for_arms_that_swing(get_robot, name):
    """The COM stays where it shall be, though the arms alone would move it by millimetres."""
    robot = get_robot(name)
    run = run_teleop(robot, operator(raised), VELOCITY_TELEOP_PLANT, duration=2.0)
    log, dynamics = run.log, Dynamics(robot)
    arms = 7 + np.array(arms_of(robot))
    moved = []
    for k in range(0, len(log), 10):
        q = robot.q_home.copy()
        q[arms] = log.q[k, arms]
        dynamics.update(RobotState(q, np.zeros(robot.nv)))
        moved.append(dynamics.com[:2].copy())
    assert np.linalg.norm(moved[-1] - moved[0]) > 0.003
    assert np.linalg.norm(log.com[40:, :2] - log.zmp_reference[40:], axis=1).max() < 0.0005
    assert log.tilt.max() < 0.002


def test_the_com_moves_as_was_asked_for_whatever_arms_do(get_robot):
    """Of a command, by Pinocchio alone: the robot on its stance sole, arms and all."""
    robot = get_robot("g1")
    teleoperator = StepTeleoperator(robot, actuation="velocity")
    teleoperator.device = operator(circling)(teleoperator)
    controller, model, data = teleoperator.controller(), robot.model, robot.model.createData()
    for k in range(120):
        state = RobotState(robot.q_home, np.zeros(robot.nv), time=DT * k)
        estimate = teleoperator.estimator.update(state)
        teleoperator.lead(estimate)
        command = controller.step(estimate)
    assert np.abs(command.velocity[arms_of(robot)]).max() > 0.5
    q, stance = estimate.q, teleoperator.soles[teleoperator.estimator.stance]
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    aligned = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    J = pin.getFrameJacobian(model, data, model.getFrameId(stance), aligned)
    v = np.concatenate([np.zeros(6), command.velocity])
    v[:6] = -np.linalg.solve(J[:, :6], J @ v)
    com = pin.jacobianCenterOfMass(model, data, q) @ v
    asked = teleoperator.stack.task("com").given_velocity
    np.testing.assert_allclose(com, asked, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["g1", "humanoid33"])
def test_nothing_jumps_where_a_clutch_opens_or_closes_a_device_is_lost_or_hands_go_to_rest(
    get_robot, name
):
    robot = get_robot(name)

    def make(time):
        if 0.8 < time < 0.9 or 1.1 < time < 1.2:
            left, right = circling(time)
            return tuple(structs.replace(each, clutch=False) for each in (left, right))
        if 1.4 < time < 2.0:
            return None
        return circling(time) if time < 2.0 else open_hands()

    run = run_teleop(
        robot, operator(make, rest=2.1), VELOCITY_TELEOP_PLANT.with_noise(), duration=6.0, seed=2
    )
    assert not run.fell
    led = run.log.command[:, arms_of(robot)]
    # Joints get 60 rad/s^2 at most, and noise of encoders comes through the feedback.
    assert np.abs(np.diff(led, axis=0)).max() < 60.0 * DT + 0.02
    said = run.record.notes("hands")
    for time, does in ((0.7, "LED"), (0.85, "HELD"), (1.0, "LED"), (1.95, "HELD"), (5.9, "REST")):
        assert next(text for at, text in reversed(said) if at <= time) == f"{does}, {does}", time
    # Back at rest nothing is asked for, to the last bit.
    assert not led[-20:].any()
    np.testing.assert_allclose(run.log.q[-1, 7:][arms_of(robot)],
                               robot.q_home[7:][arms_of(robot)], atol=0.03)  # fmt: skip


BAD = {
    "hand": lambda time: (hand(np.nan), hand(np.nan)),
    "turn": lambda time: tuple(
        structs.replace(h, orientation=(np.nan,) * 4) for h in circling(time)
    ),
    "far": lambda time: (hand(1e9), hand(-1e9)),
}


@pytest.mark.slow
@pytest.mark.parametrize("bad", BAD.values(), ids=BAD)
def test_a_sample_that_is_no_number_moves_nothing(get_robot, bad):
    robot = get_robot("biped20")

    def make(time):
        return circling(time) if time < 0.8 else bad(time)

    run = run_teleop(robot, operator(make), VELOCITY_TELEOP_PLANT, duration=1.6)
    assert not run.fell
    assert np.isfinite(run.log.command).all()
    assert run.teleoperator.status.hands == (HandStatus.HELD, HandStatus.HELD)
    assert max(misses(run, robot)) < 0.01
    for name in robot.hands:
        assert np.ptp(run.record[f"target/{name}"][-120:], axis=0).max() < 0.001


class Spoiled:
    """An estimator that gives states that cannot be used in some ticks."""

    def __init__(self, estimator, begin, end):
        self._estimator, self._begin, self._end = estimator, begin, end

    def update(self, state):
        if self._begin <= state.time < self._end:
            return replace(state, q=np.full_like(state.q, np.nan))
        return self._estimator.update(state)


@pytest.mark.slow
def test_arms_and_their_model_come_together_again_after_ticks_that_failed(get_robot):
    """Servos ran on by the last velocities meanwhile, and the model did not."""
    robot = get_robot("g1")
    plant, teleoperator = (
        Plant(robot, VELOCITY_TELEOP_PLANT),
        StepTeleoperator(robot, actuation="velocity"),
    )
    plant.reset(None)
    teleoperator.device = operator(lambda t: circling(t) if t < 1.0 else raised(1.0))(teleoperator)
    arms, gaps = arms_of(robot), []
    for tick in rollout(
        plant,
        teleoperator.controller(),
        teleoperator,
        [Recorder()],
        estimator=Spoiled(teleoperator.estimator, 0.7, 0.75),
        duration=2.5,
    ):
        model = teleoperator.hands.task.target_position
        gaps.append(np.abs(model - tick.state.q[7:][arms]).max())
    assert not plant.fallen
    assert max(gaps[140:160]) > 0.02
    assert gaps[-1] < 0.005


@pytest.mark.slow
def test_nothing_winds_up_in_arms_that_cannot_follow(get_robot):
    """Somebody holds them: servos are asked for no more than the gap gives, and learn nothing."""
    robot = get_robot("g1")
    leader, guard = HandLeader(robot, dt=DT, servos=True), OperatorGuard(dt=DT)
    for k in range(1000):
        both = raised(DT * k)
        guard.check(OperatorSample(DT * k, hands=both), DT * k)
        leader.lead(guard, RobotState(robot.q_home, np.zeros(robot.nv), time=DT * k))
        assert not leader._arms.bias.any()
    np.testing.assert_allclose(leader.task.velocity_gain, 2.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["g1", "humanoid33"])
def test_arms_stay_smooth_within_limits_and_off_the_body_at_this_tick(get_robot, name):
    robot, rng = get_robot(name), np.random.default_rng(6)
    capsules, q = capsules_of(robot), robot.q_home.copy()
    arms = Arms(robot, dt=DT)
    places = 7 + arms.index
    lower = np.minimum(robot.q_min[arms.index], robot.q_home[places])
    upper = np.maximum(robot.q_max[arms.index], robot.q_home[places])
    margins, start, least = np.minimum(0.03, capsules.at_home - 0.01), arms.hands, np.inf
    for k in range(800):
        if k % 80 == 0:
            goals = [here + rng.uniform(-0.6, 0.6, 3) for here in start]
        before = arms.v
        arms.advance(goals)
        assert np.abs(arms.v - before).max() <= 60.0 * DT + 1e-9
        assert (lower - 1e-9 <= arms.q).all()
        assert (arms.q <= upper + 1e-9).all()
        if k % 10 == 0:
            q[places] = arms.q
            least = min(least, (capsules.distances(robot, q) - margins).min())
    assert least > -0.015


# The head -----------------------------------------------------------------------------------------


def turned(yaw):
    return TrackedPose(None, True, (0.0, 0.0, float(np.sin(0.5 * yaw)), float(np.cos(0.5 * yaw))))


@pytest.mark.slow
def test_a_neck_looks_there_and_the_run_replays(get_robot, tmp_path):
    robot, path = get_robot("humanoid33"), tmp_path / "gaze.mcap"
    points = [
        WayPoint(at=0.2, head=(0.0, 0.0, 0.0), left=DOWN, right=DOWN),
        WayPoint(at=0.7, head=(0.0, 0.0, 0.4)),
    ]
    plant = VELOCITY_TELEOP_PLANT.with_noise()
    run = run_teleop(robot, device_of(*points), plant, duration=1.6, seed=2, recording=path)
    assert not run.fell
    assert run.teleoperator.status.gaze is HandStatus.LED
    dynamics, heads = Dynamics(robot), []
    for q in (run.log.q[-1], robot.q_home):
        dynamics.update(RobotState(q, np.zeros(robot.nv)))
        heads.append(dynamics.frame(robot.frame_id("head_link")).rotation)
    turn = pin.log3(heads[0] @ heads[1].T)
    np.testing.assert_allclose(turn, [0.0, 0.0, 0.4], atol=0.03)
    assert np.array_equal(replay_teleop(path, robot).log.command, run.log.command)


def test_a_neck_back_at_rest_is_asked_for_nothing(get_robot):
    leader = GazeLeader(get_robot("humanoid33"), dt=DT, servos=True)
    guard = OperatorGuard(dt=DT)

    def say(k, head, rest=False):
        guard.check(OperatorSample(DT * k, head=head, rest=rest), DT * k)
        leader.lead(guard)
        return leader.task.velocity_gain[0]

    assert say(0, structs.replace(turned(0.0), clutch=False)) == 0.0
    assert max(say(k, turned(0.3)) for k in range(1, 200)) == pytest.approx(2.0)
    assert leader.status is HandStatus.LED
    gains = [say(k, None, rest=True) for k in range(200, 600)]
    assert leader.status is HandStatus.REST
    assert gains[-1] == 0.0


def test_without_a_neck_nothing_looks_there(get_robot):
    """No torso is turned where velocities are commanded."""
    teleoperator = StepTeleoperator(get_robot("g1"), actuation="velocity")
    teleoperator.lead(teleoperator.estimator.update(teleoperator.estimator.dynamics.state))
    assert teleoperator.status.gaze is None
