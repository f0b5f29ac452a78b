import numpy as np

import poise

robot = poise.load_robot("biped20")

# %% run_teleop TORQUE_TELEOP_PLANT BadOperator TeleopRun TeleopLog
from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, BadOperator, run_teleop

run = run_teleop(robot, lambda t: BadOperator(t, seed=1), TORQUE_TELEOP_PLANT, duration=0.1)
print(run.fell, run.log.tilt.max())  # a TeleopRun and its TeleopLog; [rad]

# %% replay_teleop
from poise.apps.teleoperation import replay_teleop

again = replay_teleop(run.record)  # or a recording's file
assert (again.log.command == run.log.command).all()

# %% SCRIPTS Script VELOCITY_TELEOP_PLANT
from poise.apps.teleoperation import SCRIPTS, VELOCITY_TELEOP_PLANT

script = SCRIPTS["over_an_obstacle"](robot)  # a Script
run = run_teleop(robot, script.device, VELOCITY_TELEOP_PLANT, duration=0.1)  # [s]

# %% PoorLink
from poise.apps.teleoperation import PoorLink

link = PoorLink(BadOperator(run.teleoperator, seed=1), latency=0.1, loss=0.05, seed=2)  # [s]

# %% HapticDriver HapticFeet SimulatedArm HapticArm
from poise.apps.teleoperation import HapticDriver, HapticFeet, SimulatedArm

arms = [SimulatedArm(lambda time: (np.zeros(3), time > 0.1)) for _ in range(2)]  # HapticArm: [m]
driver = HapticDriver(*arms, force_max=6.0)  # [N]
run = run_teleop(robot, lambda teleoperator: HapticFeet(driver, teleoperator), duration=0.1)
