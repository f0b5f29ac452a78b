"""The controller in the shape of LeRobot's, in closed loop with drives of position targets."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("mujoco")

from poise import Command, CommandStatus, Plant
from poise.apps.balance import LeRobotController
from poise.errors import ConfigurationError
from poise.sim import PlantConfig

ARM = (
    "kLeftShoulderPitch", "kLeftShoulderRoll", "kLeftShoulderYaw", "kLeftElbow", "kLeftWristRoll",
    "kLeftWristPitch", "kLeftWristYaw",
)  # fmt: skip
LEG = ("kLeftHipPitch", "kLeftHipRoll", "kLeftHipYaw", "kLeftKnee", "kLeftAnklePitch",
       "kLeftAnkleRoll")  # fmt: skip
WAIST = ("kWaistYaw", "kWaistRoll", "kWaistPitch")
MOTORS = (*LEG, *(n.replace("Left", "Right") for n in LEG), *WAIST, *ARM,
          *(n.replace("Left", "Right") for n in ARM))  # fmt: skip
"""Names of G1's motors in their order, as in LeRobot's `G1_29_JointIndex`."""


class Loop:
    """A simulated G1 behind drives as LeRobot commands them, at 1 kHz."""

    def __init__(self, robot, control_dt=0.004, *, noise=False):
        config = PlantConfig(control_dt=0.001, self_contact=True)
        self.plant = Plant(robot, config.with_noise() if noise else config)
        self.robot, self.ticks = robot, round(control_dt / 0.001)
        clock = lambda: self.plant.time  # noqa: E731
        self.controller = LeRobotController(robot, control_dt=control_dt, clock=clock)

    def lowstate(self):
        state = self.plant.state()
        x, y, z, w = state.q[3:7].tolist()
        numbers = zip(state.q[7:], state.v[6:], state.readings.torque, strict=True)
        unit = SimpleNamespace(
            quaternion=[w, x, y, z],
            gyroscope=state.readings.angular_velocity.tolist(),
            accelerometer=state.readings.specific_force.tolist(),
        )
        motors = [SimpleNamespace(q=q, dq=dq, tau_est=tau) for q, dq, tau in numbers]
        return SimpleNamespace(motor_state=motors, imu_state=unit)

    def run(self, seconds, action):
        """Run until a time, under a function of it."""
        c, limit = self.controller, self.robot.tau_max
        while self.plant.time < seconds and not self.plant.fallen:
            found = c.run_step(action(self.plant.time), self.lowstate())
            target = np.array([found[f"{name}.q"] for name in MOTORS])
            for _ in range(self.ticks):
                now = self.plant.true_state()
                torque = c.kp * (target - now.q[7:]) - c.kd * now.v[6:]
                self.plant.step(Command(CommandStatus.OK, np.clip(torque, -limit, limit)))


def sticks(ly=0.0, **arms):
    return {"remote.lx": 0.0, "remote.ly": ly, "remote.rx": 0.0, "remote.ry": 0.0, **arms}


def test_it_has_the_shape_of_a_controller_of_lerobot(get_robot):
    controller = Loop(get_robot("g1")).controller
    assert controller.control_dt == 0.004
    assert controller.kp.shape == controller.kd.shape == controller.default_angles.shape == (29,)
    assert controller.run_step(sticks(), None) == {}


def test_position_targets_pull_with_the_torque_of_the_controller(get_robot):
    """At the state that they answer, within the motors' limits, and the same on both sides."""
    loop = Loop(get_robot("g1"))
    loop.run(0.2, lambda _: sticks())
    state = loop.plant.true_state()
    found = loop.controller.run_step(sticks(), loop.lowstate())
    assert tuple(found) == tuple(f"{name}.q" for name in MOTORS)
    c = loop.controller
    torque = c.kp * (np.array([*found.values()]) - state.q[7:]) - c.kd * state.v[6:]
    robot = get_robot("g1")
    assert (np.abs(torque) <= robot.tau_max + 1e-9).all()
    # Standing, each knee and each elbow carry what gravity asks of both alike.
    left, right = torque[3], torque[9]
    assert left == pytest.approx(right, abs=2.0)
    assert abs(torque[:12]).max() > 5.0


def test_it_stands_and_moves_its_arms(get_robot):
    loop = Loop(get_robot("g1"))
    loop.run(0.6, lambda t: sticks(**{"kLeftElbow.q": 0.8 - min(t, 0.4)}))
    assert not loop.plant.fallen
    elbow = loop.plant.true_state().q[7 + loop.robot.joint_index("left_elbow_joint")]
    assert elbow == pytest.approx(0.4, abs=0.08)


@pytest.mark.parametrize("part", ["q", "dq", "quaternion"])
def test_without_a_good_state_targets_stay(get_robot, part):
    loop = Loop(get_robot("g1"))
    loop.run(0.02, lambda _: sticks())
    before = loop.controller.run_step(sticks(), loop.lowstate())
    bad = loop.lowstate()
    if part == "quaternion":
        bad.imu_state.quaternion = None
    else:
        setattr(bad.motor_state[4], part, math.nan)
    found = loop.controller.run_step(sticks(**{"kLeftElbow.q": "far"}), bad)
    assert all(map(math.isfinite, found.values()))
    assert found.keys() == before.keys()
    if part != "quaternion":  # the estimator needs none
        assert found == before
    assert loop.controller.leader.refused == 1


def test_another_robot_is_refused(get_robot):
    with pytest.raises(ConfigurationError, match="29"):
        LeRobotController(get_robot("humanoid33"))


@pytest.mark.slow
@pytest.mark.parametrize("control_dt", [0.002, 0.004])
def test_it_walks(get_robot, control_dt):
    loop = Loop(get_robot("g1"), control_dt, noise=True)

    def action(time):
        wave = 0.6 * math.sin(math.pi * time)
        arms = {"kLeftShoulderPitch.q": 0.2 + wave, "kRightShoulderPitch.q": 0.2 - wave}
        return sticks(0.4 if time > 1.0 else 0.0, **arms)

    loop.run(8.0, action)
    assert not loop.plant.fallen
    assert loop.plant.com[0] > 0.8
