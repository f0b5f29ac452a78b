"""Hands and head where velocities are commanded: arms go as led, legs make up for it."""

import numpy as np
import pinocchio as pin
import pytest
from led_hands import hand
from msgspec import structs
from slow import slow
from walker import hands as device_of, up_and_down

from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, replay_teleop, run_teleop
from poise.dynamics import Dynamics, RobotState
from poise.locomotion import (
    GazeLeader,
    HandStatus,
    Mode,
    OperatorGuard,
    OperatorSample,
    StepTeleoperator,
    TrackedPose,
    WayPoint,
)

DT = 0.005
DOWN = (0.0, 0.0, -0.03)
NOBODY = (None, None)


def open_hands():
    return hand(0.0, clutch=False), hand(0.0, clutch=False)


def circling(time, start=0.3):
    """Hands that go around in opposite directions at some 0.6 m/s."""
    if time < start:
        return open_hands()
    angle = 6.0 * (time - start)
    x, z = 0.1 * np.sin(angle), 0.1 - 0.1 * np.cos(angle)
    return hand(x, 0.0, z), hand(-x, 0.0, z)


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
    torso = robot.joints_above(robot.torso)
    joints = {joint for hand in robot.hands for joint in robot.joints_above(hand)}
    return sorted(joint - 2 for joint in joints - set(torso))


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


# The head -----------------------------------------------------------------------------------------


def turned(yaw):
    return TrackedPose(None, True, (0.0, 0.0, float(np.sin(0.5 * yaw)), float(np.cos(0.5 * yaw))))


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
