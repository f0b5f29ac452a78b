"""Drive: a humanoid walks with velocities that are given while it walks, and is pushed."""

import argparse

import poise
from poise.locomotion import Walker, walking_stack

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="humanoid33", help="a name in `poise robots`, or a file")
parser.add_argument("--seconds", type=float, default=7.0)
options = parser.parse_args()

robot = poise.load_robot(options.robot)
stack = walking_stack(robot)
walker = Walker(robot, stack)
controller = poise.WholeBodyController(robot, stack)
plant = poise.Plant(robot, poise.sim.PlantConfig(control_dt=0.002))

commands = {0.5: (0.3, 0.0, 0.0), 3.0: (0.2, 0.0, 0.4), 5.0: (0.0, 0.0, 0.0)}
plant.push("torso", (0.0, 1.5 * robot.mass, 0.0), 0.1, 2.0)
for tick in poise.rollout(plant, controller, walker, duration=options.seconds):
    for time in [t for t in commands if t <= tick.time]:
        velocity = commands.pop(time)
        walker.set_velocity(*velocity)
        print(f"{time:.1f} s: asked for {velocity}; {walker.notice or 'nothing cut'}")

x, y, _ = plant.com
print(f"{walker.status.value} after {walker.steps_made} steps at ({x:.2f}, {y:.2f}) m")
