"""An operator in a hurry: the other foot is lifted the moment that both stand."""

import pytest

pytest.importorskip("mujoco")

from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, run_teleop
from poise.locomotion import Mode, OperatorSample, TrackedPose

UP, FORWARD, DOWN = 0.10, 0.08, 0.07
"""How high a foot is held, how far ahead it is set, and how far below the floor it is sent [m]."""

STICK, LET_GO = 0.25, 0.15
"""Speeds of a device forward and down [m/s]."""


class Eager:
    """Lifts a foot, leads it ahead and lets go, and does so with the other one at once."""

    def __init__(self, teleoperator, phase, steps):
        self._teleoperator, self._begin, self.steps = teleoperator, 0.5 + phase, steps
        self._dt, self._foot, self._ahead, self._was = teleoperator.parameters.dt, 1, 0.0, Mode.D
        self._places = [anchor.copy() for anchor in teleoperator.estimator.anchors]

    def sample(self, time):
        mode, foot, estimator = self._teleoperator.mode, self._foot, self._teleoperator.estimator
        if self._was.single and mode is Mode.D:
            self.steps, self._foot, self._ahead = self.steps - 1, 1 - foot, 0.0
        self._was, foot = mode, self._foot
        for k in (0, 1):
            self._places[k] = estimator.anchors[k].copy()
        if time > self._begin and self.steps > 0:
            self._lead(foot, estimator)
        left, right = (place.copy() for place in self._places)
        return OperatorSample(time, (TrackedPose.of(left), TrackedPose.of(right)))

    def _lead(self, foot, estimator):
        place, anchor = self._places[foot], estimator.anchors[foot]
        if not self._was.single:
            place[2] = anchor[2] + UP
            return
        self._ahead += self._dt * STICK
        place[0] = anchor[0] + min(self._ahead, FORWARD)
        over = max(0.0, self._ahead - FORWARD - STICK * 0.3) / STICK
        place[2] = max(anchor[2] + UP - LET_GO * over, anchor[2] - DOWN)


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "phase"), [("biped20", 0.0), ("g1", 0.0), ("g1", 0.013)])
def test_it_steps_again_as_soon_as_both_feet_stand(get_robot, robot, phase):
    devices = []

    def device(teleoperator):
        devices.append(Eager(teleoperator, phase, steps=3))
        return devices[0]

    plant = VELOCITY_TELEOP_PLANT.with_noise()
    run = run_teleop(get_robot(robot), device, plant, duration=12.0, seed=3)
    assert not run.fell
    assert devices[0].steps == 0
    # Both feet carry again, and nothing bounces.
    assert run.log.loads[-40:].sum(axis=1).max() < 1.5 * run.plant.robot.weight
