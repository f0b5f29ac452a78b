"""Detectors of lifted devices and landed feet."""

from poise.teleop.parameters import TeleopParameters

_STUCK_TIME = 0.3
"""A foot that still carries so long after it should have been lifted stays on the ground [s]."""


class LiftDetector:
    """Whether a device has just been lifted: a rising edge with hysteresis.

    Args:
        parameters: lift and lower heights.
    """

    def __init__(self, parameters: TeleopParameters) -> None:
        self._lift, self._lower = parameters.lift_height, parameters.lower_height
        # A device that is up at the start has to come down first.
        self._up = True

    def update(self, height: float) -> bool:
        """Takes the device's height above its foot's place on the ground [m]."""
        if height < self._lower:
            self._up = False
            return False
        if height > self._lift and not self._up:
            self._up = True
            return True
        return False

    def is_low(self, height: float) -> bool:
        """Whether a height counts as lowered [m]."""
        return height < self._lower

    def reset(self, height: float) -> None:
        """Starts over: a device that is up now has to come down first."""
        self._up = height > self._lower


class LandingDetector:
    """Whether the foot in the air has landed.

    Args:
        parameters: loads and time.
        weight: of the robot [N].
        arm: whether the foot has to be without load for a while first.

    Attributes:
        load: from which on a foot counts as on the ground [N].
        armed: whether the foot has left the ground.
    """

    def __init__(self, parameters: TeleopParameters, weight: float, *, arm: bool) -> None:
        self.load = parameters.land_load * weight
        self._unload = parameters.unload_load * weight
        self._time, self._dt, self._arm = parameters.unload_time, parameters.dt, arm
        self.reset()

    def reset(self) -> None:
        """The foot is about to leave the ground."""
        self._unloaded, self._since, self.armed = 0.0, 0.0, not self._arm

    def update(self, load: float, *, lifting: bool) -> bool:
        """Takes one tick.

        Args:
            load: on the foot [N].
            lifting: whether the foot is being sent upwards. A foot that scrapes over the ground
                while it is lifted has not landed.
        """
        self._since += self._dt
        if not self.armed:
            self._unloaded = self._unloaded + self._dt if load < self._unload else 0.0
            self.armed = self._unloaded >= self._time
            return load > self.load and self._since > _STUCK_TIME
        return load > self.load and not (self._arm and lifting)
