"""Stand: write a stack of tasks, step the controller, read how each task stands."""

import argparse

import poise

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="humanoid33", help="a name in `poise robots`, or a file")
parser.add_argument("--seconds", type=float, default=5.0)
options = parser.parse_args()

robot = poise.load_robot(options.robot)
stack = poise.Stack(
    contacts=[poise.SurfaceContact("left_sole"), poise.SurfaceContact("right_sole")],
    levels=[
        [poise.ComTask(kp=40.0), poise.FrameTask("pelvis", axes="orientation")],
        [poise.FrameTask("right_hand"), poise.MomentumTask(axes="angular_xy")],
        [poise.PostureTask()],
    ],
)
controller = poise.WholeBodyController(robot, stack)
plant = poise.sim.Plant(robot)
while plant.time < options.seconds:
    command = controller.step(plant.state())  # command.torque [N m], command.status, never raises
    plant.step(command)
print(controller.status())  # each task: level, error with unit, residual
