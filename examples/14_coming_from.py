"""Coming from mink, pink, TSID or placo: the same squat by torques, or by joint velocities.

The programs of the others stand in `coming_from/`; all of them end in the same posture.
"""

import argparse
from pathlib import Path

import numpy as np

import poise

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--by", choices=["torque", "velocity"], default="torque")
options = parser.parse_args()

robot = poise.load_robot(Path(__file__).parent / "models" / "walker12.urdf")
com = poise.ComTask(kp=100.0)
stack = poise.Stack(
    contacts=[poise.SurfaceContact("left_sole"), poise.SurfaceContact("right_sole")],
    levels=[[com, poise.FrameTask("pelvis", axes="orientation")], [poise.PostureTask()]],
)
if options.by == "torque":
    controller = poise.WholeBodyController(robot, stack)
else:
    controller = poise.DifferentialIK(robot, stack, dt=0.001)
plant = poise.Plant(robot, poise.sim.PlantConfig(actuation=options.by))
start, way = plant.com, np.array([0.0, 0.02, -0.05])


def squat(state: poise.RobotState) -> None:
    """Down by 5 cm and 2 cm to the left within a second."""
    x = min(1.0, state.time)
    com.set_target(
        start + (3 * x**2 - 2 * x**3) * way,
        velocity=(6 * x - 6 * x**2) * way,
        acceleration=(6 - 12 * x) * (state.time < 1.0) * way,
    )


for tick in poise.rollout(plant, controller, squat, duration=1.5):
    assert tick.command.status.ok  # tick.command.torque or .velocity: to the robot

moved = 1e3 * (plant.com - start)
print(f"CoM moved by {moved[0]:.2f} {moved[1]:.2f} {moved[2]:.2f} mm")
for joint in ("left_hip_roll", "left_knee", "right_ankle_pitch"):
    print(f"{joint} {plant.state().q[7 + robot.joint_index(joint)]:.4f} rad")
