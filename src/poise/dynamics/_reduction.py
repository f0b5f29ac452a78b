"""`ReducedDynamics`: the equation of motion with centroids in place of the unconstrained chain."""

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled
from poise.dynamics._chain_coordinates import (
    CENTROID_DIM,
    ChainFactors,
    find_coordinates,
    from_coordinates,
    to_coordinates,
)
from poise.dynamics._dynamics import Dynamics
from poise.dynamics._partition import Partition
from poise.robots import Robot


class ReducedDynamics:
    """Exact dynamics of a robot with one centroid for each chain that hangs on it freely.

    Equation (14) of Ahn et al. 2024 without the inverse of M. The other joints feel a free
    chain only through the wrench y = A dv_u, six numbers, that its motion dv_u puts on its body.
    `A` is `M[base, u]`, I_G,uc bJ_G,uc of the paper up to the point of reference; on a fixed base
    it is the chain's part of the centroidal momentum matrix. With the factors

        M_uu = L L^T       A L^-T = R^T Q^T      Q^T Q = I

    the centroid's coordinates are z = Q^T L^T dv_u, and y = R^T z. They are better than y itself:
    their weight in the energy is the identity, where that of y, (A M_uu^-1 A^T)^-1, is infinite for
    a wrench that the chain cannot make, as a straight arm cannot. With `J_z = Q^T L^T` and
    `Jbar_z = L^-T Q` (their product J_z Jbar_z is the identity, and Jbar_z makes z with the least
    energy) and C = M_au Jbar_z, all of this is exact:

        z           = J_z dv_u
        rows a        M_aa dv_a + C z + h_a = S_a tau + J_c,a^T F
        rows u        M_ua dv_a + M_uu dv_u + h_u = tau_u
        energy        dv^T M dv / 2 = [dv_a; z]^T M_r [dv_a; z] / 2 + |dv_u - Jbar_z z|^2_M_uu / 2
                      M_r = [M_aa C; C^T I]
        COM           J_com dv = J_com,a dv_a + J_com,u Jbar_z z

    Rows u keep M_ua dv_a, which (17) of the paper leaves out. The coupling of a and u in the
    energy is C z too: whatever dv_a is, what makes z with the least energy of the whole robot is
    dv_u = Jbar_z z. So a problem that asks nothing else of the unconstrained chain has the same
    solution in (dv_a, z) with the cost M_r as in dv with the cost M.

    One Cholesky factor of M_uu is all there is to invert. It exists wherever the robot cannot
    move without inertia, which is checked when a robot is loaded: joints that carry no mass but
    have a rotor are no trouble. Otherwise, and where the state is not finite, the numbers
    of the centroids are NaN, which every solver refuses. Nothing raises.

    Args:
        robot: the robot.
        partition: its chains for a set of contacts.

    Attributes:
        partition: the chains.
        M: M_r, mass matrix of the reduced robot.
        M_aa: its block of (a, a), a view.
        C: its block of (a, z), a view: the forces on a by z. A centroid's columns of the base's
            rows are its R^T.
        M_au: block of the robot's mass matrix.
        M_uu: block of the robot's mass matrix.
        h_a: nonlinear effects of a [N, N m].
        h_u: nonlinear effects of u [N m].
        factors: what turns motions of u into z and what is left, `to_coordinates`.
    """

    def __init__(self, robot: Robot, partition: Partition) -> None:
        self.partition = part = partition
        na, nu = part.na, part.nu
        self.M: Float64[np.ndarray, "nr nr"] = np.eye(part.nr)
        self.M_aa: Float64[np.ndarray, "na na"] = self.M[:na, :na]
        self.C: Float64[np.ndarray, "na nz"] = self.M[:na, na:]
        self.M_au: Float64[np.ndarray, "na nu"] = np.zeros((na, nu))
        self.M_uu: Float64[np.ndarray, "nu nu"] = np.zeros((nu, nu))
        self.h_a: Float64[np.ndarray, " na"] = np.zeros(na)
        self.h_u: Float64[np.ndarray, " nu"] = np.zeros(nu)
        ends = [(chain.u.start, chain.u.stop) for chain in part.chains]
        self.factors = ChainFactors.allocate(np.array(ends, dtype=np.int64).reshape(-1, 2))
        self._has_base = robot.floating_base
        self._coupled = _carriers(robot, part)
        self._A = np.zeros((CENTROID_DIM, nu))
        self._X = np.zeros((len(self._coupled), nu))

    def update(self, dynamics: Dynamics) -> None:
        """Computes everything for a state, in place.

        Args:
            dynamics: the state, up to date.
        """
        part = self.partition
        if not part.chains:
            part.a.block(part.a, dynamics.M, self.M_aa)
            part.a.entries(dynamics.h, self.h_a)
            return
        _reduce(
            dynamics.M,
            dynamics.h,
            dynamics.M[:CENTROID_DIM] if self._has_base else dynamics.momentum_matrix,
            (part.a.index, part.u.index, self._coupled),
            (self.M, self.M_au, self.M_uu, self.h_a, self.h_u),
            self.factors,
            (self._A, self._X),
        )

    @property
    def Jbar_z(self) -> Float64[np.ndarray, "nu nz"]:
        """Maps z to the dv_u that makes it with the least energy."""
        return self._basis()[:, : self.partition.nz]

    @property
    def N_z(self) -> Float64[np.ndarray, "nu np"]:
        """Spans the motions inside the chains that leave z as it is: J_z N_z = 0.

        Nobody else feels them. They have unit energy, N_z^T M_uu N_z = I. Every dv_u is
        Jbar_z z + N_z p.
        """
        return self._basis()[:, self.partition.nz :]

    @property
    def J_z(self) -> Float64[np.ndarray, "nz nu"]:
        """Maps dv_u to z."""
        return self.Jbar_z.T.dot(self.M_uu)

    def reduced_jacobian(
        self, jacobian: Float64[np.ndarray, "m nv"], out: Float64[np.ndarray, "m nr"]
    ) -> None:
        """Projects a task's Jacobian onto (a, z): [J_a, J_u Jbar_z], as in (22).

        Exact for whatever needs the unconstrained chain through its centroids only: frames
        in `a`, the COM, and the total momentum. Of other tasks it is the part that z has in them.

        Args:
            jacobian: maps `dv`.
            out: receives what maps (dv_a, z).
        """
        part = self.partition
        part.a.columns(jacobian, out)
        if part.chains:
            rows = np.empty((len(jacobian), part.nu))
            part.u.columns(jacobian, rows)
            to_coordinates(rows, self.factors, coordinates := np.empty_like(rows))
            out[:, part.na :] = coordinates[:, : part.nz]

    def reduce(self, dv: Float64[np.ndarray, " nv"]) -> Float64[np.ndarray, " nr"]:
        """Acceleration of the reduced robot, (dv_a, z), of an acceleration of the robot.

        Args:
            dv: acceleration of the robot.
        """
        part = self.partition
        x = np.empty(part.nr)
        part.a.entries(dv, x[: part.na])
        dv_u = np.empty(part.nu)
        part.u.entries(dv, dv_u)
        np.dot(self.J_z, dv_u, out=x[part.na :])
        return x

    def recover(self, x: Float64[np.ndarray, " nr"]) -> Float64[np.ndarray, " nv"]:
        """The acceleration of least energy among those with the same (dv_a, z).

        Args:
            x: acceleration of the reduced robot.

        Returns:
            dv, with dv_u = Jbar_z z.
        """
        na = self.partition.na
        return self.partition.merge(x[:na], self.Jbar_z.dot(x[na:]))

    def forces_a(self, x: Float64[np.ndarray, " nr"]) -> Float64[np.ndarray, " na"]:
        """Rows a: what joint torques and contacts have to bring up together [N, N m].

        Args:
            x: acceleration of the reduced robot.

        Returns:
            M_aa dv_a + C z + h_a, which is S_a tau + J_c,a^T F.
        """
        force = self.M[: self.partition.na].dot(x)
        force += self.h_a
        return force

    def torques_u(
        self, dv_a: Float64[np.ndarray, " na"], dv_u: Float64[np.ndarray, " nu"]
    ) -> Float64[np.ndarray, " nu"]:
        """Rows u: torques of the unconstrained chain, which no contact reaches [N m].

        Args:
            dv_a: acceleration of a, as the reduced robot has it.
            dv_u: acceleration of u.

        Returns:
            M_ua dv_a + M_uu dv_u + h_u, the exact form of (17).
        """
        torque = self.M_uu.dot(dv_u)
        torque += dv_a.dot(self.M_au)
        torque += self.h_u
        return torque

    def _basis(self) -> Float64[np.ndarray, "nu nu"]:
        """[Jbar_z, N_z]."""
        basis = np.empty_like(self.M_uu)
        for column, unit in zip(basis.T, np.eye(len(basis)), strict=True):
            from_coordinates(unit, self.factors, dv_u := np.empty(len(unit)))
            column[:] = dv_u
        return basis


def _carriers(robot: Robot, partition: Partition) -> Int64[np.ndarray, " k"]:
    """Places in `a` of the coordinates that carry a free chain; no others feel it."""
    model = robot.model
    carrying: set[int] = set()
    for chain in partition.chains:
        for joint in model.supports[model.getJointId(chain.body)].tolist():
            carrying.update(range(model.idx_vs[joint], model.idx_vs[joint] + model.nvs[joint]))
    return np.flatnonzero(np.isin(partition.a.index, sorted(carrying)))


_Index = tuple[Int64[np.ndarray, " na"], Int64[np.ndarray, " nu"], Int64[np.ndarray, " k"]]
_Matrices = tuple[
    Float64[np.ndarray, "nr nr"],
    Float64[np.ndarray, "na nu"],
    Float64[np.ndarray, "nu nu"],
    Float64[np.ndarray, " na"],
    Float64[np.ndarray, " nu"],
]


@compiled
def _reduce(
    M: Float64[np.ndarray, "nv nv"],
    h: Float64[np.ndarray, " nv"],
    wrench: Float64[np.ndarray, "six nv"],
    index: _Index,
    matrices: _Matrices,
    factors: ChainFactors,
    scratch: tuple[Float64[np.ndarray, "six nu"], Float64[np.ndarray, "k nu"]],
) -> None:
    a, u, coupled = index
    M_r, M_au, M_uu, h_a, h_u = matrices
    A, X = scratch
    na, nu = len(a), len(u)
    for i in range(na):
        h_a[i] = h[a[i]]
        for j in range(na):
            M_r[i, j] = M[a[i], a[j]]
        for j in range(nu):
            M_au[i, j] = M[a[i], u[j]]
    for i in range(nu):
        h_u[i] = h[u[i]]
        for j in range(nu):
            M_uu[i, j] = M[u[i], u[j]]
        for j in range(CENTROID_DIM):
            A[j, i] = wrench[j, u[i]]
        for j in range(len(coupled)):
            X[j, i] = M_au[coupled[j], i]
    sound = find_coordinates(M_uu, A, X, factors)
    if not sound:
        X[:] = np.nan
        factors.L[:] = np.nan
    for i in range(len(coupled)):
        for k in range(len(M_r) - na):
            value = X[i, factors.order[k]]
            M_r[coupled[i], na + k] = M_r[na + k, coupled[i]] = value
