"""`Plant`: the simulated robot in its world, which takes a command a control period."""

import math
import warnings

import mujoco
import numpy as np
import pinocchio as pin
from jaxtyping import Bool, Float64

from poise._checks import checked_count, checked_kind
from poise._show import few, html_table
from poise.control import Command, CommandStatus
from poise.dynamics import RobotState, SensorReadings
from poise.errors import RobotError, TargetError
from poise.robots import Robot
from poise.sim._actuators import Actuators, ServoSteps
from poise.sim._build import build_model
from poise.sim._config import PlantConfig, Push
from poise.sim._forces import LOADED, PushSchedule, SoleForces
from poise.sim._mapping import StateMap
from poise.sim._motors import Motors, SetPoints
from poise.sim._rest import find_rest
from poise.sim._self_contact import SelfContacts
from poise.sim._sensors import InertialUnit, Sensors

_QUATERNION_TOLERANCE = 1e-6  # rounding of a quaternion written down with seven digits or more

# MuJoCo's warnings after which a run means nothing.
_WARNINGS = "INERTIA", "BADQPOS", "BADQVEL", "BADQACC"
_FATAL = [int(getattr(mujoco.mjtWarning, f"mjWARN_{name}")) for name in _WARNINGS]


class Plant:
    """A robot in MuJoCo that takes commands and is measured.

    The MuJoCo model is built from the robot's own document and is independent of the Pinocchio
    model that a controller uses. Runs with equal robot, configuration, seed, pushes and commands
    are equal bit by bit on one machine.

    Args:
        robot: the robot.
        config: the plant's configuration.
        seed: seed of the sensor noise.

    Attributes:
        robot: the robot.
        config: the plant's configuration.
        model: the MuJoCo model that is simulated. Meshes that nothing can touch are left out;
            `drawn_model` has them.
        data: its state.
        map: between the robot's q, v and the model's qpos, qvel.

    Raises:
        ConfigurationError: it is no robot, no configuration, or no seed.
        RobotError: the robot's document cannot be simulated.
        UnknownNameError: the configuration names a link or frame that does not exist.
    """

    def __init__(self, robot: Robot, config: PlantConfig | None = None, *, seed: int = 0) -> None:
        self.robot = checked_kind(robot, Robot, "robot of the plant")
        config = PlantConfig() if config is None else config
        self.config = checked_kind(config, PlantConfig, "configuration of the plant")
        self.model = build_model(robot, config)
        self.data = mujoco.MjData(self.model)
        # A view: how often MuJoCo has warned of what.
        self._warned = self.data.warning.number
        self.map = StateMap(robot, self.model)
        if (self.model.nq, self.model.nv) != (robot.nq, robot.nv):
            raise RobotError(
                f"the document of robot {robot.name!r} has other degrees of freedom than its model",
                got=f"nq = {self.model.nq}, nv = {self.model.nv}",
                wanted=f"nq = {robot.nq}, nv = {robot.nv}",
            )
        if config.actuation == "torque":
            _warn_of_no_armature(robot)
        soles: dict[str, tuple[int, pin.SE3]] = {}
        for name in robot.soles:
            role = robot.roles[name]
            soles[name] = self.model.body(role.link).id, pin.SE3(role.rotation, role.position)
        self._soles = SoleForces(self.model, soles)
        self._self_contacts = SelfContacts(self.model) if config.self_contact else None
        self._pushes = PushSchedule(robot, self.model)
        self._actuators = Actuators(robot, config)
        servos = config.actuation != "torque"
        self._servos = ServoSteps(self.model, self.data) if servos else None
        checked_count(seed, "seed of the plant")
        driven = config.motors is not None
        self._motors = Motors(robot, config, self.model, seed) if driven else None
        self._sensors = None
        if not config.sensors.ideal:
            ticks, base = config.delay_ticks, robot.base_dofs
            self._sensors = Sensors(config.sensors, base_dofs=base, delay_ticks=ticks, seed=seed)
        self._unit = InertialUnit()
        self._pelvis = self.model.site(robot.pelvis).id
        self.reset()
        self._home_height = float(self.data.site_xpos[self._pelvis, 2])

    def reset(
        self,
        q: Float64[np.ndarray, " nq"] | None = None,
        v: Float64[np.ndarray, " nv"] | None = None,
    ) -> RobotState:
        """Put the robot somewhere, at time zero, and forget all pushes.

        A robot that is put on the ground at rest stands there loaded: its base is moved by the some
        hundredths of a millimetre at which the ground just carries it, and its motors begin with
        the torques that hold it, so that nothing has to land first. One that nothing carries, or
        that would tip over, is left where it was put.

        Args:
            q: configuration, the home posture if not given [m, rad].
            v: velocity, zero if not given [m/s, rad/s].

        Returns:
            The first state.

        Raises:
            TargetError: wrong shape, NaN or infinity, or a base quaternion that is not a unit one.
        """
        q = _checked("q", self.robot.q_home if q is None else q, self.robot.nq)
        norm = float(np.linalg.norm(q[3:7])) if self.robot.floating_base else 1.0
        if abs(norm - 1.0) > _QUATERNION_TOLERANCE:
            raise TargetError("the base quaternion in q is not a unit one", got=norm, wanted="1")
        v = _checked("v", np.zeros(self.robot.nv) if v is None else v, self.robot.nv)
        mujoco.mj_resetData(self.model, self.data)
        self._pushes.clear(self.data)
        self._tick, self._diverged, self._warnings = 0, False, list[str]()
        self.data.qpos[:] = self.map.qpos(q)
        self.data.qvel[:] = self.map.qvel(q, v)
        load = None if v.any() else find_rest(self.model, self.data, self.map)
        load = np.zeros(self.robot.nj) if load is None else load
        self.data.ctrl[:] = self._actuators.reset(q[-self.robot.nj :], load)
        self._unit.reset()
        mujoco.mj_forward(self.model, self.data)
        if self._motors is not None:
            self._motors.reset(self.data, load)
        if self._self_contacts is not None:
            self._self_contacts.forces = {}
            self._self_contacts.look(self.data)
        self._truth: RobotState | None = None
        state = self._read_drives()
        state = state if self._sensors is None else self._sensors.reset(state)
        self._state: RobotState | None = state
        return state

    def place(self, q: Float64[np.ndarray, " nq"], v: Float64[np.ndarray, " nv"]) -> None:
        """Move frames, bodies and CoM of `data` to a state, without time, forces or contacts.

        Args:
            q: configuration [m, rad].
            v: velocity [m/s, rad/s].
        """
        self.data.qpos[:], self.data.qvel[:] = self.map.qpos(q), self.map.qvel(q, v)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def drawn_model(self) -> mujoco.MjModel:
        """Build the model with all its pictures, as a renderer needs it.

        Bodies, joints and sites are those of `model`, at the same indices, so that qpos holds for
        both; geoms are not. Each call recompiles the model.

            shown = plant.drawn_model()
            data = mujoco.MjData(shown)
            data.qpos[:] = plant.data.qpos
            mujoco.mj_forward(shown, data)

        Raises:
            RobotError: a picture of the robot cannot be read.
        """
        return build_model(self.robot, self.config, pictures=True)

    def __repr__(self) -> str:
        how = "diverged" if self.diverged else "fallen" if self.fallen else "up"
        config = self.config
        about = f"{config.actuation} every {1e3 * config.control_dt:g} ms, t = {self.time:.3f} s"
        return f"Plant of {self.robot.name}: {about}, {how}"

    def _repr_html_(self) -> str:
        share = np.max(np.abs(self.applied_torque) / self.robot.tau_max)
        rows = [
            *((f"load of {name}", f"{w[2]:.1f} N") for name, w in self.sole_wrenches().items()),
            ("CoM", f"{np.round(self.com, 3).tolist()} m"),
            ("torque", f"{share:.0%} of a limit"),
        ]
        return html_table(repr(self), ("quantity", "now"), rows)

    @property
    def control_dt(self) -> float:
        """Control period [s]."""
        return self.config.control_dt

    @property
    def time(self) -> float:
        """Time since the last reset [s]."""
        return self._tick * self.config.control_dt

    def state(self) -> RobotState:
        """Return the measured state; the true one with ideal sensors.

        Sole wrenches are those of the last physics step. A second call returns the same.
        """
        if self._state is None:
            self._state = self.true_state()
        return self._state

    def true_state(self) -> RobotState:
        """Return the true state; a copy."""
        truth = self._true
        contacts = {name: wrench.copy() for name, wrench in truth.contacts.items()}
        readings = truth.readings
        if readings is not None:
            readings = SensorReadings(*(reading.copy() for reading in readings))
        return RobotState(truth.q.copy(), truth.v.copy(), contacts, truth.time, readings)

    def step(
        self,
        command: Command | None,
        position: Float64[np.ndarray, " nj"] | None = None,
    ) -> None:
        """Advance one control period.

        A plant that has diverged lets the time pass and does nothing else.

        Args:
            command: torque or velocity, by the plant's actuation; None for none.
            position: joint position targets for position actuation, None to keep the last [rad].

        Raises:
            ConfigurationError: the command is of another kind or shape than the plant's actuation.
        """
        self._actuators.accept(command, position, self.state)
        if self._motors is not None:
            torque = self._actuators.controls()[0]
            self._motors.send(np.array([*np.zeros((4, self.robot.nj)), torque]))
        self._pass()

    def drive(self, set_points: SetPoints) -> None:
        """Advance one control period under set-points of the drives' own loops.

        Each drive applies tau + kp (q - q_measured) + kd (dq - dq_measured) within its limits.
        Ideal drives do so once, on the true joint state, at the beginning of the period; those of
        `PlantConfig.motors` at 10 kHz, from when the command arrives until another one does. These
        refuse set-points with NaN or infinity, count them among `rejected_commands`, and apply no
        torque then.

        Args:
            set_points: q [rad], dq [rad/s], kp [N m/rad], kd [N m s/rad] and tau [N m] of all
                joints, as `poise.hardware.MotorCommand`; the plant has torque actuation.

        Raises:
            ConfigurationError: the plant has another actuation.
        """
        names = "q", "dq", "kp", "kd", "tau"
        q, dq, kp, kd, tau = rows = np.array([getattr(set_points, name) for name in names])
        if self._motors is None:
            now, joints = self._true, self.robot.nj
            torque = tau + kp * (q - now.q[-joints:]) + kd * (dq - now.v[-joints:])
            # A plant that has diverged has no state, and takes any torque.
            torque = np.nan_to_num(np.clip(torque, -self.robot.tau_max, self.robot.tau_max))
            self.step(Command(CommandStatus.OK, torque))
            return
        if not np.isfinite(rows).all():
            self._actuators.rejected += 1
            rows[:] = 0.0
        self._motors.send(rows)
        self._pass()

    def _pass(self) -> None:
        """Let a control period pass."""
        begin = self.time
        self._tick += 1
        if not self._diverged:
            self._advance(begin)
        self._truth = None
        if self._sensors is not None:
            self._state = self._sensors.measure(self._read_drives())
        else:
            self._state = None if self._motors is None else self._read_drives()

    def _read_drives(self) -> RobotState:
        """Return the true state, with what drives of their own measure in place of the joints'."""
        state = self.true_state()
        if self._motors is not None:
            self._motors.measure(state)
        return state

    def _advance(self, begin: float) -> None:
        """Advance, keeping MuJoCo's warnings off the terminal and out of the user's folder."""
        before = mujoco.get_mju_user_warning()
        mujoco.set_mju_user_warning(self._note_warning)
        try:
            self._simulate(begin)
        finally:
            mujoco.set_mju_user_warning(before)
        qpos, qvel = self.data.qpos, self.data.qvel
        finite = math.isfinite(float(qpos.dot(qpos)) + float(qvel.dot(qvel)))
        warned = self._warned.tolist()
        self._diverged = not finite or any(warned[kind] for kind in _FATAL)

    def _note_warning(self, message: str) -> None:
        if message not in self._warnings:
            self._warnings.append(message)

    def _simulate(self, begin: float) -> None:
        data, dt, pushes = self.data, self.config.physics_dt, self._pushes
        controls, touching, servos = self._actuators.controls(), self._self_contacts, self._servos
        motors, constant = self._motors, self._actuators.constant and self._motors is None
        if constant and not pushes and touching is None and servos is None:
            data.ctrl[:] = controls[0]
            mujoco.mj_step(self.model, data, len(controls))
            return
        if touching is not None:
            touching.forces = {}
        for k, control in enumerate(controls):
            data.ctrl[:] = control if motors is None else motors.torque(data)
            if pushes:
                pushes.apply(data, begin + k * dt, begin + (k + 1) * dt)
            if servos is None:
                mujoco.mj_step(self.model, data)
            else:
                servos.advance(data)
            if touching is not None:
                touching.look(data)

    def push(
        self,
        body: str,
        force: tuple[float, float, float],
        duration: float,
        start: float | None = None,
    ) -> Push:
        """Push the robot.

        Args:
            body: a frame with a part to play (pushed at its origin) or a link (pushed at its centre
                of mass).
            force: force in the world [N].
            duration: how long [s].
            start: when it begins, now if not given [s].

        Returns:
            The push as scheduled.

        Raises:
            ConfigurationError: a value is not finite or not positive.
            UnknownNameError: no such frame or link.
        """
        begin = self.time if start is None else start
        push = Push(body=body, force=force, duration=duration, start=begin)
        self._pushes.add(push)
        return push

    def sole_wrenches(self) -> dict[str, Float64[np.ndarray, "6"]]:
        """True wrench [force; moment] on the robot by sole, in the sole's frame [N, N m].

        With `PlantConfig.self_contact` it holds what the robot's own links do to the foot, too, as
        that of a force sensor in the ankle would.
        """
        return {name: wrench.copy() for name, wrench in self._true.contacts.items()}

    def contacts(self) -> dict[str, bool]:
        """Return for each sole whether it carries load."""
        wrenches = self._true.contacts
        return {n: bool(np.linalg.norm(w[:3]) > LOADED) for n, w in wrenches.items()}

    def zmp(self, height: float = 0.0) -> Float64[np.ndarray, "2"]:
        """Zero-moment point from the true sole forces, on the plane z = height, in the world [m].

        x = -n_y / f_z and y = n_x / f_z, where f and n are the total force and the total moment
        about (0, 0, height). NaN where no sole carries load.
        """
        _ = self._true  # the forces are those of the last physics step
        return self._soles.zmp(height)

    @property
    def self_contacts(self) -> dict[tuple[str, str], float]:
        """Largest normal force between links in the last control period by their names [N].

        Empty without `PlantConfig.self_contact`.
        """
        return {} if self._self_contacts is None else dict(self._self_contacts.forces)

    @property
    def com(self) -> Float64[np.ndarray, "3"]:
        """True centre of mass of the plant, payloads included, at the last physics step [m]."""
        return self.data.subtree_com[1].copy()

    @property
    def applied_torque(self) -> Float64[np.ndarray, " nj"]:
        """Torque that the motors gave in the last physics step, saturation included [N m].

        With `PlantConfig.motors` it is the mean in that step, with ripple and friction; what
        `state().readings` has is that of the currents.
        """
        return self.data.actuator_force.copy()

    @property
    def saturated(self) -> Bool[np.ndarray, " nj"]:
        """Motors that were at their limit in the last physics step."""
        if self._motors is not None:
            return self._motors.saturated
        return np.abs(self.data.actuator_force) >= self.robot.tau_max * (1.0 - 1e-12)

    @property
    def imu(self) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
        """True angular velocity [rad/s] and specific force [m/s^2] at the pelvis, in its frame.

        Zero for a fixed base.
        """
        if not self.robot.floating_base:
            return np.zeros(3), np.zeros(3)
        return (
            self.data.sensor("gyro").data.copy(),
            self.data.sensor("accelerometer").data.copy(),
        )

    @property
    def mass(self) -> float:
        """Mass of the plant with model errors and payloads [kg]."""
        return float(self.model.body_mass.sum())

    @property
    def diverged(self) -> bool:
        """True where the simulation has left the finite numbers; reset to go on."""
        return self._diverged

    @property
    def warnings(self) -> tuple[str, ...]:
        """MuJoCo's warnings since the last reset, each message once."""
        return tuple(self._warnings)

    @property
    def fallen(self) -> bool:
        """True where the pelvis is too low (PlantConfig.fall_height_ratio), or the run diverged."""
        if self._diverged or not self.robot.floating_base:
            return self._diverged
        height = float(self.data.site_xpos[self._pelvis, 2])
        return not height > self.config.fall_height_ratio * self._home_height

    @property
    def trouble(self) -> str:
        """Reason for which a run ended on this plant; "" for none."""
        if self._diverged:
            return "the simulation diverged"
        return f"the robot fell at {self.time:.3f} s" if self.fallen else ""

    @property
    def rejected_commands(self) -> int:
        """Commands since the last reset that held NaN or infinity, and were not carried out."""
        return self._actuators.rejected

    @property
    def _true(self) -> RobotState:
        """The true state, read once."""
        if self._truth is None:
            qpos, qvel = self.data.qpos, self.data.qvel
            q, v, readings = self.map.q(qpos), self.map.v(qpos, qvel), None
            if self.robot.floating_base:
                unit = self._unit.read(qpos, qvel, self.time)
                readings = SensorReadings(*unit, torque=self.applied_torque)
            self._truth = RobotState(q, v, self._soles.update(self.data), self.time, readings)
        return self._truth


def _warn_of_no_armature(robot: Robot) -> None:
    armature = robot.model.armature[robot.base_dofs :]
    without = [n for n, a in zip(robot.joint_names, armature, strict=True) if a == 0.0]
    if without:
        warnings.warn(
            f"{len(without)} joints of robot {robot.name!r} have no reflected rotor inertia "
            f"({few(without)}); under "
            "torque control light links then shake, or the robot falls. Put the rotors' inertia, "
            "gear ratio squared times that of the rotor, into its description, one for all joints "
            "or by pattern, such as `armature: 0.01` [kg m^2]",
            # The line that makes the plant; Python shows a warning of one line once.
            stacklevel=3,
        )


def _checked(name: str, value: Float64[np.ndarray, "..."], size: int) -> Float64[np.ndarray, " n"]:
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (size,):
        raise TargetError(f"{name} has the wrong shape", got=array.shape, wanted=f"({size},)")
    if not np.isfinite(array).all():
        raise TargetError(f"{name} holds NaN or infinity", got=array.tolist())
    return array
