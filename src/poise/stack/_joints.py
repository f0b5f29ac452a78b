"""`JointTask` and `PostureTask`: joints follow targets."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers
from poise._compiled import part
from poise.dynamics import Dynamics, StateNumbers
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack._axes import checked_target
from poise.stack._tables import GAINS, Line, StackNumbers
from poise.stack._targets import VectorTarget
from poise.stack._task import ShippedTask, write_measured


class JointTask(ShippedTask[VectorTarget]):
    """Named joints follow target angles: their accelerations equal the reference.

    Args:
        joints: names of actuated joints, in the order of the targets; all joints when None.
        kp: stiffness, one number or one a joint [1/s^2].
        kd: damping [1/s]; critical when None.
        weight: weight of its rows in their level.
        speed: largest speed that feedback asks for, one number or one a joint [rad/s]; the
            joints' own limits when None.
        name: what reports call it.
    """

    def __init__(
        self,
        joints: Sequence[str] | None = None,
        *,
        kp: Numbers = 50.0,
        kd: Numbers | None = None,
        weight: Numbers = 1.0,
        speed: Numbers | None = None,
        name: str = "joints",
    ) -> None:
        super().__init__(name, kp=kp, kd=kd, weight=weight, speed=speed)
        self.unit = "rad"
        if isinstance(joints, str):
            raise ConfigurationError(
                f"joints of task {name!r} are one text", got=joints, wanted=f"a list: [{joints!r}]"
            )
        if joints is not None and len(set(joints)) != len(joints):
            raise ConfigurationError(f"task {name!r} names a joint twice", got=list(joints))
        if joints is not None and not joints:
            raise ConfigurationError(f"task {name!r} names no joint", got=[], wanted="joint names")
        self.joints = None if joints is None else tuple(joints)
        self._target = VectorTarget(0, f"task {name!r}")

    def set_target(
        self,
        position: Numbers,
        velocity: Numbers | None = None,
        acceleration: Numbers | None = None,
    ) -> None:
        """Set where the joints should be.

        Args:
            position: one a joint [rad].
            velocity: [rad/s], zero when None.
            acceleration: [rad/s^2], zero when None.

        Raises:
            TargetError: wrong shape, NaN or infinite.
            ConfigurationError: the task serves no robot yet, so their number is unknown.
        """
        _ = self.robot  # without one the number of joints is unknown, and this says so
        self._target.set(position, velocity, acceleration)

    @property
    def target_position(self) -> Float64[np.ndarray, " m"] | None:
        """Target angles [rad]; None until they are set or taken from the robot."""
        return None if self._robot is None else self._target.position

    def hold(self, dynamics: Dynamics) -> None:
        """Take a target that was never set from the robot.

        Args:
            dynamics: the state, up to date.
        """
        robot = self.robot
        self._target.hold(dynamics.state.q[self.chosen + robot.nq - robot.nv])

    def write_constants(self, J: Float64[np.ndarray, "m nv"]) -> None:
        """Write its coefficients: one where a joint is its own.

        Args:
            J: its rows, zero.
        """
        J[np.arange(self.dim), self.chosen] = 1.0

    @property
    def blocks(self) -> tuple[int, ...]:
        """Every joint by itself."""
        return (1,) * self.dim

    def _resolve(self, robot: Robot) -> int:
        names = robot.joint_names if self.joints is None else self.joints
        index = np.array([robot.joint_index(name) for name in names], dtype=np.int64)
        self._target = VectorTarget(len(index), f"task {self.name!r}")
        self.chosen = index + robot.base_dofs
        return len(index)

    def _usual_speed(self, robot: Robot) -> Numbers:
        return robot.v_max[self.chosen - robot.base_dofs]


class PostureTask(JointTask):
    """All joints towards a posture: what the robot does with the freedom that is left.

    Args:
        posture: joint angles [rad]; the robot's home posture when None.
        kp: stiffness, one number or one a joint [1/s^2].
        kd: damping [1/s]; critical when None.
        weight: weight of its rows in their level.
        speed: largest speed that feedback asks for, one number or one a joint [rad/s]; the
            joints' own limits when None.
        name: what reports call it.
    """

    def __init__(
        self,
        posture: Numbers | None = None,
        *,
        kp: Numbers = 25.0,
        kd: Numbers | None = None,
        weight: Numbers = 1.0,
        speed: Numbers | None = None,
        name: str = "posture",
    ) -> None:
        super().__init__(None, kp=kp, kd=kd, weight=weight, speed=speed, name=name)
        self._posture: Float64[np.ndarray, " n"] | None = None
        if posture is not None:
            what = f"target of task {name!r}"
            self._posture = checked_target(posture, np.size(posture), what).copy()

    def _resolve(self, robot: Robot) -> int:
        dim = super()._resolve(robot)
        home = robot.q_home[robot.nq - robot.nj :]
        self._target.set(home if self._posture is None else self._posture)
        return dim


@part
def joint_rows(state: StateNumbers, assembly: StackNumbers, line: Line) -> None:
    """Single joints, whose coefficients are constant and stand there already."""
    q, v, owners, m = state.q, state.v, assembly.owners, line.dim
    parameters = owners.parameters
    for i in range(m):
        joint, target = int(owners.chosen[line.chosen + i]), line.start + GAINS * m + i
        error, velocity = parameters[target] - q[joint + len(q) - len(v)], parameters[target + m]
        ahead = parameters[target + 2 * m]
        write_measured(assembly, line, i, error, 1.0, velocity, v[joint], ahead, 0.0)
