"""Random hierarchies for a standing humanoid, drawn again and again while it runs."""

import numpy as np

from poise.stack import (
    ComTask,
    FrameTask,
    JointTask,
    MomentumTask,
    PostureTask,
    Stack,
    SurfaceContact,
)

PERIOD = 0.1
"""Time between two hierarchies [s]."""


class Switching:
    """Tasks of a humanoid that go on, off, and to another level.

    The CoM is always on, on any of the first levels, and so is the
    posture, at the end. The pelvis may be off; then the posture holds it as well as it can.

    Args:
        robot: a humanoid.
        seed: of the draws.
    """

    def __init__(self, robot, seed):
        self.rng = np.random.default_rng(seed)
        self.com, self.posture = ComTask(kp=40.0), PostureTask()
        self.others = [
            FrameTask(robot.pelvis, "orientation"),
            FrameTask(robot.hands[0]),
            FrameTask(robot.hands[1], "position"),
            FrameTask(robot.torso, "orientation"),
            MomentumTask("angular_xy"),
            JointTask(robot.joint_names[-3:], name="last joints"),
        ]
        self.contacts = [SurfaceContact(sole) for sole in robot.soles]

    def stack(self):
        return Stack(self.contacts, self.levels())

    def levels(self):
        """The next hierarchy."""
        count = int(self.rng.integers(0, len(self.others) + 1))
        chosen = [self.others[i] for i in self.rng.permutation(len(self.others))[:count]]
        chosen.insert(int(self.rng.integers(0, min(len(chosen), 2) + 1)), self.com)
        levels = [[chosen[0]]]
        for task in chosen[1:]:
            if self.rng.random() < 0.6:
                levels.append([])
            levels[-1].append(task)
        return [*levels, [self.posture]]

    def move_targets(self, robot, hand_positions):
        """Hands are sent somewhere near, so that the hierarchies ask for something."""
        for task, position in zip(self.others[1:3], hand_positions, strict=True):
            task.set_target(position + self.rng.uniform(-0.1, 0.1, 3))
