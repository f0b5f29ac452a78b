"""`find_stance`: joint angles of legs of any kind with level soles and the COM over them.

Hips may have tilted axes and legs five joints: what a leg cannot do is left to what it costs least.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

_CROUCHES = (0.955, 0.93, 0.97, 0.9, 0.86, 0.8)
"""Heights of the hips to try, as parts of that with straight legs; a little bent comes first."""

_BENDS = (0.6, -0.6, 0.25, -0.25, 1.0)
"""Angles of the knees to begin with [rad]; which way a knee bends its limits say first."""

_ITERATIONS = 300
_STEP = 0.15
"""Longest step of a joint in one iteration [rad]."""

_REACHED = 1e-6
"""What must hold is missed by no more [m, rad]."""

_MARGIN = 0.02
"""Distance kept from position limits [rad]."""

_PITCH = 0.7
"""A joint whose axis has this much of the lateral direction bends the leg forward or back."""

_BASE_WEIGHT, _PLACE_WEIGHT, _YAW_WEIGHT = 3.0, 1.0, 0.3
"""An upright root matters more than feet side by side, and these more than toes straight ahead."""


@dataclass(frozen=True)
class Stance:
    """A posture, or how near one came to it.

    Attributes:
        q: the configuration.
        error: the largest of what must hold and does not: level soles, COM over them [m, rad].
        tilt: of the root link against its upright pose [rad].
        yaw: the largest angle of a foot against straight ahead [rad].
        at_limit: joints that stand at the margin before a position limit.
    """

    q: Float64[np.ndarray, " nq"]
    error: float
    tilt: float
    yaw: float
    at_limit: tuple[str, ...]

    @property
    def reached(self) -> bool:
        """Whether all that must hold does."""
        return self.error < _REACHED


def find_stance(
    model: pin.Model,
    soles: Sequence[int],
    legs: Sequence[Sequence[int]],
    upright: Float64[np.ndarray, "3 3"],
    forward: Float64[np.ndarray, "3"],
    apart: float,
    start: Mapping[str, float],
    *,
    ahead: float = 0.0,
) -> Stance:
    """Go from a first guess to level soles side by side with the COM above their middle.

    Two tasks in strict priority: soles level on the ground, COM above their middle and the root's
    height; then, as far as is left, an upright root and feet side by side, straight ahead. Joints
    stay inside their limits.

    Args:
        model: the model with a free base.
        soles: frames of the soles, left first.
        legs: joints of each leg from the hip.
        upright: world_R_base of an upright root.
        forward: horizontal direction that is to become x.
        apart: distance of the feet, side by side [m].
        start: joint positions to begin from [rad].
        ahead: how far the COM is to stand before the soles' middle [m].
    """
    turn = np.stack([forward, np.cross([0.0, 0.0, 1.0], forward), [0.0, 0.0, 1.0]])
    problem = _Problem(model, soles, legs, turn @ upright, apart, ahead)
    q0 = _first(model, start, turn @ upright)
    best: Stance | None = None
    for crouch in _CROUCHES:
        for bend in _BENDS:
            stance = problem.solve(problem.bent(q0, bend), crouch)
            if best is None or _rank(stance) < _rank(best):
                best = stance
            if best.reached and not best.at_limit:
                return best
        if best is not None and best.reached:
            return best
    assert best is not None
    return best


def _rank(stance: Stance) -> tuple[bool, float, int]:
    return not stance.reached, stance.error if not stance.reached else 0.0, len(stance.at_limit)


def _first(
    model: pin.Model, start: Mapping[str, float], world_R_base: Float64[np.ndarray, "3 3"]
) -> Float64[np.ndarray, " nq"]:
    q = pin.neutral(model)
    q[3:7] = pin.Quaternion(world_R_base).coeffs()
    for name, angle in start.items():
        if model.existJointName(name):
            q[model.joints[model.getJointId(name)].idx_q] = angle
    low, high = _span(model)
    q[7:] = np.clip(q[7:], low[7:], high[7:])
    return q


def _span(model: pin.Model) -> tuple[Float64[np.ndarray, " nq"], Float64[np.ndarray, " nq"]]:
    """Position limits with a margin, which a short range leaves out [rad]."""
    # A free base has the largest numbers there are, whose difference is none.
    low = np.maximum(model.lowerPositionLimit, -1e6)
    high = np.minimum(model.upperPositionLimit, 1e6)
    margin = np.minimum(_MARGIN, 0.1 * np.maximum(high - low, 0.0))
    return low + margin, high - margin


class _Problem:
    """The two tasks, with their Jacobians, of one robot."""

    def __init__(
        self,
        model: pin.Model,
        soles: Sequence[int],
        legs: Sequence[Sequence[int]],
        world_R_base: Float64[np.ndarray, "3 3"],
        apart: float,
        ahead: float,
    ) -> None:
        self._model, self._data = model, model.createData()
        self._soles, self._upright, self._apart = list(soles), world_R_base, apart
        self._ahead = np.array([ahead, 0.0, 0.0])
        self._legs = [[int(j) for j in leg] for leg in legs]
        self._columns = [*range(6), *(model.joints[j].idx_v for leg in self._legs for j in leg)]
        self._low, self._high = _span(model)
        q = pin.neutral(model)
        q[3:7] = pin.Quaternion(world_R_base).coeffs()
        pin.framesForwardKinematics(model, self._data, q)
        lowest = min(float(self._data.oMf[s].translation[2]) for s in self._soles)
        hip = max(float(self._data.oMi[leg[0]].translation[2]) for leg in self._legs)
        self._straight, self._leg = -lowest, hip - lowest
        self._knees = [self._pitch_joints(leg) for leg in self._legs]

    def _pitch_joints(self, leg: list[int]) -> list[tuple[int, float]]:
        """Joints of a leg about the lateral axis, and the sign of that axis, at zero."""
        data, found = self._data, list[tuple[int, float]]()
        jacobian = pin.computeJointJacobians(
            self._model, data, _first(self._model, {}, self._upright)
        )
        for joint in leg:
            axis = jacobian[3:, self._model.joints[joint].idx_v]
            if abs(axis[1]) > _PITCH * max(float(np.linalg.norm(axis)), 1e-9):
                found.append((joint, float(np.sign(axis[1]))))
        return found

    def bent(self, q: Float64[np.ndarray, " nq"], bend: float) -> Float64[np.ndarray, " nq"]:
        """The configuration with bent knees, as far as limits let them; bend > 0: knees forward.

        A knee whose limits allow one direction alone bends that way.
        """
        q = q.copy()
        for joints in self._knees:
            if len(joints) < 3:
                continue
            (hip, s_hip), (knee, s_knee), (ankle, s_ankle) = joints[0], joints[1], joints[-1]
            place = self._model.joints[knee].idx_q
            angle = float(np.clip(s_knee * bend, self._low[place], self._high[place]))
            q[place] = angle
            for joint, sign in ((hip, s_hip), (ankle, s_ankle)):
                place = self._model.joints[joint].idx_q
                wanted = -0.5 * sign * s_knee * angle
                q[place] = np.clip(wanted, self._low[place], self._high[place])
        return q

    def solve(self, q: Float64[np.ndarray, " nq"], crouch: float) -> Stance:
        """Damped steps of both tasks in priority, kept inside the limits."""
        q = q.copy()
        height = q[2] = self._straight - (1.0 - crouch) * self._leg
        model, columns = self._model, self._columns
        for _ in range(_ITERATIONS):
            (e1, J1), (e2, J2) = self._tasks(q, height)
            J1, J2 = J1[:, columns], J2[:, columns]
            free = self._free(q, J1, e1)
            J1, J2 = J1 * free, J2 * free
            inverse = J1.T @ np.linalg.inv(J1 @ J1.T + 1e-8 * np.eye(len(J1)))
            step = inverse @ e1
            null = np.eye(len(columns)) - inverse @ J1
            J = J2 @ null
            rest = e2 - J2 @ step
            step = step + null @ (J.T @ np.linalg.solve(J @ J.T + 1e-4 * np.eye(len(J)), rest))
            size = float(np.abs(step).max())
            dq = np.zeros(model.nv)
            dq[columns] = step * min(1.0, _STEP / max(size, 1e-12))
            q = pin.integrate(model, q, dq)
            q[7:] = np.clip(q[7:], self._low[7:], self._high[7:])
            if size < 1e-10:
                break
        return self._stance(q, height)

    def _free(
        self,
        q: Float64[np.ndarray, " nq"],
        J1: Float64[np.ndarray, "m k"],
        e1: Float64[np.ndarray, " m"],
    ) -> Float64[np.ndarray, " k"]:
        """One for each column that may move: a joint at its limit that would go on may not."""
        wanted = J1.T @ e1
        free = np.ones(len(self._columns))
        for k, (column, push) in enumerate(zip(self._columns, wanted, strict=True)):
            if column >= 6:
                at_low = q[column + 1] <= self._low[column + 1] + 1e-9 and push < 0.0
                at_high = q[column + 1] >= self._high[column + 1] - 1e-9 and push > 0.0
                free[k] = 0.0 if at_low or at_high else 1.0
        return free

    def _tasks(self, q: Float64[np.ndarray, " nq"], height: float):
        """What is missing, and the Jacobian that brings it, of what must and what should hold."""
        model, data = self._model, self._data
        pin.computeJointJacobians(model, data, q)
        J_com = pin.jacobianCenterOfMass(model, data, q)
        e1, J1, e2, J2 = [], [], [], []
        middle, J_middle = np.zeros(3), np.zeros((3, model.nv))
        for side, frame in zip((0.5, -0.5), self._soles, strict=True):
            place = pin.updateFramePlacement(model, data, frame)
            J = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            lean = np.cross(place.rotation[:, 2], [0.0, 0.0, 1.0])
            e1 += [-place.translation[2], lean[0], lean[1]]
            J1 += [J[2], J[3], J[4]]
            yaw = float(np.arctan2(place.rotation[1, 0], place.rotation[0, 0]))
            target = np.array([0.0, side * self._apart])
            e2 += [*(_PLACE_WEIGHT * (target - place.translation[:2])), -_YAW_WEIGHT * yaw]
            J2 += [_PLACE_WEIGHT * J[0], _PLACE_WEIGHT * J[1], _YAW_WEIGHT * J[5]]
            middle, J_middle = middle + 0.5 * place.translation, J_middle + 0.5 * J[:3]
        e1 += [*(middle + self._ahead - data.com[0])[:2], height - q[2]]
        J1 += [*(J_com - J_middle)[:2], self._height_row()]
        world_R_base = data.oMi[1].rotation
        e2 += list(_BASE_WEIGHT * (world_R_base @ pin.log3(world_R_base.T @ self._upright)))
        turn = np.zeros((3, model.nv))
        turn[:, 3:6] = _BASE_WEIGHT * world_R_base
        J2 += list(turn)
        return (np.array(e1), np.array(J1)), (np.array(e2), np.array(J2))

    def _height_row(self) -> Float64[np.ndarray, " nv"]:
        row = np.zeros(self._model.nv)
        row[:3] = self._data.oMi[1].rotation[2]
        return row

    def _stance(self, q: Float64[np.ndarray, " nq"], height: float) -> Stance:
        (e1, _), (e2, _) = self._tasks(q, height)
        at_limit: list[str] = []
        for leg in self._legs:
            for joint in leg:
                place = self._model.joints[joint].idx_q
                inside = self._low[place] + 1e-6 < q[place] < self._high[place] - 1e-6
                if not inside:
                    at_limit.append(self._model.names[joint])
        return Stance(
            q=q,
            error=float(np.abs(e1).max()),
            tilt=float(np.linalg.norm(e2[6:])) / _BASE_WEIGHT,
            yaw=float(max(abs(e2[2]), abs(e2[5]))) / _YAW_WEIGHT,
            at_limit=tuple(at_limit),
        )
