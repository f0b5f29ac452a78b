"""A foot that is led farther than its leg reaches, and lowered there."""

import numpy as np
import pytest

pytest.importorskip("mujoco")

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, run_teleop
from poise.locomotion import Mode, OperatorSample, TrackedPose

UP, BELOW = 0.10, 0.03
"""How high the foot is led, and how far below the floor it is sent [m]."""

LIFTED, LED, LOWERED = (1.0, 1.6), (2.0, 2.8), (3.5, 4.3)
"""From when to when the device goes up, ahead and down [s]."""


class Far:
    """Leads the right foot up, far away, and down; or is lost before it goes down."""

    def __init__(self, teleoperator, far, lost):
        self._left, self._right = (anchor.copy() for anchor in teleoperator.estimator.anchors)
        self._far, self._lost = np.array([*far, 0.0]), lost

    def sample(self, time):
        if self._lost and time > LOWERED[0]:
            return None
        up, led, down = (
            float(np.interp(time, when, (0.0, 1.0))) for when in (LIFTED, LED, LOWERED)
        )
        height = [0.0, 0.0, UP * up * (1.0 - down) - BELOW * down]
        right = self._right + led * self._far + height
        return OperatorSample(time, (TrackedPose.of(self._left), TrackedPose.of(right)))


@pytest.mark.slow
@pytest.mark.parametrize("lost", [False, True])
def test_it_lands_nearer(get_robot, lost):
    """The leg of TALOS that stands folds less deep than the other one would need."""
    robot = get_robot("talos")
    run = run_teleop(
        robot, lambda t: Far(t, (0.6, -0.15), lost), TORQUE_TELEOP_PLANT, duration=7.0, seed=3
    )
    log = run.log
    assert not run.fell
    stands = log.mode == tuple(Mode).index(Mode.D)
    in_the_air = ~stands & (log.time > LED[0]) & (log.time < LOWERED[0])
    assert np.ptp(log.soles[in_the_air, 1, 0]) > 0.4
    assert stands[log.time > LOWERED[1] + 1.5].all()
    assert np.ptp(log.soles[log.time > 6.5, :, 2], axis=0).max() < 0.005
