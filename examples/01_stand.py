"""Stand: a stack of tasks, a controller, a leader, a rollout, and a report of it."""

import argparse
import math
from pathlib import Path

import poise

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="humanoid33", help="a name in `poise robots`, or a file")
parser.add_argument("--seconds", type=float, default=5.0)
parser.add_argument("--out", type=Path, default=Path("runs/stand"))
options = parser.parse_args()

robot = poise.load_robot(options.robot)
com = poise.ComTask(kp=40.0)
stack = poise.Stack(
    contacts=[poise.SurfaceContact("left_sole"), poise.SurfaceContact("right_sole")],
    levels=[
        [com, poise.FrameTask("pelvis", axes="orientation")],
        [poise.FrameTask("right_hand"), poise.MomentumTask(axes="angular_xy")],
        [poise.PostureTask()],
    ],
)
controller = poise.WholeBodyController(robot, stack)
plant, recorder = poise.Plant(robot), poise.Recorder()
height = plant.com[2]


def sway(state: poise.RobotState) -> None:
    """The leader: before each tick it sets what the stack asks for."""
    c, s = math.cos(2.0 * state.time), math.sin(2.0 * state.time)
    y, vy, ay = 0.015 * (1.0 - c), 0.03 * s, 0.06 * c
    com.set_target([0.0, y, height], velocity=[0.0, vy, 0.0], acceleration=[0.0, ay, 0.0])


for tick in poise.rollout(plant, controller, sway, [recorder], duration=options.seconds):
    assert tick.command.status.ok  # tick.command.torque [N m]; a controller never raises
print(controller.status())  # each task: level, error with unit, residual
print(poise.report(recorder.record, options.out, robot))
