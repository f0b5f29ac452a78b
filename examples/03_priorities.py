"""Priorities: a hand is asked for a point out of reach, below the balance and then above it.

Where the hand stands below, the centre of mass does not notice. Where it stands above, the robot
leans after the hand as far as its contacts allow: what is right is the user's to say.
"""

import argparse

import numpy as np

import poise

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="humanoid33", help="a name in `poise robots`, or a file")
parser.add_argument("--seconds", type=float, default=2.5)
options = parser.parse_args()

robot = poise.load_robot(options.robot)


def reach_too_far(*, hand_first: bool) -> poise.WholeBodyController:
    """Runs both tasks in one order or the other; returns the controller as it was left."""
    com = poise.ComTask(kp=40.0)
    hand = poise.FrameTask("left_hand", axes="position", kp=20.0, name="hand")
    upright = poise.FrameTask("pelvis", axes="orientation", name="pelvis")
    stack = poise.Stack(
        contacts=[poise.SurfaceContact(sole) for sole in robot.soles],
        levels=[
            [upright],
            [hand] if hand_first else [com],
            [com] if hand_first else [hand],
            [poise.PostureTask()],
        ],
        torque_limit=poise.TorqueLimit(scale=0.8),
    )
    controller = poise.WholeBodyController(robot, stack)
    start = controller.dynamics.frame(robot.frame_id("left_hand")).position
    height = float(controller.dynamics.com[2])
    plant = poise.sim.Plant(robot)
    goal = start + height * np.array([0.9, 0.0, 0.5])
    while plant.time < options.seconds and not plant.fallen:
        share = min(1.0, plant.time / 1.5)
        hand.set_target(start + share * (goal - start))
        plant.step(controller.step(plant.state()))
    return controller


for hand_first in (False, True):
    print("hand above balance" if hand_first else "balance above hand")
    for task in reach_too_far(hand_first=hand_first).status().tasks[1:3]:
        print(f"  level {task.level}  {task.name:5} error {task.error:.4f} {task.unit}")
