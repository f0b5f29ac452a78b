"""`Drives`: from torques or velocities of joints to the controls of their actuators."""

from collections.abc import Sequence
from typing import Literal

import mujoco
import numpy as np
from jaxtyping import Bool, Float64

from poise.errors import RobotError
from poise.robots import Robot

Joints = Float64[np.ndarray, " nj"]  # a number for each joint of the robot
Controls = Float64[np.ndarray, " nu"]  # a number for each actuator of one

_INTEGRATOR = mujoco.mjtDyn.mjDYN_INTEGRATOR
_FILTERS = mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT
_ON_JOINTS = mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT
_GAINS = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtGain.mjGAIN_AFFINE
_BIASES = mujoco.mjtBias.mjBIAS_NONE, mujoco.mjtBias.mjBIAS_AFFINE
_IMPLICIT = mujoco.mjtIntegrator.mjINT_IMPLICIT, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
_TOO_LITTLE = 1e-12  # a gain or gear below this is none


class Drives:
    """The actuators of a robot's joints in any MuJoCo model, as linear functions of their controls.

    An actuator of gear r pulls on a joint at q with the force f, which gives the joint the torque
    tau = r f, where f depends on its control u, its length L = r q and the length's rate L':

        f = g u + b,    g = g0 + g1 L + g2 L',    b = b0 + b1 L + b2 L'

    A motor has g0 alone; a position servo g0 = kp, b1 = -kp, b2 = -kv; a velocity servo g0 = kv,
    b2 = -kv. So the control for a torque is u = (tau / r - b) / g at the present L and L'; and the
    one that makes a servo follow q_d and v_d is u = -b / g with b at r q_d and r v_d. Of several
    actuators of one joint the strongest applies the torque; the others get zero force.
    """

    def __init__(
        self,
        robot: Robot,
        model: mujoco.MjModel,
        joints: Sequence[int],
        outputs: Bool[np.ndarray, "noutput nv"],
    ) -> None:
        joints = [*joints]
        dofs = np.array(model.jnt_dofadr[joints], dtype=np.int64)
        ids = _find_actuators(robot, model, joints, outputs[:, dofs])
        self._names = robot.joint_names
        self._joint = np.array([joints.index(j) for j in model.actuator_trnid[ids, 0]], np.int64)
        self._ctrl = np.array(model.actuator_ctrladr[ids], dtype=np.int64)
        self._gear = np.array(model.actuator_gear[model.actuator_outadr[ids], 0])
        self._gain = np.array(model.actuator_gainprm[ids, :3].T)
        self._gain[1:, model.actuator_gaintype[ids] == mujoco.mjtGain.mjGAIN_FIXED] = 0.0
        self._bias = np.array(model.actuator_biasprm[ids, :3].T)
        self._bias[:, model.actuator_biastype[ids] == mujoco.mjtBias.mjBIAS_NONE] = 0.0
        clamped = not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
        self._control_range = _range(
            clamped & model.actuator_ctrllimited[self._ctrl], model.actuator_ctrlrange[self._ctrl]
        )
        self._force_range = _range(model.actuator_forcelimited[ids], model.actuator_forcerange[ids])
        # Range of what all actuators of a joint give together.
        self._torque_range = _range(model.jnt_actfrclimited[joints], model.jnt_actfrcrange[joints])
        kinds = model.actuator_dyntype[ids]
        self._integrates = np.array(kinds == _INTEGRATOR)
        self._main = self._strongest()
        self._step = float(model.opt.timestep) if model.opt.integrator in _IMPLICIT else 0.0
        self.armature = self._at_joints(model.actuator_armature[ids])  # [kg m^2]
        self.damping = self._at_joints(model.actuator_damping[ids])  # besides servos [N m s/rad]
        late = (model.actuator_delay[ids] > 0.0) | np.isin(kinds, _FILTERS)
        self.delayed = tuple(self._names[k] for k in self._joint[late])
        self.unactuated = np.setdiff1d(np.arange(len(joints)), self._joint)
        self._dofs = dofs[self.unactuated]

    def refused(self, kind: Literal["torque", "velocity"]) -> list[str]:
        """Joints that cannot be sent a torque, or a velocity, each with its reason."""
        if kind == "torque":
            wrong, why = self._integrates, "its actuator's control is a velocity"
            without: list[str] = []
        else:
            wrong = ~self._integrates & (self._bias[1:] == 0.0).all(axis=0)
            why = "its actuator is no servo"
            without = [f"{self._names[k]}: no actuator" for k in self.unactuated]
        return [*(f"{self._names[k]}: {why}" for k in self._joint[wrong]), *without]

    def strength(self, q: Joints) -> Float64[np.ndarray, "2 nj"]:
        """Least and greatest torque at rest [N m], infinite for a joint without an actuator."""
        reach = np.full((2, len(q)), np.inf) * [[-1.0], [1.0]]
        reach[:, self._joint[self._main]] = np.sort(self._ends(q), axis=0)[:, self._main]
        return np.clip(reach, *self._torque_range)

    def for_torque(self, torque: Joints, q: Joints, v: Joints) -> Controls:
        """Controls that give the joints torques, as far as the ranges of controls allow."""
        force = np.where(self._main, torque[self._joint] / self._gear, 0.0)
        gain, bias = self._line(q, v)
        return np.clip((force - bias) / gain, *self._control_range)

    def for_motion(self, target: Joints, velocity: Joints, q: Joints) -> Controls:
        """Controls with which servos follow positions and velocities."""
        gain, _ = self._line(q, velocity)
        _, bias = self._line(target, velocity)
        rate = self._gear * velocity[self._joint]
        return np.clip(np.where(self._integrates, rate, -bias / gain), *self._control_range)

    def lead(self, torque: Joints) -> Joints:
        """Lead of servo targets over resting joints that gives these their torques."""
        stiffness = np.zeros(len(torque))
        stiffness[self._joint[self._main]] = (-self._bias[1] * self._gear**2)[self._main]
        return np.divide(torque, stiffness, out=np.zeros(len(torque)), where=stiffness != 0.0)

    def end_of_step(self, v: Joints, acceleration: Joints | None) -> Joints:
        """Velocity at which the integrator evaluates b2 L' [rad/s]; implicit ones at the end."""
        return v if acceleration is None or self._step == 0.0 else v + self._step * acceleration

    def torques(self, controls: Controls, q: Joints, v: Joints) -> Joints:
        """Torques of the joints under controls, all ranges included [N m]."""
        each = self._torques_by_actuator(controls, q, v)
        together = np.bincount(self._joint, each, minlength=len(q))
        return np.clip(together, *self._torque_range)

    def write(self, controls: Controls, torque: Joints, data: mujoco.MjData) -> None:
        """Write controls into MuJoCo's data, and the torques of joints without an actuator."""
        data.ctrl[self._ctrl] = controls
        data.qfrc_applied[self._dofs] = torque[self.unactuated]

    def _at_joints(self, value: Controls) -> Joints:
        return np.bincount(self._joint, self._gear**2 * value, minlength=len(self._names))

    def _line(self, q: Joints, v: Joints) -> tuple[Controls, Controls]:
        """Gain g and bias b of f = g u + b."""
        length, rate = self._gear * q[self._joint], self._gear * v[self._joint]
        (g0, g1, g2), (b0, b1, b2) = self._gain, self._bias
        return g0 + g1 * length + g2 * rate, b0 + b1 * length + b2 * rate

    def _torques_by_actuator(self, controls: Controls, q: Joints, v: Joints) -> Controls:
        gain, bias = self._line(q, v)
        return self._gear * np.clip(gain * controls + bias, *self._force_range)

    def _ends(self, q: Joints) -> Float64[np.ndarray, "2 nu"]:
        """Torques at rest at both ends of the controls' ranges."""
        still = np.zeros_like(q)
        return np.array([self._torques_by_actuator(u, q, still) for u in self._control_range])

    def _strongest(self) -> Bool[np.ndarray, " nu"]:
        """The actuator of each joint that gives its torque."""
        width = np.abs(np.diff(self._ends(np.zeros(len(self._names))), axis=0))[0]
        order = np.lexsort((-width, self._joint))
        first = np.unique(self._joint[order], return_index=True)[1]
        return np.isin(np.arange(len(width)), order[first])


def _range(
    limited: Bool[np.ndarray, " n"], span: Float64[np.ndarray, "n 2"]
) -> Float64[np.ndarray, "2 n"]:
    """Lower and upper limits, infinite where there is none."""
    return np.where(limited.astype(np.bool_), span.T, [[-np.inf], [np.inf]])


def _find_actuators(
    robot: Robot,
    model: mujoco.MjModel,
    joints: list[int],
    pulled: Bool[np.ndarray, "noutput nj"],
) -> list[int]:
    """Actuators on the joints; refuse those that no torque of a joint can be sent through."""
    on_joints = np.flatnonzero(np.isin(model.actuator_trntype, _ON_JOINTS)).tolist()
    ids = [i for i in on_joints if model.actuator_trnid[i, 0] in joints and _is_on(model, i)]
    names = [model.actuator(i).name or str(i) for i in range(model.nactuator)]
    wrong = [
        f"{names[i]} of joint {robot.joint_names[joints.index(model.actuator_trnid[i, 0])]} ({why})"
        for i in ids
        if (why := _why_not(model, i))
    ]
    if wrong:
        raise RobotError(
            f"a torque or velocity cannot be sent through actuators of robot {robot.name!r}",
            got=wrong,
            wanted="motors, position, velocity or integrated-velocity servos, or general actuators "
            "with fixed or affine gain and no or affine bias",
        )
    for i in set(range(model.nactuator)) - set(on_joints):
        first = int(model.actuator_outadr[i])
        ours = np.flatnonzero(pulled[first : first + int(model.actuator_outnum[i])].any(axis=0))
        if len(ours):
            wrong.append(f"{names[i]} on {', '.join(robot.joint_names[k] for k in ours)}")
    if wrong:
        raise RobotError(
            f"actuators of robot {robot.name!r} pull through tendons, sites or cranks, where a "
            "joint's torque cannot be sent through",
            got=wrong,
            wanted="actuators on the joints themselves",
        )
    return ids


def _is_on(model: mujoco.MjModel, i: int) -> bool:
    group = int(model.actuator_group[i])
    # MuJoCo can switch off the groups 0 to 30.
    return not 0 <= group <= 30 or not model.opt.disableactuator >> group & 1


def _why_not(model: mujoco.MjModel, i: int) -> str:
    """Return the reason why a force is no linear function of one control; "" for none."""
    dynamics = mujoco.mjtDyn(int(model.actuator_dyntype[i]))
    gain = mujoco.mjtGain(int(model.actuator_gaintype[i]))
    bias = mujoco.mjtBias(int(model.actuator_biastype[i]))
    known = mujoco.mjtDyn.mjDYN_NONE, _INTEGRATOR, *_FILTERS
    reasons = {
        "a plugin": model.actuator_plugin[i] >= 0,
        f"{int(model.actuator_ctrlnum[i])} controls": model.actuator_ctrlnum[i] != 1,
        f"dynamics {dynamics.name}": dynamics not in known,
        f"gain {gain.name}": gain not in _GAINS,
        f"bias {bias.name}": bias not in _BIASES,
        "gear zero": abs(model.actuator_gear[model.actuator_outadr[i], 0]) < _TOO_LITTLE,
        "gain zero": np.abs(model.actuator_gainprm[i, :3]).max() < _TOO_LITTLE,
    }
    return next((reason for reason, holds in reasons.items() if holds), "")
