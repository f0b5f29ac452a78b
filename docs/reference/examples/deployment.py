from dataclasses import replace

import poise
from poise.apps.scenarios import load_scenario
from poise.hardware import LastCheck, PlantLink

robot = poise.load_robot("biped20")
check = LastCheck(robot, kp_max=200.0, kd_max=20.0)  # [N m/rad], [N m s/rad]
squat = replace(load_scenario("squat"), robot="biped20", motions=(), checks=(), duration=0.1)

# %% stage_deployment deploy
from pathlib import Path
from tempfile import mkdtemp

from poise.apps.deployment import deploy, stage_deployment

link = PlantLink(poise.Plant(robot, poise.sim.PlantConfig(control_dt=0.002)))
stage = stage_deployment(squat, robot, link, check, ramp=0.0)  # it stands already
log = Path(mkdtemp()) / "log.mcap"
run = deploy(stage, log=log)  # damps the robot, whatever ends it
print(run.ok, run.ended_early)

# %% replay_states
from poise.apps.deployment import replay_states

again = replay_states(log, squat, robot, check)
time, joint, share = again.worst  # of a difference by the torque limit

# %% FaultPlan Faults
from poise.apps.deployment import FaultPlan, Faults

faults = FaultPlan(loss=0.01, jitter=0.002, dead=("left_knee",), begin=5.0)
channel = Faults(faults, robot.joint_names, period=0.002)

# %% simulate_g1 SimulatedRobot
from poise.apps.deployment import SimulatedRobot, simulate_g1


def simulate(g1):
    """Run a simulated G1 behind its DDS topics for ten seconds, in a process of its own."""
    plant = poise.sim.HoistedPlant(g1, poise.sim.PlantConfig(control_dt=0.002))
    SimulatedRobot(plant, simulate_g1(g1, tag="mine")).run(10.0)


# %% connect_g1 g1_gains
from poise.apps.deployment import connect_g1, g1_gains


def connect(g1):
    """Connect to that robot, and stage a scenario on it."""
    gains = g1_gains(g1)
    link = connect_g1(g1, gains.check, interface="lo", tag="mine")
    return stage_deployment(squat, g1, link, gains.check, gains.split, kp=gains.kp, kd=gains.kd)
