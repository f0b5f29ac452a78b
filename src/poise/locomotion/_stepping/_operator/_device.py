"""`Device`: where samples come from. `DeviceReader`: reads one that may fail."""

from typing import Protocol, runtime_checkable

from poise.locomotion._stepping._operator._faults import FaultLog
from poise.locomotion._stepping._operator._samples import DeviceSample, checked_sample


@runtime_checkable
class Device(Protocol):
    """Anything that says where the operator holds the devices of feet and hands."""

    def sample(self, time: float) -> DeviceSample | None:
        """What came since the last tick.

        Args:
            time: of the robot [s].

        Returns:
            The newest sample, None for nothing new.
        """
        ...


class DeviceReader:
    """Reads a device that may fail, which is no reason to let the robot fall.

    Attributes:
        error: what the device raised when it was read last, or what was no place or orientation in
            its sample; None if all was well.
    """

    def __init__(self) -> None:
        self.error: Exception | None = None
        self._faults = FaultLog()

    def read(self, device: Device | None, time: float) -> DeviceSample | None:
        """What a device says; nothing where it fails.

        Args:
            device: None for none.
            time: of the robot [s].
        """
        if device is None:
            return None
        try:
            sample, self.error = checked_sample(device.sample(time))
        except Exception as error:
            self.error = error
            self._faults.say(error, "the device failed, and counts as silent")
            return None
        if self.error is not None:
            self._faults.say(self.error, "part of what the device gives is ignored")
        return sample

    def reset(self) -> None:
        """Forgets what went wrong, and that it has been said."""
        self.error = None
        self._faults.clear()
