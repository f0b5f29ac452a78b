"""A task of your own: the distance between both hands, as one row, without touching Poise."""

import argparse

import numpy as np

import poise
from poise import Task

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="humanoid33", help="a name in `poise robots`, or a file")
parser.add_argument("--seconds", type=float, default=2.0)
options = parser.parse_args()


class DistanceTask(Task):
    """The distance between two frames follows a target: one row."""

    def __init__(self, one: str, other: str, *, distance: float, kp: float = 100.0) -> None:
        super().__init__(f"distance {one} {other}", kp=kp, kd=None, weight=1.0)
        self._frames, self._distance = (one, other), distance

    def _resolve(self, robot: poise.Robot) -> int:
        self._ids = [robot.frame_id(name) for name in self._frames]
        return 1

    def _evaluate(self, dynamics: poise.Dynamics) -> np.ndarray:
        one, other = (dynamics.frame(i) for i in self._ids)
        offset = one.position - other.position
        slip = one.velocity[:3] - other.velocity[:3]
        length = float(np.linalg.norm(offset))
        along = offset / length
        rate = along @ slip
        self.jacobian = (along @ (one.jacobian[:3] - other.jacobian[:3]))[None, :]
        # The second derivative of a length: what turns across it pulls it longer.
        across = (slip @ slip - rate**2) / length
        self.drift = np.array([along @ (one.bias[:3] - other.bias[:3]) + across])
        self.error = np.array([self._distance - length])
        self.error_rate = np.array([-rate])
        return np.zeros(1)


robot = poise.load_robot(options.robot)
stack = poise.Stack(
    contacts=[poise.SurfaceContact(sole) for sole in robot.soles],
    levels=[
        [poise.ComTask(), poise.FrameTask("pelvis", axes="orientation")],
        [DistanceTask(*robot.hands, distance=0.3)],
        [poise.PostureTask()],
    ],
)
controller = poise.WholeBodyController(robot, stack)
plant = poise.Plant(robot)
for _ in poise.rollout(plant, controller, duration=options.seconds):
    pass
hands = [controller.dynamics.frame(robot.frame_id(name)).position for name in robot.hands]
print(f"hands {1e3 * np.linalg.norm(hands[0] - hands[1]):.1f} mm apart")
