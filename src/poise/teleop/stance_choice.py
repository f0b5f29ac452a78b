"""`StanceChoice`: which foot is taken to be at rest, and where the feet count as standing."""

from poise.teleop.estimator import StanceEstimator
from poise.teleop.modes import Mode
from poise.teleop.parameters import TeleopParameters
from poise.teleop.rules import Rules
from poise.teleop.zmp import ZmpSensor

_STANCE_SHARE = 1.2
"""In double support a foot becomes the stance that carries this many times the other's load."""


class StanceChoice:
    """Keeps the estimator's stance and the feet's places up to date.

    Args:
        estimator: whose.
        sensor: says what the feet carry.
        parameters: loads and speeds.
        rules: departures from the paper.
        weight: of the robot [N].
    """

    def __init__(
        self,
        estimator: StanceEstimator,
        sensor: ZmpSensor,
        parameters: TeleopParameters,
        rules: Rules,
        weight: float,
    ) -> None:
        self._estimator, self._sensor = estimator, sensor
        self._parameters, self._rules = parameters, rules
        self._least_load = parameters.land_load * weight
        self._pressing = False

    def begin(self, before: Mode, mode: Mode) -> None:
        """A mode has begun: a foot that has landed has a new place, one that is lifted no weight.

        Args:
            before: the mode that has ended.
            mode: the one that has begun.
        """
        estimator = self._estimator
        if mode is Mode.D and before.single:
            estimator.put_down(1 - estimator.stance)
        if mode.single or not self._rules.loaded_stance:
            estimator.stand_on(mode.support or 0)

    def follow(self, mode: Mode) -> None:
        """Each tick with both feet on the ground: the one that carries more is the stance.

        Args:
            mode: now.
        """
        if mode.single:
            return
        estimator, loads = self._estimator, self._sensor.loads
        stance = estimator.stance
        if self._rules.loaded_stance and loads[1 - stance] > _STANCE_SHARE * loads[stance]:
            estimator.stand_on(1 - stance)
        if self._rules.press_down:
            self._press(1 - estimator.stance)

    def _press(self, foot: int) -> None:
        """Sends a foot down until it carries something.

        It is taken to stand where it is as soon as it carries: pressed further it would tip the
        robot over the edge of the sole at rest.
        """
        p = self._parameters
        anchor, height = self._estimator.anchors[foot], float(self._estimator.sole(foot)[2])
        if self._sensor.loads[foot] < self._least_load:
            lower = min(float(anchor[2]), height) - p.dt * p.press_speed
            anchor[2] = max(lower, height - p.press_speed / p.k_v)
            self._pressing = True
        elif self._pressing:
            anchor[2], self._pressing = height, False
