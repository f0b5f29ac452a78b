"""Where a robot that has been turned steps to, and how its feet and trunk face."""

import math

import numpy as np
import pinocchio as pin
import pytest
from walker import facing, sample

pytest.importorskip("mujoco")

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, run_teleop
from poise.locomotion import StepTeleoperator, along_ahead


def yaw_of(rotation):
    return math.atan2(rotation[1, 0], rotation[0, 0])


def apart(angle, other):
    return abs(math.remainder(angle - other, 2.0 * math.pi))


class TurnsThenSteps:
    """Devices on the feet: the robot turns on the spot for a while, and then makes a step ahead."""

    def __init__(self, teleoperator, rate, seconds, lift_at):
        self.teleoperator, self._rate, self._until = teleoperator, rate, 0.5 + seconds
        self._lift_at, self.yaws = lift_at, []

    def sample(self, time):
        teleoperator = self.teleoperator
        left, right = (anchor.copy() for anchor in teleoperator.estimator.anchors)
        since = time - self._lift_at
        if 0.0 < since < 2.5:
            up = 0.06 if since < 1.8 else -0.02
            right += along_ahead((0.06 if since > 0.8 else 0.0, 0.0, up), teleoperator.ahead)
        turning = 0.5 < time < self._until
        return sample(time, left, right, velocity=(0.0, 0.0, self._rate if turning else 0.0))


@pytest.mark.slow
@pytest.mark.parametrize("begin", [0.0, 2.5], ids=["a quarter", "past where angles end"])
def test_a_robot_that_was_turned_steps_on_as_it_faces(get_robot, begin):
    robot, devices = get_robot("biped20"), []

    def device(teleoperator):
        devices.append(TurnsThenSteps(teleoperator, 0.5, 3.0, lift_at=6.5))
        return devices[-1]

    run = run_teleop(
        robot, device, TORQUE_TELEOP_PLANT, duration=10.0, q_start=facing(robot, begin)
    )
    assert not run.fell
    ahead = devices[0].teleoperator.ahead
    assert apart(ahead, begin + 1.5) < 0.4
    log = run.log
    before, after = (np.searchsorted(log.time, t) for t in (6.4, 9.9))
    way = log.soles[after, 1] - log.soles[before, 1]
    forward, aside, _ = along_ahead(way.tolist(), -ahead)
    assert forward == pytest.approx(0.06, abs=0.02)
    assert abs(aside) < 0.02
    # Neither the foot that was in the air nor the trunk was turned back to where it began.
    for sole in run.teleoperator.soles:
        assert apart(yaw_of(run.plant.data.site(sole).xmat.reshape(3, 3)), ahead) < 0.12
    base = pin.Quaternion(*run.plant.true_state().q[[6, 3, 4, 5]]).toRotationMatrix()
    assert apart(yaw_of(base), ahead) < 0.1
    assert log.tilt[before:].max() < 0.1


@pytest.mark.parametrize("yaw", [0.0, 1.0, 3.1, -3.1])
def test_ahead_is_where_it_stands_at_the_start(get_robot, yaw):
    robot = get_robot("biped20")
    teleoperator = StepTeleoperator(robot, q_start=facing(robot, yaw), actuation="torque")
    assert apart(teleoperator.ahead, yaw) < 1e-9


def test_a_trunk_stays_where_it_faces_on_feet_that_are_turned_all_the_way_round(get_robot):
    robot = get_robot("biped20")
    teleoperator = StepTeleoperator(robot, q_start=facing(robot, math.pi), actuation="torque")
    start = teleoperator.estimator.dynamics.state
    teleoperator.device = None
    for _ in range(5):
        teleoperator.lead(start)
    pelvis = next(task for _, task in teleoperator.stack.tasks() if task.name.startswith("pelvis"))
    assert apart(yaw_of(pelvis.target_rotation), math.pi) < 1e-6
