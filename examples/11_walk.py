"""Walk: footsteps for a robot and a stack of your own, in a loop of your own."""

import argparse

import numpy as np

import poise
from poise.locomotion import Gait, Stride, Walker, plan_footsteps

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="humanoid33", help="a name in `poise robots`, or a file")
parser.add_argument("--steps", type=int, default=8)
options = parser.parse_args()

robot = poise.load_robot(options.robot)
stack = poise.Stack(
    contacts=[poise.SurfaceContact(sole) for sole in robot.soles],
    levels=[
        [
            poise.ComTask(kp=40.0),
            poise.FrameTask("pelvis", axes="orientation"),
            *(poise.FrameTask(sole, kp=300.0) for sole in robot.soles),
        ],
        [poise.FrameTask("torso", axes="orientation", kp=50.0)],
        [poise.PostureTask()],
    ],
)
plan = plan_footsteps(
    robot,
    [Stride(steps=options.steps, length=0.15, turn=0.05)],
    Gait(step_time=0.8, crouch=0.02, settle_time=0.8),
)
walker = Walker(robot, stack, plan=plan)
controller = poise.WholeBodyController(robot, stack)
plant = poise.Plant(robot, poise.sim.PlantConfig(control_dt=0.002))

com = stack.task("com")
worst = 0.0
for _ in poise.rollout(plant, controller, walker, duration=plan.duration + 0.1):
    worst = max(worst, float(np.linalg.norm(com.error)))

print(f"walk {walker.status.value} after {walker.steps_made} steps in {plant.time:.1f} s")
print(f"CoM within {1e3 * worst:.1f} mm of its reference; now at {plant.com.round(2)} m")
