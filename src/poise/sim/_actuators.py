"""Actuators: from a command to the controls of MuJoCo's motors, and through a physics step."""

import math
from collections.abc import Callable

import mujoco
import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled
from poise.control import Command
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.sim._config import PlantConfig

Joints = Float64[np.ndarray, " nj"]


class Actuators:
    """Turns commands into motor controls, in the actuation that the plant was made for."""

    # Position and velocity: each motor is a PD servo, tau = kp (q_d - q) + kd (v_d - v), saturated
    # at the torque limit, where a velocity command moves q_d along with it.

    def __init__(self, robot: Robot, config: PlantConfig) -> None:
        self._actuation = config.actuation
        self._dt = config.physics_dt
        self._lead = config.servo.damping / config.servo.stiffness
        self._stiffness = config.servo.stiffness * robot.tau_max
        self._damping = config.servo.damping * robot.tau_max
        self._q_min, self._q_max = robot.q_min, robot.q_max
        # Motors with drives of their own follow at the rate of these.
        bandwidth = config.torque_bandwidth if config.motors is None else None
        self._lags = bandwidth is not None
        # Part of what is missing to the torque that a motor makes up in a physics step
        self._follow = 1.0 if bandwidth is None else -math.expm1(-math.tau * bandwidth * self._dt)
        self._controls = np.zeros((config.substeps, robot.nj))
        self.constant = self._actuation != "velocity" and not self._lags  # in a control period
        self.rejected = 0
        self.reset(np.zeros(robot.nj), np.zeros(robot.nj))
        self.controls()  # what is compiled is compiled now

    def reset(self, joints: Joints, load: Joints) -> Joints:
        """Stand still where the joints are."""
        self._target = joints + load / self._stiffness
        # What the joints are commanded: torques, velocities or positions.
        self._command = self._target if self._actuation == "position" else np.zeros(len(joints))
        self._motor: Joints | None = None
        self.rejected = 0
        return load if self._actuation == "torque" else self._target

    def accept(
        self,
        command: Command | None,
        position: Float64[np.ndarray, "..."] | None,
        measure: Callable[[], RobotState],
    ) -> None:
        """Take the command for the next control period; `measure` returns the state before it."""
        offered = {
            "torque": None if command is None else command.torque,
            "velocity": None if command is None else command.velocity,
            "position": position,
        }
        size = len(self._target)
        value = offered.pop(self._actuation)
        if self._actuation == "position" and value is None:
            value = offered.pop("torque")
            if value is not None and value.shape == (size,):
                state = measure()
                q, v = state.q[-size:], state.v[-size:]
                # That torque, and kp (T / 2 + delay) more of damping, as q_d rests for a period T.
                value = q + (value + self._damping * v) / self._stiffness
        if value is None and any(v is not None for v in offered.values()):
            raise ConfigurationError(
                "the command is of another kind than the plant's actuation",
                got=[kind for kind, v in offered.items() if v is not None],
                wanted=self._actuation,
            )
        if value is not None and value.shape != (size,):
            raise ConfigurationError(
                f"the {self._actuation} command has the wrong shape",
                got=value.shape,
                wanted=f"({size},)",
            )
        if value is not None and np.isfinite(value.sum()):
            self._command = value.copy()
            return
        self.rejected += value is not None
        if self._actuation != "position":
            self._command = np.zeros(size)

    def controls(self) -> Float64[np.ndarray, "substeps nj"]:
        """Motor controls of a control period, a row a physics step; the next call overwrites it."""
        command = self._command
        if self.constant:
            self._controls[:] = command
        elif self._lags:
            if self._motor is None:  # The first command acts fully, as if the robot had stood.
                self._motor = command.copy()
            for control in self._controls:
                self._motor += self._follow * (command - self._motor)
                control[:] = self._motor
        else:
            limits = self._q_min, self._q_max
            _move(self._target, command, limits, (self._dt, self._lead), self._controls)
        return self._controls


@compiled
def _move(
    target: Joints,
    velocity: Joints,
    limits: tuple[Joints, Joints],
    times: tuple[float, float],
    controls: Float64[np.ndarray, "substeps nj"],
) -> None:
    """Move targets of servos along with a velocity, within limits, step by step."""
    (q_min, q_max), (dt, lead) = limits, times
    for step in range(len(controls)):
        for i in range(len(target)):
            target[i] = min(max(target[i] + dt * velocity[i], q_min[i]), q_max[i])
            controls[step, i] = target[i] + lead * velocity[i]


class ServoSteps:
    """Divides a physics step while a servo is at its torque limit."""

    # MuJoCo takes a servo's damping at the end of the step, so that a stiff one is stable; at the
    # limit of its torque it cannot, and a joint that is light beside the damping is thrown through
    # the band within which the servo is not at its limit, and back in the next step, for ever.
    # Parts are short enough where dt times the largest eigenvalue of D M^-1 is 1 or less, with the
    # servos' damping D [N m s/rad] and the joint space inertia M.

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model, self._dt = model, float(model.opt.timestep)
        joints = model.actuator_trnid[:, 0]
        self._at_q, self._at_v = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        self._stiffness, self._damping = model.actuator_gainprm[:, 0], -model.actuator_biasprm[:, 2]
        self._limit = np.where(model.actuator_forcelimited, model.actuator_forcerange[:, 1], np.inf)
        self.parts = self._parts(data)

    def advance(self, data: mujoco.MjData) -> None:
        """One physics step, in one or in `parts`."""
        error = data.ctrl - data.qpos[self._at_q]
        torque = self._stiffness * error - self._damping * data.qvel[self._at_v]
        if self.parts == 1 or not (np.abs(torque) >= self._limit).any():
            mujoco.mj_step(self._model, data)
            return
        self._model.opt.timestep = self._dt / self.parts
        mujoco.mj_step(self._model, data, self.parts)
        self._model.opt.timestep = self._dt

    def _parts(self, data: mujoco.MjData, most: int = 32) -> int:
        if not np.isfinite(self._damping).all():
            return 1
        mujoco.mj_forward(self._model, data)
        inertia = np.zeros((self._model.nv, self._model.nv))
        mujoco.mj_fullM(self._model, data, inertia)
        inverse = np.linalg.inv(inertia)[np.ix_(self._at_v, self._at_v)]
        root = np.sqrt(self._damping)
        fastest = float(np.linalg.eigvalsh(root[:, None] * inverse * root).max())
        return min(most, max(1, math.ceil(self._dt * fastest)))
