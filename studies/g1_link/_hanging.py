"""`HangingRobot`: a simulated robot limp in a hoist, and a person who moves it by hand."""

import math
from typing import Any

import numpy as np
import pinocchio as pin

import poise
from poise.hardware import LastCheck, MotorCommand, MotorState, PlantLink
from poise.sim import PlantConfig

SHOULDERS = "left_shoulder_pitch_link", "right_shoulder_pitch_link"
"""Links beside which two straps hold the torso."""

SAG = 0.05
"""Stretch of the straps under the robot [m]."""

HEIGHT = 0.5
"""Of the feet above the floor [m]."""


class HangingRobot:
    """A link whose robot moves on with each `read`, with damped motors and nothing commanded.

    Args:
        robot: with shoulders.
        check: for its damping.
        seed: of the noise.
        period: of the link [s].
        hold: command of the motors in place of damping.
        config: of the plant; by default noise, and friction as in the maker's model of G1.
    """

    def __init__(
        self,
        robot: poise.Robot,
        check: LastCheck,
        *,
        seed: int = 0,
        period: float = 0.002,
        hold: MotorCommand | None = None,
        config: PlantConfig | None = None,
    ) -> None:
        given = PlantConfig(joint_friction=0.2, control_dt=period).with_noise()
        self.plant = poise.Plant(robot, given if config is None else config, seed=seed)
        self._robot, self._command = robot, check.damping if hold is None else hold
        q = robot.q_home.copy()
        q[2] += HEIGHT
        q[7:] = [1.2 * ("elbow" in name) for name in robot.joint_names] if hold is None else hold.q
        self.plant.reset(q)
        self._link = PlantLink(self.plant, check)
        self.info, self.status = self._link.info, self._link.status
        self.refused, self.reason = 0, ""
        self._stiffness = 0.5 * robot.weight / SAG
        self._damping = math.sqrt(0.5 * robot.mass * self._stiffness)
        self._move, self._begin, self._posture = None, 0.0, q[7:].copy()
        torso = self.plant.data.body(robot.roles[robot.torso].link)
        self._torso = torso
        self._hooks = np.array([self.plant.data.body(link).xpos for link in SHOULDERS])
        self._rings = (self._hooks - torso.xpos) @ torso.xmat.reshape(3, 3)
        self._hooks[:, 2] += SAG
        self._before = self._hooks.copy()
        self._settle(2.0)

    def ask(self, move: Any) -> None:
        """Let go, wait until the robot hangs still, and begin a motion."""
        self._settle()
        self._move = move
        self._begin, self._posture = self.clock(), self.plant.true_state().q[7:]

    def _settle(self, seconds: float = 1.0) -> None:
        """Steady the pelvis by hand, and let go."""
        self._move, data = None, self.plant.data
        data.qfrc_applied[:] = 0.0
        for _ in range(round(seconds / self.plant.control_dt)):
            # Near the critical damping of a pendulum of 33 kg on a metre.
            data.qfrc_applied[:6] = -np.repeat([200.0, 20.0], 3) * data.qvel[:6]
            self.read()
        data.qfrc_applied[:] = 0.0

    def read(self) -> MotorState:
        """Return the state one period later."""
        self._pull()
        if self._move is not None:
            self._hand(self._move, self.clock() - self._begin)
        self._link.write(self._command)
        return self._link.read()

    def clock(self) -> float:
        """Return the plant's time [s]."""
        return self.plant.time

    def write(self, command: MotorCommand) -> None:
        """Set the command of the motors."""
        self._command = command

    def close(self) -> None:
        """Do nothing: the robot hangs on."""

    def _pull(self) -> None:
        torso = self._torso
        places = torso.xpos + self._rings @ torso.xmat.reshape(3, 3).T
        rates, self._before = (places - self._before) / self.plant.control_dt, places
        forces = self._stiffness * (self._hooks - places) - self._damping * rates
        torso.xfrc_applied[:3] = forces.sum(axis=0)
        torso.xfrc_applied[3:] = np.cross(places - torso.xipos, forces).sum(axis=0)

    def _hand(self, move: Any, time: float) -> None:
        """Guide joints of one limb or the pelvis, as a spring and a damper do."""
        robot, data, state = self._robot, self.plant.data, self.plant.true_state()
        data.qfrc_applied[:] = 0.0
        wave = 0.5 - 0.5 * math.cos(math.pi * time)  # once to and fro in two seconds
        if not move.joints:
            swing = np.zeros(3)
            swing[int(time / 2.0) % 3] = 0.25 * math.sin(math.pi * time)
            rotation = pin.Quaternion(state.q[3:7]).toRotationMatrix()
            error = rotation.T @ pin.log3(pin.exp3(swing) @ rotation.T)
            # A person moves the pelvis and what hangs from it, some 20 kg, at about 1 Hz.
            data.qfrc_applied[3:6] = 80.0 * error - 10.0 * state.v[3:6]
            return
        away = np.where(robot.q_max - self._posture >= self._posture - robot.q_min, 1, -1)
        for k in move.joints:
            target = self._posture[k] + 0.4 * (move.sign or away[k]) * wave
            stiffness = 1.5 * robot.tau_max[k]
            dof = self.plant.model.joint(robot.joint_names[k]).dofadr[0]
            data.qfrc_applied[dof] = (
                stiffness * (target - state.q[7 + k]) - 0.02 * stiffness * state.v[6 + k]
            )
