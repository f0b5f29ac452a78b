"""The simulated robot behind its bus: hoist, faults, and a client that is not Poise."""

import os
import signal
import subprocess
import sys
from importlib.util import find_spec
from itertools import pairwise

import numpy as np
import pytest

from poise.apps.deployment import FaultPlan, Faults, SimulatedRobot
from poise.errors import UnknownNameError
from poise.hardware import RAMP, MotorCommand, MotorState
from poise.sim import HoistedPlant, PlantConfig

JOINTS = "hip", "knee", "ankle"


def state(k):
    numbers = np.full(3, float(k))
    return MotorState(
        time=0.002 * k,
        arrived=0.002 * k,
        q=numbers,
        dq=numbers,
        tau=numbers,
        temperature=numbers,
        quaternion=np.array([0.0, 0.0, 0.0, 1.0]),
        gyro=np.zeros(3),
        acceleration=np.zeros(3),
        wrenches=np.zeros((0, 6)),
    )


def passed(plan, count=2000):
    """Numbers of the states that arrive, by the tick in which they do."""
    faults = Faults(plan, JOINTS, period=0.002, seed=1)
    return [[int(s.q[0]) for s in faults.states(state(k), 0.002 * k)] for k in range(count)]


def test_without_faults_each_state_arrives_at_once():
    assert passed(FaultPlan(), 5) == [[0], [1], [2], [3], [4]]


def test_lost_states_do_not_arrive():
    arrived = sum(map(len, passed(FaultPlan(loss=0.1))))
    assert abs(arrived - 1800) < 60  # five deviations of a binomial distribution


def test_delayed_states_arrive_later():
    came = passed(FaultPlan(delay=0.004), 10)
    assert came[:2] == [[], []]
    assert came[2:] == [[k] for k in range(8)]


def test_jitter_and_reordering():
    late = [k - n for k, states in enumerate(passed(FaultPlan(jitter=0.006))) for n in states]
    assert set(late) == {1, 2, 3}  # the first tick after it has come
    order = [n for states in passed(FaultPlan(reorder=0.2)) for n in states]
    assert any(a > b for a, b in pairwise(order))


def test_a_frozen_encoder_and_a_dead_motor():
    plan = FaultPlan(frozen=("knee",), dead=("ankle",), begin=0.01)
    faults = Faults(plan, JOINTS, period=0.002)
    for k in range(20):
        (now,) = faults.states(state(k), 0.002 * k)
    assert now.q.tolist() == [19.0, 5.0, 19.0]
    assert now.dq[1] == 0.0
    ones = np.ones(3)
    sent = MotorCommand(q=ones, dq=ones, kp=ones, kd=ones, tau=ones)
    got = faults.command(sent, 0.04)
    assert got.tau.tolist() == got.kp.tolist() == got.kd.tolist() == [1.0, 1.0, 0.0]
    with pytest.raises(UnknownNameError, match="elbow"):
        Faults(FaultPlan(dead=("elbow",)), JOINTS, period=0.002)


class End:
    """A robot's end whose client sends what it is set to."""

    def __init__(self, joints):
        zero = np.zeros(joints)
        self.command = MotorCommand(q=zero, dq=zero, kp=zero, kd=zero, tau=zero)
        self.states = []

    def publish(self, state):
        self.states.append(state)

    def read(self):
        return self.command


def test_a_hoist_holds_a_limp_robot_off_the_ground_and_sets_a_stiff_one_down(get_robot):
    robot = get_robot("biped20")
    plant = HoistedPlant(robot, PlantConfig(control_dt=0.002))
    end = End(robot.nj)
    simulated = SimulatedRobot(plant, end)
    for _ in range(500):
        simulated.tick()
    assert len(end.states) == 500
    assert not any(plant.contacts().values())
    stiff, home = np.full(robot.nj, 200.0), robot.q_home[-robot.nj :]
    zero = np.zeros(robot.nj)
    end.command = MotorCommand(q=home, dq=zero, kp=stiff, kd=0.02 * stiff, tau=zero)
    for _ in range(round(2.2 * RAMP / 0.002)):
        simulated.tick()
    assert all(plant.contacts().values())
    assert not plant.fallen


CLIENT = """
import sys, time
import unitree_interface as sdk

settings = ('<CycloneDDS><Domain Id="any"><General><Interfaces><NetworkInterface name="lo"/>'
            '</Interfaces></General><Discovery><Tag>' + sys.argv[1] + '</Tag></Discovery></Domain>'
            '</CycloneDDS>')
robot = sdk.UnitreeInterface.create_g1("lo", dds_config=settings)
end = time.monotonic() + 20.0
while not any(robot.read_low_state().imu.quat) and time.monotonic() < end:
    time.sleep(0.01)
command = robot.create_zero_command()
command.q_target = robot.read_low_state().motor.q
elbow = 18
while time.monotonic() < end and abs(robot.read_low_state().motor.q[elbow] - 1.0) > 0.2:
    targets = list(command.q_target)
    targets[elbow] = 1.0
    command.q_target = targets
    robot.write_low_command(command)
    time.sleep(0.002)
print("elbow", robot.read_low_state().motor.q[elbow])
"""
"""A client by Unitree's SDK alone, with its own default gains."""


@pytest.mark.slow
def test_a_client_that_is_not_poise_moves_the_simulated_g1():
    if find_spec("unitree_interface") is None:
        pytest.skip("needs far-unitree-sdk")
    tag = f"client{os.getpid()}"
    words = [sys.executable, "-m", "poise", "simulate", "g1", "--tag", tag, "--seconds", "60"]
    simulated = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    try:
        client = [sys.executable, "-c", CLIENT, tag]
        told = subprocess.run(client, capture_output=True, text=True, check=True, timeout=60)
        elbow = float(told.stdout.split("elbow")[1])
        assert abs(elbow - 1.0) < 0.25
        simulated.send_signal(signal.SIGINT)
        assert "commands" in simulated.communicate(timeout=20)[0]
    finally:
        simulated.kill()
