"""Standing postures for legs of any kind, with tilted hips or five joints too."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.robots._inverse_kinematics import Bounds, Level, inverse_kinematics
from poise.robots._limbs import MARGIN

_KNEES = (0.6, 0.3, 0.9, 1.2)
"""Angles of the knees to try [rad]; a leg of two equal parts is cos(angle / 2) of its length."""

REACHED = 1e-6
"""A stance misses what must hold by no more [m, rad]."""


@dataclass(frozen=True)
class StancePosture:
    """A posture with its residuals: see `find_stance`."""

    q: Float64[np.ndarray, " nq"]
    error: float  # the largest of what must hold and does not [m, rad]
    tilt: float  # of the root link against its upright pose [rad]
    yaw: float  # the largest angle of a foot against straight ahead [rad]
    at_limit: tuple[str, ...]  # leg joints at the margin before a position limit

    @property
    def reached(self) -> bool:
        """True where all that must hold does."""
        return self.error < REACHED


@dataclass(frozen=True)
class StanceGoals:
    """Goals of a stance by priority, each with its Jacobian.

    Level soles on the ground, the CoM over their middle, root or CoM at a height; then an upright
    root and feet side by side about the origin, toes straight ahead.
    """

    model: pin.Model
    soles: Sequence[int]  # frames, left first
    upright: Float64[np.ndarray, "3 3"]  # world_R_base of an upright root
    apart: float  # distance of the feet [m]
    height: float  # [m]
    of_com: bool  # whose height: the CoM's or the root's

    def __call__(self, q: Float64[np.ndarray, " nq"]) -> list[Level]:
        """Errors and Jacobians at a configuration."""
        model, data = self.model, self.model.createData()
        pin.computeJointJacobians(model, data, q)
        J_com = pin.jacobianCenterOfMass(model, data, q)
        world_R_base = data.oMi[1].rotation
        turn = pin.log3(world_R_base.T @ self.upright)
        must: list[Level] = []
        wish: list[Level] = [(turn, np.eye(3, model.nv, k=3))]
        over, J_over = -data.com[0][:2], J_com[:2].copy()
        for side, frame in zip((0.5, -0.5), self.soles, strict=True):
            place = pin.updateFramePlacement(model, data, frame)
            J = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            R, (x, y, z) = place.rotation, place.translation
            # The normal's product with e_z turns a sole level.
            must.append((np.array([-z, R[1, 2], -R[0, 2]]), J[2:5]))
            yaw = math.atan2(R[1, 0], R[0, 0])
            wish.append((np.array([-x, side * self.apart - y, -yaw]), J[[0, 1, 5]]))
            over += 0.5 * place.translation[:2]
            J_over -= 0.5 * J[:2]
        J_root = np.zeros((1, model.nv))
        J_root[0, :3] = world_R_base[2]
        height, J_height = (data.com[0][2], J_com[2:]) if self.of_com else (q[2], J_root)
        must += [(over, J_over), (np.array([self.height - height]), J_height)]
        return [
            (np.concatenate([e for e, _ in level]), np.vstack([J for _, J in level]))
            for level in (must, wish)
        ]

    def solve(
        self, q: Float64[np.ndarray, " nq"], columns: Sequence[int], bounds: Bounds
    ) -> tuple[Float64[np.ndarray, " nq"], Sequence[Level]]:
        """Move base and legs until the goals are met or nothing more is gained."""
        return inverse_kinematics(
            self.model,
            q,
            self,
            columns,
            tolerance=1e-3 * REACHED,
            damping=1e-9,
            step_max=0.2,
            iterations=200,
            bounds=bounds,
        )


def _inner_limits(model: pin.Model) -> Bounds:
    """Position limits with a margin, at most to the middle of a short range."""
    low, high = model.lowerPositionLimit, model.upperPositionLimit
    margin = np.zeros(model.nq)
    margin[7:] = np.minimum(MARGIN, 0.5 * (high[7:] - low[7:]))
    return low + margin, high - margin


def find_stance(
    model: pin.Model,
    soles: Sequence[int],
    legs: Sequence[Sequence[int]],
    upright: Float64[np.ndarray, "3 3"],
    forward: Float64[np.ndarray, "3"],
    apart: float,
    start: Mapping[str, float],
) -> StancePosture:
    """Bend the legs, each its joints from the hip, from `start` [rad] to meet `StanceGoals`."""
    turn = np.stack([forward, np.cross([0.0, 0.0, 1.0], forward), [0.0, 0.0, 1.0]])
    world_R_base = turn @ upright
    bounds = _inner_limits(model)
    q = pin.neutral(model)
    q[3:7] = pin.Quaternion(world_R_base).coeffs()
    data = model.createData()
    axes = pin.computeJointJacobians(model, data, q)[3:]
    pin.updateFramePlacements(model, data)
    sole = min(float(data.oMf[s].translation[2]) for s in soles)
    hip = max(float(data.oMi[leg[0]].translation[2]) for leg in legs)
    for name, angle in start.items():
        if model.existJointName(name):
            q[model.joints[model.getJointId(name)].idx_q] = angle
    q = np.clip(q, *bounds)
    columns = [*range(6), *(model.joints[j].idx_v for leg in legs for j in leg)]
    joints = [(model.names[j], model.joints[j].idx_q) for leg in legs for j in leg]
    found: list[StancePosture] = []
    for knee in _KNEES:
        q[2] = (hip - sole) * math.cos(0.5 * knee) - hip
        goals = StanceGoals(model, soles, world_R_base, apart, float(q[2]), False)
        for bend in (knee, -knee):
            bent = _bent(model, q, axes, legs, bend, bounds)
            bent, ((must, _), (wish, _)) = goals.solve(bent, columns, bounds)
            stance = StancePosture(
                q=bent,
                error=float(np.abs(must).max()),
                tilt=float(np.linalg.norm(wish[:3])),
                yaw=float(np.abs(wish[[5, 8]]).max()),
                at_limit=tuple(n for n, k in joints if not bounds[0][k] < bent[k] < bounds[1][k]),
            )
            if stance.reached and not stance.at_limit:
                return stance
            found.append(stance)
    return min(found, key=lambda s: (not s.reached, 0.0 if s.reached else s.error, len(s.at_limit)))


def _bent(
    model: pin.Model,
    q: Float64[np.ndarray, " nq"],
    axes: Float64[np.ndarray, "3 nv"],
    legs: Sequence[Sequence[int]],
    bend: float,
    bounds: Bounds,
) -> Float64[np.ndarray, " nq"]:
    """The configuration with knees bent as far as limits let them, soles and hips level."""
    q = q.copy()
    for leg in legs:
        lateral = {j: axes[:, model.joints[j].idx_v] for j in leg}
        pitch = [j for j, axis in lateral.items() if abs(axis[1]) > math.hypot(axis[0], axis[2])]
        if len(pitch) < 3:
            continue
        angle = bend
        for joint, part in ((pitch[1], 1.0), (pitch[0], -0.5), (pitch[-1], -0.5)):
            k, sign = model.joints[joint].idx_q, math.copysign(1.0, lateral[joint][1])
            q[k] = np.clip(sign * part * angle, bounds[0][k], bounds[1][k])
            angle = sign * q[k] if joint == pitch[1] else angle
    return q
