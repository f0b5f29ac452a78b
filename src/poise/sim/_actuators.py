"""Actuators: from a command to the controls of MuJoCo's motors."""

import math
from collections.abc import Callable

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled
from poise.control import Command
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.sim._config import PlantConfig


class Actuators:
    """Turns commands into motor controls, in the actuation that the plant was made for.

    Torque: the control is the torque, or follows it with the plant's bandwidth f, in a physics step
    by the fraction 1 - exp(-2 pi f dt) of what is missing; the first command after a reset is there
    at once, as if the robot had stood before. Position and velocity: each motor is a PD servo,
    tau = kp (q_d - q) + kd (v_d - v), saturated at the torque limit, where a velocity command moves
    q_d along with it, so that no position error builds up. A servo of positions, with v_d = 0, is
    sent a torque as q_d = q + (tau + kd v) / kp at the joints' measured q and v: that torque, and
    kp (T / 2 + delay) more of damping, as q_d rests for a control period T.
    """

    def __init__(self, robot: Robot, config: PlantConfig) -> None:
        self._actuation = config.actuation
        self._dt = config.physics_dt
        self._lead = config.servo.damping / config.servo.stiffness
        self._stiffness = config.servo.stiffness * robot.tau_max
        self._damping = config.servo.damping * robot.tau_max
        self._nj = robot.nj
        self._q_min, self._q_max = robot.q_min, robot.q_max
        bandwidth = config.torque_bandwidth
        self._follow = 1.0 if bandwidth is None else -math.expm1(-math.tau * bandwidth * self._dt)
        self._lags = bandwidth is not None
        self._torque = np.zeros(robot.nj)
        self._motor: Float64[np.ndarray, " nj"] | None = None
        self._target = np.zeros(robot.nj)
        self._velocity = np.zeros(robot.nj)
        self._controls = np.zeros((config.substeps, robot.nj))
        self.rejected = 0
        if self._actuation == "velocity":
            self.controls()  # what is compiled is compiled now

    @property
    def constant(self) -> bool:
        """Whether the control stays the same through a control period."""
        return self._actuation != "velocity" and not self._lags

    def reset(
        self, joints: Float64[np.ndarray, " nj"], load: Float64[np.ndarray, " nj"]
    ) -> Float64[np.ndarray, " nj"]:
        """Stand still where the joints are."""
        self._torque[:] = 0.0
        self._motor = None
        self._target[:] = joints + load / self._stiffness
        self._velocity[:] = 0.0
        self.rejected = 0
        return load if self._actuation == "torque" else self._target

    def accept(
        self,
        command: Command | None,
        position: Float64[np.ndarray, "..."] | None,
        measure: Callable[[], RobotState],
    ) -> None:
        """Take the command for the next control period; `measure` returns the state before it.

        Values that are not finite are taken as zero torque, zero velocity or the last position, and
        counted in `rejected`: nothing raises inside the loop on account of a value.
        """
        offered = {
            "torque": None if command is None else command.torque,
            "velocity": None if command is None else command.velocity,
            "position": position,
        }
        value = offered.pop(self._actuation)
        if self._actuation == "position" and value is None:
            value = self._pull(offered.pop("torque"), measure)
        if value is None and any(v is not None for v in offered.values()):
            raise ConfigurationError(
                "the command is of another kind than the plant's actuation",
                got=[kind for kind, v in offered.items() if v is not None],
                wanted=self._actuation,
            )
        taken = self._checked(value)
        if self._actuation == "torque":
            self._torque = np.zeros(self._nj) if taken is None else taken
        elif self._actuation == "velocity":
            self._velocity = np.zeros(self._nj) if taken is None else taken
        elif taken is not None:
            self._target = taken

    def controls(self) -> Float64[np.ndarray, "substeps nj"]:
        """Motor controls of a control period, a row a physics step; the next call overwrites it."""
        if self._actuation == "velocity":
            limits = self._q_min, self._q_max
            _move(self._target, self._velocity, limits, (self._dt, self._lead), self._controls)
        elif self._lags:
            for step in self._controls:
                step[:] = self._followed()
        else:
            constant = self._torque if self._actuation == "torque" else self._target
            self._controls[:] = constant
        return self._controls

    def _pull(
        self, torque: Float64[np.ndarray, "..."] | None, measure: Callable[[], RobotState]
    ) -> Float64[np.ndarray, "..."] | None:
        """Return the positions at which servos of positions pull with a torque."""
        if torque is None or torque.shape != (self._nj,):
            return torque
        state = measure()
        q, v = state.q[-self._nj :], state.v[-self._nj :]
        return q + (torque + self._damping * v) / self._stiffness

    def _followed(self) -> Float64[np.ndarray, " nj"]:
        """What motors of a limited bandwidth give in the next physics step."""
        if self._motor is None:
            self._motor = self._torque.copy()
        self._motor += self._follow * (self._torque - self._motor)
        return self._motor

    def _checked(
        self, value: Float64[np.ndarray, "..."] | None
    ) -> Float64[np.ndarray, " nj"] | None:
        if value is None:
            return None
        if value.shape != (self._nj,):
            raise ConfigurationError(
                f"the {self._actuation} command has the wrong shape",
                got=value.shape,
                wanted=f"({self._nj},)",
            )
        if not np.isfinite(value.sum()):
            self.rejected += 1
            return None
        return value.copy()


@compiled
def _move(
    target: Float64[np.ndarray, " nj"],
    velocity: Float64[np.ndarray, " nj"],
    limits: tuple[Float64[np.ndarray, " nj"], Float64[np.ndarray, " nj"]],
    times: tuple[float, float],
    controls: Float64[np.ndarray, "substeps nj"],
) -> None:
    """Moves targets of servos along with a velocity, within limits, step by step."""
    (q_min, q_max), (dt, lead) = limits, times
    for step in range(len(controls)):
        for i in range(len(target)):
            target[i] = min(max(target[i] + dt * velocity[i], q_min[i]), q_max[i])
            controls[step, i] = target[i] + lead * velocity[i]
