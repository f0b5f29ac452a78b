"""`MujocoBridge`: a controller in a MuJoCo loop that a user wrote."""

import math
import warnings
from collections.abc import Collection

import mujoco
import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import checked_kind
from poise._show import few
from poise.control import Command, CommandStatus
from poise.dynamics import RobotState
from poise.errors import ConfigurationError, RobotError
from poise.robots import Robot
from poise.sim._comparison import differences, find_base
from poise.sim._couplings import check_equalities, find_couplings, pulling_tendons
from poise.sim._drives import Drives, Joints
from poise.sim._forces import SoleForces
from poise.sim._mapping import StateMap
from poise.sim._rest import find_rest


class MujocoBridge:
    """Between a robot and a user's own `mujoco.MjModel` and `MjData`: state out, command in.

        bridge = poise.sim.MujocoBridge(robot, model)
        while running:
            command = controller.step(bridge.state(data))
            bridge.apply(command, data)
            mujoco.mj_step(model, data)

    Joints are found by their names. The model may have them in any order, the base's free joint
    anywhere, other bodies, joints and actuators besides, and actuators of any linear kind: a servo
    is sent the position at which it gives the commanded torque. What cannot be right is refused
    when the bridge is made, before anything moves; what the controller's model lacks, such as a
    heavier link or a weaker motor, is listed in `differences` and in one warning, and so is an
    option with which MuJoCo's solver may go wrong. Nothing in the model is changed.

    A robot has no loops and no coupled joints. An active equality of the model that acts on the
    robot (connect, weld, joint, tendon, flex) is refused unless it is accepted by name; one between
    other things, or between joints that the robot lacks or locks, is harmless.

    Args:
        robot: the robot that the controller was made with.
        model: the MuJoCo model.
        prefix: what stands before the names of the robot's joints in the model, as `attach` puts
            it; found by itself where only one fits.
        accept_equalities: names of equalities that may act on the robot although the controller's
            model lacks them; one without a name is "equality K", K its index in the model.

    Attributes:
        robot: the robot.
        model: the MuJoCo model.
        map: between the orders of the two.
        differences: properties missing from the controller's model, a sentence each.
        rejected: commands that were not carried out as they came, because they or the state held
            NaN or infinity.

    Raises:
        RobotError: a joint is missing or stands elsewhere, the base is not free, an equality acts
            on the robot, or a torque cannot be sent through an actuator.
        UnknownNameError: an accepted equality is not in the model.
    """

    def __init__(
        self,
        robot: Robot,
        model: mujoco.MjModel,
        *,
        prefix: str | None = None,
        accept_equalities: Collection[str] = (),
    ) -> None:
        checked_kind(robot, Robot, "robot of the bridge")
        checked_kind(model, mujoco.MjModel, "model of the bridge")
        prefix = _find_prefix(robot, model) if prefix is None else prefix
        place = find_base(robot, model, prefix)
        self.robot, self.model = robot, model
        self.map = StateMap(robot, model, prefix=prefix, body_T_base=place)
        own = self.map.dof_order
        couplings = find_couplings(model, own)
        acting = np.flatnonzero(couplings.equalities[:, own].any(axis=1))
        accepted = check_equalities(robot, model, acting, accept_equalities)
        tendons = pulling_tendons(model, np.flatnonzero(couplings.tendons[:, own].any(axis=1)))
        self._drives = Drives(robot, model, self.map.joints, couplings.outputs)
        self._soles = SoleForces(model, _sole_places(robot, model, self.map))
        self._refused = {kind: self._drives.refused(kind) for kind in ("torque", "velocity")}
        self._no_torque = np.zeros(robot.nj)
        self.rejected = 0
        # Where servos that follow velocities are, how fast they go, and since when.
        self._target: Joints | None = None
        self._velocity, self._since = np.zeros(robot.nj), math.nan
        self.differences = (
            *differences(robot, model, self.map, self._drives, tendons, prefix),
            *(f"an equality that was accepted: {text}" for text in accepted),
        )
        if self.differences:
            lines = "\n  - ".join(self.differences)
            warnings.warn(
                f"the controller does not know of the MuJoCo model of {robot.name!r}:\n  - {lines}",
                stacklevel=2,
            )

    def state(self, data: mujoco.MjData) -> RobotState:
        """Return the true state, with the wrenches that the last step put on the soles.

        Args:
            data: after `mj_forward` or `mj_step`.
        """
        self._check_data(data)
        if self.robot.soles and not data.flg_rnepost:
            mujoco.mj_rnePostConstraint(self.model, data)
        q, v = self.map.q(data.qpos), self.map.v(data.qpos, data.qvel)
        return RobotState(q, v, self._soles.update(data), float(data.time))

    def apply(self, command: Command, data: mujoco.MjData) -> Float64[np.ndarray, " nj"]:
        """Send a command to the actuators; best before every physics step.

        A velocity moves the targets of servos along, from where the joints are at the first such
        command or what `place` let hold the robot, by the time that `data` says has passed. Values
        that are not finite are taken as no torque or no velocity; controls stay as they are where
        the state is not finite.

        Args:
            command: torque or velocity.
            data: `ctrl` is written, and `qfrc_applied` of joints that no actuator moves.

        Returns:
            Torque that the joints get in the next physics step [N m]: what was commanded, unless a
            range of controls or forces forbids it.

        Raises:
            ConfigurationError: a command that the actuators cannot carry out, or of wrong size.
        """
        self._check_data(data)
        wanted, kind = self._read(command)
        joints = slice(-self.robot.nj, None)
        q, v = self.map.q(data.qpos)[joints], self.map.v(data.qpos, data.qvel)[joints]
        drives, acceleration = self._drives, command.acceleration
        with np.errstate(all="ignore"):
            if kind == "torque":
                v = drives.end_of_step(v, None if acceleration is None else acceleration[joints])
                controls = drives.for_torque(wanted, q, v)
            else:
                target = self._move_target(wanted, q, float(data.time))
                controls = drives.for_motion(target, wanted, q)
            torque = drives.torques(controls, q, v)
        if not np.isfinite(controls).all():
            self.rejected, self._target = self.rejected + 1, None
            return torque
        force = wanted if kind == "torque" else self._no_torque
        drives.write(controls, force, data)
        torque[drives.unactuated] = force[drives.unactuated]
        return torque

    def place(
        self,
        data: mujoco.MjData,
        q: Float64[np.ndarray, " nq"] | None = None,
        v: Float64[np.ndarray, " nv"] | None = None,
    ) -> None:
        """Put the robot somewhere, and leave everything else where it is.

        As by `Plant.reset`, one that is put on the ground at rest stands there loaded: its base is
        moved by some hundredths of a millimetre, and its actuators hold it.

        Args:
            data: changed; `mj_forward` is called.
            q: configuration, the home posture if not given [m, rad].
            v: velocity, zero if not given [m/s, rad/s].
        """
        self._check_data(data)
        q = self.robot.q_home if q is None else q
        v = np.zeros(self.robot.nv) if v is None else v
        self.map.write(q, v, data.qpos, data.qvel)
        self._target = None
        load = None if v.any() else find_rest(self.model, data, self.map)
        if load is not None:
            if not self._refused["torque"]:
                self.apply(Command(CommandStatus.OK, load), data)
            # Servos that are sent velocities next begin with what holds the robot.
            self._target = q[-self.robot.nj :] + self._drives.lead(load)
            self._velocity, self._since = np.zeros(self.robot.nj), float(data.time)
        mujoco.mj_forward(self.model, data)

    def _check_data(self, data: mujoco.MjData) -> None:
        if (data.qpos.size, data.ctrl.size) != (self.model.nq, self.model.nu):
            raise ConfigurationError("data of another model than the bridge was made with")

    def _read(self, command: Command) -> tuple[Joints, str]:
        """The command's values, and of which kind they are."""
        kind = "velocity" if command.torque is None else "torque"
        value = command.velocity if command.torque is None else command.torque
        if value is None or value.shape != (self.robot.nj,):
            raise ConfigurationError(
                "wrong command",
                got="neither torque nor velocity" if value is None else value.shape,
                wanted=f"a torque or a velocity of shape ({self.robot.nj},)",
            )
        if self._refused[kind]:
            raise ConfigurationError(
                f"the model's actuators cannot be sent a {kind}",
                got=few(self._refused[kind]),
                wanted="a controller that commands "
                + ("velocities" if kind == "torque" else "torques, or servos at these joints"),
            )
        if not np.isfinite(value).all():
            self.rejected += 1
            return self._no_torque, kind
        return value, kind

    def _move_target(self, velocity: Joints, q: Joints, now: float) -> Joints:
        """Targets of servos at the end of the next physics step [rad]."""
        if self._target is None or not now >= self._since:
            self._target = q.copy()
        else:
            self._target += (now - self._since) * self._velocity
        limits = self.robot.q_min, self.robot.q_max
        self._target = np.clip(self._target, *limits)
        self._velocity, self._since = velocity.copy(), now
        return np.clip(self._target + float(self.model.opt.timestep) * velocity, *limits)


def _find_prefix(robot: Robot, model: mujoco.MjModel) -> str:
    """The prefix of the names of the robot's joints, if there is just one."""
    there = {model.joint(j).name for j in range(model.njnt)}
    first = robot.joint_names[0]
    prefixes = (name.removesuffix(first) for name in sorted(there) if name.endswith(first))
    fitting = [p for p in prefixes if there.issuperset(p + name for name in robot.joint_names)]
    if len(fitting) > 1:
        raise RobotError(
            f"the MuJoCo model has several robots with the joints of {robot.name!r}",
            got=f"prefixes {fitting}",
            wanted="one of them as prefix",
            choices=fitting,
        )
    # Without any, the joints that are missing are named as the robot has them.
    return fitting[0] if fitting else ""


def _sole_places(
    robot: Robot, model: mujoco.MjModel, mapping: StateMap
) -> dict[str, tuple[int, pin.SE3]]:
    """Of each sole the body that its last joint moves, and its place there, from both at home."""
    data, ours = mapping.at(robot.q_home), robot.model.createData()
    pin.framesForwardKinematics(robot.model, ours, robot.q_home)
    places: dict[str, tuple[int, pin.SE3]] = {}
    for name in robot.soles:
        frame = robot.frame_id(name)
        joint = int(robot.model.frames[frame].parentJoint) - robot.model.njoints + robot.nj
        body = int(model.jnt_bodyid[mapping.joints[joint] if joint >= 0 else mapping.free_joint])
        world_T_body = pin.SE3(data.xmat[body].reshape(3, 3).copy(), data.xpos[body].copy())
        places[name] = (body, world_T_body.actInv(ours.oMf[frame]))
    return places
