"""A device of your own leads the feet of a simulated robot, on a plant that is not the easiest."""

import argparse
from dataclasses import replace

import numpy as np

import poise
from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, PoorLink, run_teleop, terrain_blocks
from poise.locomotion import OperatorSample, TrackedPose
from poise.sim import SensorConfig

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="biped20", help="a biped with legs of six joints")
parser.add_argument("--seconds", type=float, default=6.0)
parser.add_argument("--seed", type=int, default=3, help="of noise, bumps and link")
options = parser.parse_args()


class Pedals:
    """Two pedals: how far each is pressed lifts its foot by up to 8 cm."""

    def __init__(self, teleoperator):
        self.left, self.right = teleoperator.estimator.anchors.copy()
        self.newest = None

    def received(self, stamp, left, right):
        """Take a stamp of the pedals' clock [s], and 0 to 1 each, from their thread."""
        self.newest = (stamp, left, right)

    def sample(self, time):  # noqa: ARG002
        """Return the newest sample, or None for nothing new."""
        newest, self.newest = self.newest, None
        if newest is None:
            return None
        stamp, left, right = newest
        up = np.array([0.0, 0.0, 0.08])
        feet = TrackedPose.of(self.left + left * up), TrackedPose.of(self.right + right * up)
        return OperatorSample(stamp, feet)


class PressedPedals(Pedals):
    """A script in place of the thread: the right pedal is pressed for two seconds."""

    def sample(self, time):
        """Press, and return the sample."""
        self.received(time, 0.0, float(0.8 < time < 2.8))
        return super().sample(time)


robot = poise.load_robot(options.robot)
plant = replace(
    TORQUE_TELEOP_PLANT,
    sensors=replace(SensorConfig.typical(), base_orientation_error=(0.01, 0.0), delay=0.01),
    blocks=terrain_blocks("bumps", robot, seed=options.seed),
    floor_slope=(0.03, 0.0),
    friction=0.6,
    self_contact=True,
)


def far_away(teleoperator):
    """Return the device at the end of a poor link."""
    link = {"latency": 0.1, "loss": 0.05, "jitter": 0.05}
    return PoorLink(PressedPedals(teleoperator), seed=options.seed, **link)


push = (500, (0.2 * robot.mass / 0.1, 0.0, 0.0), 0.1)  # at 1 s, by 0.2 m/s, within 0.1 s
run = run_teleop(robot, far_away, plant, duration=options.seconds, seed=options.seed, pushes=[push])
assert run.teleoperator.device_error is None
print(f"fell: {run.fell}; the torso leaned by at most {run.log.tilt.max():.2f} rad")
print("steps ended:", [text for _, text in run.record.notes("step_end")])
