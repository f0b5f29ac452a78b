"""`run_standing`: a G1 that sways under its motors, and how much its joints vibrate."""

import math
import re
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from jaxtyping import Float64

from poise.control import WholeBodyController
from poise.dynamics import Dynamics
from poise.estimation import StateEstimator
from poise.hardware import LastCheck, PlantLink, TorqueSplit, robot_state
from poise.robots import Robot, load_robot
from poise.sim import MotorConfig, Plant, PlantConfig, SensorConfig
from poise.stack import ComTask

PERIOD, LOOP = 2e-3, 1e-4
"""Periods of the controller, 500 Hz as G1's commands have, and of the drives' loops [s]."""

LOWEST = 20.0
"""Lowest frequency of what counts as vibration [Hz]: above the natural one of the stiffest stack
here, 80 rad/s or 13 Hz, and below that of its loop at the edge, 1.03 kd or 26 Hz."""

SWAY, RATE = 0.01, 1.0
"""Amplitude [m] and frequency [Hz] of the CoM, so that friction does not hold all joints."""

SETTLED = 0.5
"""Beginning of what is measured [s]: five time constants of `default_stack`."""

ROTORS = {
    ".*_(hip_roll|knee)_joint": 0.0251,
    ".*_hip_.*|waist_yaw_joint": 0.0102,
    ".*_ankle_.*|waist_.*": 2.0 * 0.0036,
    ".*_wrist_(pitch|yaw)_joint": 0.00425,
    ".*": 0.0036,
}
"""Inertia of rotors and gears at the joints of a G1 [kg m^2], two motors at ankles and waist, by
unitree_rl_lab (unitree_actuators.py)."""

BLIND = 4e-3
"""Time in which no computer reacts to a joint [s]: 2 ms of its period, 1.5 ms on the way and 0.4 ms
in the drives' filter, by `MotorConfig.g1()`."""

Joints = Float64[np.ndarray, " nj"]


@dataclass(frozen=True, kw_only=True)
class Standing:
    """One run."""

    latency: float  # of commands [s]
    ripple: float | None  # amplitude over the Coulomb friction; that of the preset when None
    friction: float = 1.0  # over the published one
    damped: bool = False  # by `drive_damping` in the drives, or pure torque
    stiffness: float = 1.0  # factor on the damping gains of `default_stack`; kp has its square
    seconds: float = 2.5  # duration [s]
    seed: int = 0  # of jitter and sensors

    @property
    def motors(self) -> MotorConfig:
        """The motors."""
        config = MotorConfig.g1()
        kinds = tuple(
            replace(
                kind,
                ripple=kind.ripple if self.ripple is None else self.ripple * kind.friction,
                friction=self.friction * kind.friction,
                damping=self.friction * kind.damping,
            )
            for kind in config.motors
        )
        return replace(config, motors=kinds, latency=self.latency)

    @property
    def delay(self) -> float:
        """Mean delay in the computer's loop [s].

        Latency, half of jitter and of the period for which a torque is held, and the filter.
        """
        config = self.motors
        assert config.velocity_bandwidth is not None
        filtered = 1.0 / (math.tau * config.velocity_bandwidth)
        return self.latency + 0.5 * config.jitter + 0.5 * PERIOD + filtered


@dataclass(frozen=True, kw_only=True)
class Vibration:
    """Vibration of one run."""

    ratio: float  # largest of a joint's velocity over the noise of its measurement
    joint: str  # that joint
    speed: float  # RMS of its velocity above `LOWEST` [rad/s]
    torque: float  # largest RMS of a commanded torque above `LOWEST` [N m]
    gain: float  # largest damping gain of the stack, kd [1/s]
    fell: bool


def run_standing(trial: Standing) -> Vibration:
    """Stand and sway by what the link measures."""
    robot = _g1()
    # The drives' encoders are the motors' own.
    sensors = replace(SensorConfig.typical(), encoder_resolution=0.0, joint_velocity_noise=0.0)
    config = PlantConfig(control_dt=PERIOD, sensors=sensors, motors=trial.motors)
    plant = Plant(robot, config, seed=trial.seed)
    kd = drive_damping(robot) if trial.damped else np.zeros(robot.nj)
    check = LastCheck(robot, kp_max=0.0, kd_max=50.0)
    link, split = PlantLink(plant, check), TorqueSplit(check, kp=0.0, kd=kd, period=PERIOD)
    controller, estimator = WholeBodyController(robot), StateEstimator(robot)
    tasks = [task for level in controller.stack.levels for task in level]
    for task in tasks:
        task.set_gains(trial.stiffness**2 * task.kp, trial.stiffness * task.kd)
    com = next(task for task in tasks if isinstance(task, ComTask))
    home, speeds, torques = Dynamics(robot).com.copy(), list[Joints](), list[Joints]()
    while plant.time < trial.seconds - 0.5 * PERIOD and not plant.fallen:
        measured = link.read()
        com.set_target(home + [0.0, SWAY * math.sin(math.tau * RATE * plant.time), 0.0])
        command = controller.step(estimator.update(robot_state(robot, link.info, measured)))
        link.write(split.split(command, measured))
        speeds.append(plant.true_state().v[-robot.nj :])
        assert command.torque is not None
        torques.append(command.torque.copy())
    speed, ratios = above_lowest(speeds), above_lowest(speeds) / velocity_noise(robot, trial.motors)
    worst = int(np.argmax(ratios))
    return Vibration(
        ratio=float(ratios[worst]),
        joint=robot.joint_names[worst],
        speed=float(speed[worst]),
        torque=float(above_lowest(torques).max()),
        gain=max(float(np.max(task.kd)) for task in tasks),
        fell=plant.fallen,
    )


def drive_damping(robot: Robot) -> Joints:
    """Damping kd = I / T that stops a free rotor I within the time T = `BLIND` [N m s/rad]."""
    return np.array([_first(ROTORS, name) for name in robot.joint_names]) / BLIND


def velocity_noise(robot: Robot, motors: MotorConfig) -> Joints:
    """Standard deviation of the drives' velocities by quantisation alone [rad/s].

    Positions that are rounded to steps d have errors of variance d^2 / 12, independent where a
    joint moves by some steps a period T. Differences of them through the filter
    y <- y + a ((x - x_last) / T - y) have the variance 2 a^2 / (2 - a) d^2 / (12 T^2).
    """
    assert motors.velocity_bandwidth is not None
    a = -math.expm1(-math.tau * motors.velocity_bandwidth * LOOP)
    steps = {kind.joints: kind.resolution / kind.gear for kind in motors.motors}
    passed = math.sqrt(2.0 * a**2 / (2.0 - a) / 12.0) / LOOP
    noise = passed * np.array([_first(steps, name) for name in robot.joint_names])
    for linkage in motors.linkages:
        # A joint is half of the sum, or the difference, of two motors.
        noise[[robot.joint_names.index(name) for name in linkage.joints]] /= math.sqrt(2.0)
    return noise


def above_lowest(samples: list[Joints]) -> Joints:
    """RMS of the part above `LOWEST`, from `SETTLED` on, or in the last half of a short run."""
    begin = min(round(SETTLED / PERIOD), len(samples) // 2)
    spectrum = np.fft.rfft(np.array(samples[begin:]), axis=0)
    frequencies = np.fft.rfftfreq(len(samples) - begin, PERIOD)
    spectrum[frequencies < LOWEST] = 0.0
    return np.fft.irfft(spectrum, len(samples) - begin, axis=0).std(axis=0)


def _first(values: dict[str, float], name: str) -> float:
    return next(value for pattern, value in values.items() if re.fullmatch(pattern, name))


@cache
def _g1() -> Robot:
    return load_robot("g1")
