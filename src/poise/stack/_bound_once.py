"""`BoundOnce`: bases of tasks, contacts and limits, which serve one robot."""

from typing import Any

from poise._copies import Copied
from poise.errors import ConfigurationError
from poise.robots import Robot


class BoundOnce(Copied):
    """A task, contact or limit, which serves one robot.

    Attributes:
        name: what reports call it.
    """

    name: str
    _robot: Robot | None = None

    def bind(self, robot: Robot) -> None:
        """Resolve names on a robot and allocate; controllers call it before the first tick.

        Args:
            robot: the robot that it serves.

        Raises:
            UnknownNameError: a frame or joint that the robot does not have.
            ConfigurationError: facts are missing, numbers do not fit the robot, or another robot is
                served already.
            TargetError: a target, acceleration or velocity given before that has the wrong length.
        """
        if self._robot is robot:
            return
        if self._robot is not None:
            raise ConfigurationError(
                f"{self._title} already serves another robot",
                got=robot.name,
                wanted=f"robot {self._robot.name!r}, or one of its own",
            )
        self._bind(robot)
        self._robot = robot
        self.share_memory()

    def is_bound_to(self, robot: Robot) -> bool:
        """Return True where it serves that robot.

        Args:
            robot: the robot.
        """
        return self._robot is robot

    @property
    def robot(self) -> Robot:
        """The robot that is served.

        Raises:
            ConfigurationError: none is served yet.
        """
        if self._robot is None:
            raise ConfigurationError(
                f"{self._title} serves no robot yet",
                wanted="a controller made with it, or a call of bind(robot)",
            )
        return self._robot

    @property
    def _title(self) -> str:
        """Kind and name, for messages."""
        return f"the {self.name}"

    def _bind(self, robot: Robot) -> None:
        """Resolve names and allocate."""
        raise NotImplementedError


class Limit(BoundOnce):
    """A limit, whose public attributes are for reading: another one makes another controller."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not name.startswith("_"):
            raise AttributeError(
                f"{name} of the {self.name} is for reading: make another limit, and a controller"
            )
        vars(self)[name] = value

    def _set(self, **values: Any) -> None:
        """Set public attributes."""
        vars(self).update(values)
