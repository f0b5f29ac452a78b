"""`ReducedDynamics`: the equation of motion with centroids in place of the unconstrained chain."""

import numpy as np
from jaxtyping import Float64
from scipy.linalg import lapack

from poise.dynamics.dynamics import Dynamics
from poise.dynamics.partition import CENTROID_DIM, HangingChain, Partition
from poise.robots.robot import Robot


class ReducedDynamics:
    """Exact dynamics of a robot with one centroid for each chain that hangs on it freely.

    Equation (14) of Ahn et al. 2024 without the inverse of M. The other joints feel a hanging
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
        J_z: maps dv_u to z.
        Jbar_z: maps z to the dv_u that makes it with the least energy.
        N_z: spans the motions inside the chains that leave z as it is and that nobody else feels,
            J_z N_z = 0, of unit energy: N_z^T M_uu N_z = I. Every dv_u is Jbar_z z + N_z p.
    """

    def __init__(self, robot: Robot, partition: Partition) -> None:
        self.partition = partition
        self._base = slice(0, robot.base_dofs)
        na, nu, nz = partition.na, partition.nu, partition.nz
        self.M: Float64[np.ndarray, "nr nr"] = np.eye(partition.nr)
        self.M_aa: Float64[np.ndarray, "na na"] = self.M[:na, :na]
        self.C: Float64[np.ndarray, "na nz"] = self.M[:na, na:]
        self._C_transposed = self.M[na:, :na]
        self._product = np.zeros((na, nz))
        self.M_au: Float64[np.ndarray, "na nu"] = np.zeros((na, nu))
        self.M_uu: Float64[np.ndarray, "nu nu"] = np.zeros((nu, nu))
        self.h_a: Float64[np.ndarray, " na"] = np.zeros(na)
        self.h_u: Float64[np.ndarray, " nu"] = np.zeros(nu)
        self.J_z: Float64[np.ndarray, "nz nu"] = np.zeros((nz, nu))
        self.Jbar_z: Float64[np.ndarray, "nu nz"] = np.zeros((nu, nz))
        self.N_z: Float64[np.ndarray, "nu np"] = np.zeros((nu, nu - nz))
        self._A: Float64[np.ndarray, "six nu"] = np.zeros((CENTROID_DIM, nu))
        # LAPACK factors column-major arrays in place.
        self._factor = np.zeros((nu, nu), order="F")

    def update(self, dynamics: Dynamics) -> None:
        """Computes everything for a state, in place.

        Args:
            dynamics: the state, up to date.
        """
        a, u = self.partition.a, self.partition.u
        M = dynamics.M
        a.block(a, M, self.M_aa)
        a.entries(dynamics.h, self.h_a)
        if not self.partition.chains:
            return
        a.block(u, M, self.M_au)
        u.block(u, M, self.M_uu)
        u.entries(dynamics.h, self.h_u)
        u.columns(M[self._base] if self._base.stop else dynamics.momentum_matrix, self._A)
        self._find_centroids()
        np.dot(self.M_au, self.Jbar_z, out=self._product)
        self.C[:] = self._product
        self._C_transposed[:] = self._product.T

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
        self.partition.a.columns(jacobian, out)
        if not self.partition.chains:
            return
        parts = [jacobian[:, run].dot(self.Jbar_z[place]) for run, place in self.partition.u.runs]
        out[:, self.partition.na :] = parts[0] if len(parts) == 1 else sum(parts)

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

    def _find_centroids(self) -> None:
        """J_z, Jbar_z and N_z, one chain after the other, from M_uu and the rows of A."""
        # M_uu is symmetric: transposed, it is the column-major array that LAPACK wants.
        self._factor.T[:] = self.M_uu
        factor, failed = lapack.dpotrf(self._factor, lower=1, clean=1, overwrite_a=1)
        if failed:
            self.J_z.fill(np.nan)
            self.Jbar_z.fill(np.nan)
            self.N_z.fill(np.nan)
            return
        # The triangular inverse and products: triangular solves wait for other threads.
        L_inverse = lapack.dtrtri(factor, lower=1, overwrite_c=1)[0]
        for chain in self.partition.chains:
            self._find_centroid(chain, L_inverse[chain.u, chain.u])
        np.dot(self.Jbar_z.T, self.M_uu, out=self.J_z)

    def _find_centroid(self, chain: HangingChain, L_inverse: Float64[np.ndarray, "k k"]) -> None:
        # Orthogonal factors stay orthogonal where A loses rank, and cost nothing in accuracy.
        tilde = self._A[:, chain.u].dot(L_inverse.T)
        packed, tau, _, _ = lapack.dgeqrf(tilde.T, overwrite_a=1)
        # A positive diagonal of R makes Q unique, so that z does not turn over between two ticks.
        signs = np.copysign(1.0, packed.diagonal())
        square = np.zeros(L_inverse.shape, order="F")
        square[:, :CENTROID_DIM] = packed
        Q = L_inverse.T.dot(lapack.dorgqr(square, tau, overwrite_a=1)[0])
        np.multiply(Q[:, :CENTROID_DIM], signs, out=self.Jbar_z[chain.u, chain.z])
        inside = slice(chain.u.start - chain.z.start, chain.u.stop - chain.z.stop)
        self.N_z[chain.u, inside] = Q[:, CENTROID_DIM:]
