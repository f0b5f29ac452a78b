"""`Drives`: from torques or velocities of joints to the controls of whatever moves them."""

from collections.abc import Sequence
from typing import Literal

import mujoco
import numpy as np
from jaxtyping import Bool, Float64

from poise.errors import RobotError
from poise.robots import Robot

_STATELESS = int(mujoco.mjtDyn.mjDYN_NONE)
_INTEGRATOR = int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
_FILTERS = (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT))
_ON_JOINTS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
_FIXED_GAIN, _AFFINE_GAIN = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE)
_NO_BIAS, _AFFINE_BIAS = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)

_IMPLICIT = (
    int(mujoco.mjtIntegrator.mjINT_IMPLICIT),
    int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST),
)
"""Integrators that take an actuator's damping at the end of the step."""

_GROUPS = 31
"""Groups of actuators that MuJoCo can switch off."""

_TOO_LITTLE = 1e-12
"""A gain or gear below this is none."""


class Drives:
    """The actuators of a robot's joints in any MuJoCo model, as linear functions of their controls.

    An actuator of gear r pulls on a joint at q with the force f, which gives the joint the torque
    tau = r f, where f depends on its control u, its length L = r q and the length's rate L':

        f = g u + b,    g = g0 + g1 L + g2 L',    b = b0 + b1 L + b2 L'

    A motor has g0 alone; a position servo g0 = kp, b1 = -kp, b2 = -kv; a velocity servo g0 = kv,
    b2 = -kv. So the control for a torque is u = (tau / r - b) / g at the present L and L'; and the
    one that makes a servo follow q_d and v_d is u = -b / g with b at r q_d and r v_d. Of several
    actuators of one joint the strongest gives the torque, and the others are sent what gives none.

    Implicit integrators evaluate b2 L' at the end of the step, see `end_of_step`.

    Attributes:
        unactuated: places, in the robot's order, of joints that no actuator moves.
        armature: inertia that the actuators bring to each joint [kg m^2].
        damping: damping that they bring besides that of servos [N m s/rad].
        delayed: joints whose actuators act late, through a filter or a delay.
    """

    def __init__(self, robot: Robot, model: mujoco.MjModel, joints: Sequence[int]) -> None:
        found = _actuators_of(model, joints)
        ids = [i for i, _ in found]
        _check_kinds(robot, model, found)
        _check_others(robot, model, joints, ids)
        self._names = robot.joint_names
        self._joint = np.array([k for _, k in found], dtype=np.int64)
        self._ctrl = np.array(model.actuator_ctrladr[ids], dtype=np.int64)
        self._gear = np.array(model.actuator_gear[model.actuator_outadr[ids], 0])
        self._gain = np.array(model.actuator_gainprm[ids, :3].T)
        self._gain[1:, model.actuator_gaintype[ids] == _FIXED_GAIN] = 0.0
        self._bias = np.array(model.actuator_biasprm[ids, :3].T)
        self._bias[:, model.actuator_biastype[ids] == _NO_BIAS] = 0.0
        clamped = not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
        self._control_range = _range(
            clamped & model.actuator_ctrllimited[self._ctrl], model.actuator_ctrlrange[self._ctrl]
        )
        self._force_range = _range(model.actuator_forcelimited[ids], model.actuator_forcerange[ids])
        # Range of what all actuators of a joint give together.
        self._torque_range = _range(
            model.jnt_actfrclimited[list(joints)], model.jnt_actfrcrange[list(joints)]
        )
        self._integrates = np.array(model.actuator_dyntype[ids] == _INTEGRATOR)
        self._main = self._strongest()
        self._step = float(model.opt.timestep) if model.opt.integrator in _IMPLICIT else 0.0
        self.armature = self._at_joints(model.actuator_armature[ids])
        self.damping = self._at_joints(model.actuator_damping[ids])
        late = (model.actuator_delay[ids] > 0.0) | np.isin(model.actuator_dyntype[ids], _FILTERS)
        self.delayed = tuple(self._names[k] for k in self._joint[late])
        self.unactuated = np.setdiff1d(np.arange(len(joints)), self._joint)
        self._dofs = np.array(model.jnt_dofadr[list(joints)], dtype=np.int64)[self.unactuated]

    def refused(self, kind: Literal["torque", "velocity"]) -> list[str]:
        """Joints that cannot be told a torque, or a velocity, each with its reason."""
        if kind == "torque":
            wrong, why = self._integrates, "its actuator's control is a velocity"
            without: list[str] = []
        else:
            wrong = ~self._integrates & (self._bias[1:] == 0.0).all(axis=0)
            why = "its actuator is no servo"
            without = [f"{self._names[k]}: no actuator" for k in self.unactuated]
        return [*(f"{self._names[k]}: {why}" for k in self._joint[wrong]), *without]

    def strength(self, q: Float64[np.ndarray, " nj"]) -> Float64[np.ndarray, "2 nj"]:
        """Least and greatest torque that the ranges of controls and forces leave at rest [N m].

        Without end for a joint that no actuator moves.
        """
        ends = [self._torques_by_actuator(u, q, np.zeros_like(q)) for u in self._control_range]
        ends = np.sort(np.array(ends), axis=0)[:, self._main]
        reach = np.full((2, len(q)), np.inf) * [[-1.0], [1.0]]
        reach[:, self._joint[self._main]] = ends
        return np.clip(reach, *self._torque_range)

    def for_torque(
        self,
        torque: Float64[np.ndarray, " nj"],
        q: Float64[np.ndarray, " nj"],
        v: Float64[np.ndarray, " nj"],
    ) -> Float64[np.ndarray, " nu"]:
        """Controls that give the joints torques, as far as the ranges of controls allow."""
        force = np.where(self._main, torque[self._joint] / self._gear, 0.0)
        gain, bias = self._line(q, v)
        return np.clip((force - bias) / gain, *self._control_range)

    def for_motion(
        self,
        target: Float64[np.ndarray, " nj"],
        velocity: Float64[np.ndarray, " nj"],
        q: Float64[np.ndarray, " nj"],
    ) -> Float64[np.ndarray, " nu"]:
        """Controls with which servos follow positions and velocities."""
        gain, _ = self._line(q, velocity)
        _, bias = self._line(target, velocity)
        rate = self._gear * velocity[self._joint]
        return np.clip(np.where(self._integrates, rate, -bias / gain), *self._control_range)

    def lead(self, torque: Float64[np.ndarray, " nj"]) -> Float64[np.ndarray, " nj"]:
        """Return the lead of servo targets over resting joints that gives them their torques."""
        stiffness = np.zeros(len(torque))
        stiffness[self._joint[self._main]] = (-self._bias[1] * self._gear**2)[self._main]
        return np.divide(torque, stiffness, out=np.zeros(len(torque)), where=stiffness != 0.0)

    def end_of_step(
        self, v: Float64[np.ndarray, " nj"], acceleration: Float64[np.ndarray, " nj"] | None
    ) -> Float64[np.ndarray, " nj"]:
        """Velocity with which the integrator evaluates the damping of actuators [rad/s]."""
        return v if acceleration is None or self._step == 0.0 else v + self._step * acceleration

    def torques(
        self,
        controls: Float64[np.ndarray, " nu"],
        q: Float64[np.ndarray, " nj"],
        v: Float64[np.ndarray, " nj"],
    ) -> Float64[np.ndarray, " nj"]:
        """Return the joints' torques of controls, all ranges included [N m]."""
        each = self._torques_by_actuator(controls, q, v)
        together = np.bincount(self._joint, each, minlength=len(q))
        return np.clip(together, *self._torque_range)

    def write(
        self,
        controls: Float64[np.ndarray, " nu"],
        torque: Float64[np.ndarray, " nj"],
        data: mujoco.MjData,
    ) -> None:
        """Puts controls into MuJoCo's data, and the torques of joints without an actuator."""
        data.ctrl[self._ctrl] = controls
        data.qfrc_applied[self._dofs] = torque[self.unactuated]

    def _at_joints(self, value: Float64[np.ndarray, " nu"]) -> Float64[np.ndarray, " nj"]:
        """A quantity of the actuators' lengths, such as inertia, as one of the joints."""
        return np.bincount(self._joint, self._gear**2 * value, minlength=len(self._names))

    def _line(
        self, q: Float64[np.ndarray, " nj"], v: Float64[np.ndarray, " nj"]
    ) -> tuple[Float64[np.ndarray, " nu"], Float64[np.ndarray, " nu"]]:
        """Gain g and bias b of f = g u + b."""
        length, rate = self._gear * q[self._joint], self._gear * v[self._joint]
        (g0, g1, g2), (b0, b1, b2) = self._gain, self._bias
        return g0 + g1 * length + g2 * rate, b0 + b1 * length + b2 * rate

    def _torques_by_actuator(
        self,
        controls: Float64[np.ndarray, " nu"],
        q: Float64[np.ndarray, " nj"],
        v: Float64[np.ndarray, " nj"],
    ) -> Float64[np.ndarray, " nu"]:
        gain, bias = self._line(q, v)
        return self._gear * np.clip(gain * controls + bias, *self._force_range)

    def _strongest(self) -> Bool[np.ndarray, " nu"]:
        """The actuator of each joint that its torque is asked of."""
        middle = np.zeros(len(self._names))
        ends = [self._torques_by_actuator(u, middle, middle) for u in self._control_range]
        width = np.abs(ends[1] - ends[0])
        main = np.zeros(len(width), dtype=np.bool_)
        for joint in set(self._joint.tolist()):
            own = np.flatnonzero(self._joint == joint)
            main[own[np.argmax(width[own])]] = True
        return main


def _range(
    limited: Bool[np.ndarray, " n"], span: Float64[np.ndarray, "n 2"]
) -> Float64[np.ndarray, "2 n"]:
    """Lower and upper limits, infinite where there is none."""
    unlimited = np.array([[-np.inf], [np.inf]])
    return np.where(limited.astype(np.bool_), span.T, unlimited)


def _actuators_of(model: mujoco.MjModel, joints: Sequence[int]) -> list[tuple[int, int]]:
    """Actuators on joints, each with the place of its joint in `joints`."""
    place = {joint: k for k, joint in enumerate(joints)}
    off = [group for group in range(_GROUPS) if model.opt.disableactuator >> group & 1]
    return [
        (i, place[joint])
        for i in range(model.nactuator)
        if int(model.actuator_trntype[i]) in _ON_JOINTS
        and (joint := int(model.actuator_trnid[i, 0])) in place
        and int(model.actuator_group[i]) not in off
    ]


def _check_kinds(robot: Robot, model: mujoco.MjModel, found: list[tuple[int, int]]) -> None:
    """Refuses actuators whose force is no linear function of one control."""
    wrong = [
        f"{model.actuator(i).name or i} of joint {robot.joint_names[k]} ({why})"
        for i, k in found
        if (why := _why_not(model, i))
    ]
    if wrong:
        raise RobotError(
            f"a torque or velocity cannot be sent through actuators of robot {robot.name!r}",
            got=wrong,
            wanted="motors, position, velocity or integrated-velocity servos, or general actuators "
            "with fixed or affine gain and no or affine bias",
        )


def _check_others(
    robot: Robot, model: mujoco.MjModel, joints: Sequence[int], ids: list[int]
) -> None:
    """Refuses actuators that pull on the robot's joints through something else than a joint."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    moment = np.zeros((len(data.moment_rownnz), model.nv))
    mujoco.mju_sparse2dense(
        moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
    )
    of_robot = np.abs(moment[:, model.jnt_dofadr[list(joints)]]) > _TOO_LITTLE
    wrong: list[str] = []
    for i in set(range(model.nactuator)) - set(ids):
        first, count = int(model.actuator_outadr[i]), int(model.actuator_outnum[i])
        pulled = np.flatnonzero(of_robot[first : first + count].any(axis=0))
        if len(pulled) and int(model.actuator_trntype[i]) not in _ON_JOINTS:
            names = ", ".join(robot.joint_names[k] for k in pulled)
            wrong.append(f"{model.actuator(i).name or i} on {names}")
    if wrong:
        raise RobotError(
            f"actuators of robot {robot.name!r} pull through tendons, sites or cranks, where a "
            "joint's torque cannot be sent through",
            got=wrong,
            wanted="actuators on the joints themselves",
        )


def _why_not(model: mujoco.MjModel, i: int) -> str:
    if int(model.actuator_plugin[i]) >= 0:
        return "a plugin"
    if int(model.actuator_ctrlnum[i]) != 1:
        return f"{int(model.actuator_ctrlnum[i])} controls"
    if int(model.actuator_dyntype[i]) not in (_STATELESS, _INTEGRATOR, *_FILTERS):
        return "dynamics " + mujoco.mjtDyn(int(model.actuator_dyntype[i])).name
    if int(model.actuator_gaintype[i]) not in (_FIXED_GAIN, _AFFINE_GAIN):
        return "gain " + mujoco.mjtGain(int(model.actuator_gaintype[i])).name
    if int(model.actuator_biastype[i]) not in (_NO_BIAS, _AFFINE_BIAS):
        return "bias " + mujoco.mjtBias(int(model.actuator_biastype[i])).name
    if abs(float(model.actuator_gear[int(model.actuator_outadr[i]), 0])) < _TOO_LITTLE:
        return "gear zero"
    if np.abs(model.actuator_gainprm[i, :3]).max() < _TOO_LITTLE:
        return "gain zero"
    return ""
