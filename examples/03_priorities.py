"""Priorities: one hand is asked for a point 5 cm out of reach, below the balance and then above it.

Where the hand stands below, the centre of mass does not notice. Where it stands above, the robot
leans after the hand: which of the two is right is the user's to say.
"""

import argparse

import numpy as np

import poise

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--seconds", type=float, default=4.0)
options = parser.parse_args()

robot = poise.load_robot("humanoid33")
AWAY = np.array([0.55, 0.0, 0.35])  # from where the hand is at first [m]


def reach_too_far(*, hand_first: bool) -> poise.WholeBodyController:
    """Runs both tasks in one order or the other; returns the controller as it was left."""
    com = poise.ComTask(kp=40.0)
    hand = poise.FrameTask("left_hand", axes="position", kp=40.0, name="hand")
    upright = poise.FrameTask("pelvis", axes="orientation", name="pelvis")
    straight = poise.FrameTask("torso", axes="orientation", name="torso")
    stack = poise.Stack(
        contacts=[poise.SurfaceContact(sole) for sole in robot.soles],
        levels=[
            [upright, straight],
            [hand] if hand_first else [com],
            [com] if hand_first else [hand],
            [poise.PostureTask()],
        ],
    )
    controller = poise.WholeBodyController(robot, stack)
    plant = poise.Plant(robot)
    start = controller.dynamics.frame(robot.frame_id("left_hand")).position.copy()

    def lead(state: poise.RobotState) -> None:
        share = min(1.0, state.time / 3.0)
        hand.set_target(start + share * share * (3.0 - 2.0 * share) * AWAY)

    for _ in poise.rollout(plant, controller, lead, duration=options.seconds):
        pass
    return controller


for hand_first in (False, True):
    print("hand above balance" if hand_first else "balance above hand")
    for task in reach_too_far(hand_first=hand_first).status().tasks[2:4]:
        print(f"  level {task.level}  {task.name:5} error {1e3 * task.error:5.1f} mm")
