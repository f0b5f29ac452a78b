"""Reach: a hand follows a target that moves on a circle, while the centre of mass stays."""

import argparse
import math

import numpy as np

import poise

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="humanoid33", help="a name in `poise robots`, or a file")
parser.add_argument("--seconds", type=float, default=6.0)
options = parser.parse_args()

RADIUS, PERIOD = 0.08, 3.0  # [m], [s]

robot = poise.load_robot(options.robot)
hand = poise.FrameTask("right_hand", axes="position", kp=100.0, name="hand")
com = poise.ComTask(kp=60.0)
stack = poise.Stack(
    contacts=[poise.SurfaceContact(sole) for sole in robot.soles],
    levels=[
        [com, poise.FrameTask("pelvis", axes="orientation")],
        [hand],
        [poise.PostureTask()],
    ],
)
controller = poise.WholeBodyController(robot, stack)
plant = poise.Plant(robot)

start = controller.dynamics.frame(robot.frame_id("right_hand")).position.copy()
rate = 2.0 * math.pi / PERIOD  # [rad/s]
worst = {"hand": 0.0, "com": 0.0}


def lead(state: poise.RobotState) -> None:
    """Sets where the hand should be, and how fast it should go there."""
    # The angle along the circle; it starts, and comes to rest once a turn, without a jump.
    phase = rate * state.time
    angle = phase - math.sin(phase)
    speed = rate * (1.0 - math.cos(phase))
    change = rate**2 * math.sin(phase)
    outward = np.array([0.0, math.sin(angle), -math.cos(angle)])
    along = np.array([0.0, math.cos(angle), math.sin(angle)])
    # Velocity and acceleration of the target go ahead of the feedback, linear then angular.
    hand.set_target(
        position=start + RADIUS * (outward - [0.0, 0.0, -1.0]),
        velocity=[*(RADIUS * speed * along), 0.0, 0.0, 0.0],
        acceleration=[*(RADIUS * (change * along - speed**2 * outward)), 0.0, 0.0, 0.0],
    )


for _ in poise.rollout(plant, controller, lead, duration=options.seconds):
    worst["hand"] = max(worst["hand"], float(np.linalg.norm(hand.error)))
    worst["com"] = max(worst["com"], float(np.linalg.norm(com.error)))
print(f"largest error: hand {1e3 * worst['hand']:.2f} mm, CoM {1e3 * worst['com']:.2f} mm")
