"""`ReducedDynamics`: the equation of motion with centroids in place of the unconstrained chain.

In the coordinates of a free chain its inertia is one, and its centroid comes first. With M_uu = U
U^T and the rows A of the wrench that the chain puts on its body, reflections Q make A U^-T Q lower
triangular. In the coordinates Q^T U^T dv_u = (z, p) the wrench is that of z alone, and the energy
dv_u^T M_uu dv_u is |z|^2 + |p|^2. Neither U^-1 nor Q is ever made. Rows that map dv_u stand in the
columns of a matrix, side by side, so that one pass turns them all.
"""

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import (
    MemoryBlock,
    allocate,
    compiled,
    factor,
    make_reflection,
    part,
    reflect,
    reflect_columns,
    solve_columns,
    solve_transposed,
    view,
)
from poise.dynamics._dynamics import Dynamics
from poise.dynamics._motion import StateNumbers
from poise.dynamics._partition import CENTROID_DIM, Partition
from poise.robots import Robot


class ChainFactors(MemoryBlock):
    """Factors of the coordinates (z, p) of all free chains of a robot together."""

    chains: Int64[np.ndarray, "chains ends"]  # begin and end of each chain's joints in `u`
    order: Int64[np.ndarray, " nu"]  # place of (z, p) in reflections; z first in their chain
    reach: Int64[np.ndarray, " nu"]  # end in `u` of the joints that hang on each joint
    U: Float64[np.ndarray, "nu nu"]  # factor of M_uu, zero between branches
    V: Float64[np.ndarray, "nz nu"]  # the reflections' vectors
    tau: Float64[np.ndarray, " nz"]  # the reflections' factors
    turned: Float64[np.ndarray, " nu"]  # scratch: input of a reflection


def chain_factors(
    chains: Int64[np.ndarray, "chains 2"], reach: Int64[np.ndarray, " nu"]
) -> ChainFactors:
    """Make room for the chains of a robot."""
    starts = chains[:, :1] + np.arange(CENTROID_DIM)
    inside = np.setdiff1d(np.arange(len(reach)), starts)
    sizes = {"nu": len(reach), "nz": starts.size}
    order = np.concatenate((starts.ravel(), inside))
    return allocate(ChainFactors, sizes, chains=chains, order=order, reach=reach)


@part
def find_coordinates(
    M_uu: Float64[np.ndarray, "nu nu"],
    rows: Float64[np.ndarray, "nu k"],
    factors: ChainFactors,
    shares: Float64[np.ndarray, " k"],
) -> bool:
    """Factor M_uu and turn each chain's wrench into its centroid."""
    if not factor(M_uu, factors.reach, factors.U):
        return False
    solve_columns(factors.U, factors.reach, rows)
    for chain in range(len(factors.chains)):
        first, end = factors.chains[chain]
        for j in range(CENTROID_DIM):
            k, place = CENTROID_DIM * chain + j, first + j
            for i in range(place, end):
                factors.turned[i] = rows[i, j]
            v = factors.V[k]
            factors.tau[k] = make_reflection(factors.turned[place:end], v[place:end])
            reflect_columns(rows, place, end, j, v, factors.tau[k], shares)
    return True


@part
def to_coordinates(
    X: Float64[np.ndarray, "nu m"], factors: ChainFactors, shares: Float64[np.ndarray, " m"]
) -> None:
    """Turn rows that map dv_u into rows that map (z, p), [X Jbar_z, X N_z], in place."""
    solve_columns(factors.U, factors.reach, X)
    for chain in range(len(factors.chains)):
        first, end = factors.chains[chain]
        for j in range(CENTROID_DIM):
            k = CENTROID_DIM * chain + j
            reflect_columns(X, first + j, end, 0, factors.V[k], factors.tau[k], shares)


@part
def from_coordinates(
    zp: Float64[np.ndarray, " nu"], factors: ChainFactors, out: Float64[np.ndarray, " nu"]
) -> None:
    """Find the dv_u of coordinates (z, p): Jbar_z z + N_z p."""
    for i in range(len(zp)):
        out[factors.order[i]] = zp[i]
    for chain in range(len(factors.chains)):
        first, end = factors.chains[chain]
        for j in range(CENTROID_DIM - 1, -1, -1):
            k, place = CENTROID_DIM * chain + j, first + j
            reflect(out[place:end], factors.V[k, place:end], factors.tau[k])
    solve_transposed(factors.U, factors.reach, out)


class ReducedMatrices(MemoryBlock):
    """A `ReducedDynamics` for compiled code."""

    a: Int64[np.ndarray, " na"]  # virtual and constraint chain, and kept joints
    u: Int64[np.ndarray, " nu"]  # coordinates of the unconstrained chain
    carriers: Int64[np.ndarray, " carriers"]  # places in `a` of joints with free chains
    M: Float64[np.ndarray, "nr nr"]  # of the reduced robot
    M_au: Float64[np.ndarray, "na nu"]  # blocks of the robot's mass matrix
    M_uu: Float64[np.ndarray, "nu nu"]
    h_a: Float64[np.ndarray, " na"]  # nonlinear effects
    h_u: Float64[np.ndarray, " nu"]
    factors: ChainFactors  # of the coordinates z and p
    leading: int  # rows of A_G that stand for the base's where there is none
    momenta: Float64[np.ndarray, "nu momenta"]  # scratch: columns are rows of A_G, then of carriers
    shares: Float64[np.ndarray, " momenta"]  # scratch


class ReducedDynamics:
    """Exact dynamics of a robot with one centroid for each chain that hangs on it freely.

    Equation (14) of Ahn et al. 2024 without the inverse of M. A free chain acts on the other joints
    only through the wrench y = A dv_u, six numbers, that its motion dv_u exerts on its body. `A` is
    `M[base, u]`, I_G,uc bJ_G,uc of the paper up to the point of reference; on a fixed base it is
    the chain's part of the centroidal momentum matrix. With the factors

        M_uu = U U^T       A U^-T = R^T Q^T      Q^T Q = I

    the centroid's coordinates are z = Q^T U^T dv_u, and y = R^T z. They are better than y itself:
    their weight in the energy is the identity, where that of y, (A M_uu^-1 A^T)^-1, is infinite for
    a wrench that the chain cannot make, as a straight arm cannot. With `J_z = Q^T U^T` and
    `Jbar_z = U^-T Q` (their product J_z Jbar_z is the identity, and Jbar_z makes z with the least
    energy) and C = M_au Jbar_z, all of this is exact:

        z           = J_z dv_u
        rows a        M_aa dv_a + C z + h_a = S_a tau + J_c,a^T F
        rows u        M_ua dv_a + M_uu dv_u + h_u = tau_u
        energy        dv^T M dv / 2 = [dv_a; z]^T M_r [dv_a; z] / 2 + |dv_u - Jbar_z z|^2_M_uu / 2
                      M_r = [M_aa C; C^T I]
        CoM           J_com dv = J_com,a dv_a + J_com,u Jbar_z z

    Rows u keep M_ua dv_a, which (17) of the paper leaves out. The coupling of a and u in the
    energy is C z too: for any dv_a the least energy of the whole robot for a z is that of
    dv_u = Jbar_z z. So a problem without other rows on the unconstrained chain has the same
    solution in (dv_a, z) with the cost M_r as in dv with the cost M.

    Only the Cholesky factor of M_uu is inverted, which has no entry between branches. It exists
    wherever the robot cannot move without inertia, which is checked when a robot is loaded: a rotor
    without a mass suffices. Otherwise, and where the state is not finite, the numbers of the
    centroids are NaN, which every solver refuses. Nothing raises.

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
        matrices: the same memory for compiled code.
    """

    def __init__(self, robot: Robot, partition: Partition) -> None:
        self.partition = part = partition
        carriers = _carriers(robot, part)
        # On a floating base A is rows of the base, which is among the carriers.
        leading = 0 if robot.floating_base else CENTROID_DIM
        ends = [(chain.u.start, chain.u.stop) for chain in part.chains]
        chains = np.array(ends, dtype=np.int64).reshape(-1, 2)
        sizes = {"na": part.na, "nu": part.nu, "momenta": leading + len(carriers)}
        self.matrices = matrices = allocate(
            ReducedMatrices,
            sizes,
            a=part.a,
            u=part.u,
            carriers=carriers,
            M=np.eye(part.nr),
            factors=chain_factors(chains, reach_of(robot, part.u)),
            leading=leading,
        )
        na = part.na
        self.M: Float64[np.ndarray, "nr nr"] = matrices.M
        self.M_aa: Float64[np.ndarray, "na na"] = self.M[:na, :na]
        self.C: Float64[np.ndarray, "na nz"] = self.M[:na, na:]
        self.M_au: Float64[np.ndarray, "na nu"] = matrices.M_au
        self.M_uu: Float64[np.ndarray, "nu nu"] = matrices.M_uu
        self.h_a: Float64[np.ndarray, " na"] = matrices.h_a
        self.h_u: Float64[np.ndarray, " nu"] = matrices.h_u

    def update(self, dynamics: Dynamics) -> None:
        """Compute everything for a state, in place.

        Args:
            dynamics: the state, up to date.
        """
        _reduce(self.matrices.address, dynamics.numbers.address)

    @property
    def Jbar_z(self) -> Float64[np.ndarray, "nu nz"]:
        """Maps z to its dv_u of least energy."""
        return self._basis()[:, : self.partition.nz]

    @property
    def N_z(self) -> Float64[np.ndarray, "nu np"]:
        """Basis of the motions inside the chains that do not change z: J_z N_z = 0.

        They have unit energy, N_z^T M_uu N_z = I. Every dv_u is Jbar_z z + N_z p.
        """
        return self._basis()[:, self.partition.nz :]

    @property
    def J_z(self) -> Float64[np.ndarray, "nz nu"]:
        """Maps dv_u to z."""
        return self.Jbar_z.T.dot(self.M_uu)

    def reduced_jacobian(
        self, jacobian: Float64[np.ndarray, "m nv"], out: Float64[np.ndarray, "m nr"]
    ) -> None:
        """Project a task's Jacobian onto (a, z): [J_a, J_u Jbar_z], as in (22).

        Exact for rows that depend on the unconstrained chain through its centroids only: frames
        in `a`, the CoM, and the total momentum. Of other tasks it is the part of z.

        Args:
            jacobian: maps `dv`.
            out: receives what maps (dv_a, z).
        """
        part = self.partition
        out[:, : part.na] = jacobian[:, part.a]
        out[:, part.na :] = jacobian[:, part.u].dot(self.Jbar_z)

    def reduce(self, dv: Float64[np.ndarray, " nv"]) -> Float64[np.ndarray, " nr"]:
        """Return the acceleration of the reduced robot, (dv_a, z), of one of the robot.

        Args:
            dv: acceleration of the robot [m/s^2, rad/s^2].

        Returns:
            dv_a [m/s^2, rad/s^2], then z [kg^1/2 m/s^2].
        """
        part = self.partition
        return np.concatenate((dv[part.a], self.J_z.dot(dv[part.u])))

    def recover(self, x: Float64[np.ndarray, " nr"]) -> Float64[np.ndarray, " nv"]:
        """Return the acceleration of least energy among those with the same (dv_a, z).

        Args:
            x: acceleration of the reduced robot: dv_a [m/s^2, rad/s^2], then z [kg^1/2 m/s^2].

        Returns:
            dv, with dv_u = Jbar_z z [m/s^2, rad/s^2].
        """
        na = self.partition.na
        return self.partition.merge(x[:na], self.Jbar_z.dot(x[na:]))

    def forces_a(self, x: Float64[np.ndarray, " nr"]) -> Float64[np.ndarray, " na"]:
        """Return rows a: the sum of joint torques and contact forces [N, N m].

        Args:
            x: acceleration of the reduced robot: dv_a [m/s^2, rad/s^2], then z [kg^1/2 m/s^2].

        Returns:
            M_aa dv_a + C z + h_a, which is S_a tau + J_c,a^T F.
        """
        force = self.M[: self.partition.na].dot(x)
        force += self.h_a
        return force

    def torques_u(
        self, dv_a: Float64[np.ndarray, " na"], dv_u: Float64[np.ndarray, " nu"]
    ) -> Float64[np.ndarray, " nu"]:
        """Return rows u: torques of the unconstrained chain, which no contact reaches [N m].

        Args:
            dv_a: acceleration of a, as the reduced robot has it [m/s^2, rad/s^2].
            dv_u: acceleration of u [m/s^2, rad/s^2].

        Returns:
            M_ua dv_a + M_uu dv_u + h_u, the exact form of (17).
        """
        torque = self.M_uu.dot(dv_u)
        torque += dv_a.dot(self.M_au)
        torque += self.h_u
        return torque

    def _basis(self) -> Float64[np.ndarray, "nu nu"]:
        """Return [Jbar_z, N_z]."""
        turned = np.eye(len(self.M_uu))
        _turn(self.matrices.address, turned, np.empty(len(turned)))
        return turned[self.matrices.factors.order].T


def _carriers(robot: Robot, partition: Partition) -> Int64[np.ndarray, " k"]:
    """Find the places in `a` of the coordinates that carry a free chain."""
    model = robot.model
    carrying: set[int] = set()
    for chain in partition.chains:
        for joint in model.supports[model.getJointId(chain.body)].tolist():
            carrying.update(range(model.idx_vs[joint], model.idx_vs[joint] + model.nvs[joint]))
    return np.flatnonzero(np.isin(partition.a, sorted(carrying)))


def reach_of(robot: Robot, index: Int64[np.ndarray, " k"]) -> Int64[np.ndarray, " k"]:
    """Find, for each coordinate, the end of its subtree among the coordinates."""
    model = robot.model
    trees = [set(robot.model.subtrees[j].tolist()) for j in range(model.njoints)]
    joint_of = np.repeat(np.arange(model.njoints), model.nvs.tolist())[index]
    return np.array(
        [max(k for k, j in enumerate(joint_of) if j in trees[joint]) + 1 for joint in joint_of],
        dtype=np.int64,
    )


@compiled
def _reduce(address: int, state_at: int) -> None:
    matrices = view(ReducedMatrices, address)
    reduce_dynamics(matrices, matrices.momenta, matrices.shares, view(StateNumbers, state_at))


@part
def reduce_dynamics(
    matrices: ReducedMatrices,
    rows: Float64[np.ndarray, "nu k"],
    shares: Float64[np.ndarray, " k"],
    state: StateNumbers,
) -> None:
    """Compute everything for a state, and transform the caller's rows."""
    a, factors, momentum = matrices.a, matrices.factors, state.motion.momentum
    _copy_blocks(matrices, state.M, state.h)
    if len(rows) == 0:
        return
    carriers, leading = matrices.carriers, matrices.leading
    for i in range(len(rows)):
        for j in range(leading):
            rows[i, j] = momentum[matrices.u[i], j]
        for j in range(len(carriers)):
            rows[i, leading + j] = matrices.M_au[carriers[j], i]
    if not find_coordinates(matrices.M_uu, rows, factors, shares):
        rows[:] = np.nan
        factors.U[:] = np.nan
    for j in range(len(carriers)):
        i = carriers[j]
        for k in range(len(matrices.M) - len(a)):
            value = rows[factors.order[k], leading + j]
            matrices.M[i, len(a) + k] = matrices.M[len(a) + k, i] = value


@part
def _copy_blocks(
    matrices: ReducedMatrices, M: Float64[np.ndarray, "nv nv"], h: Float64[np.ndarray, " nv"]
) -> None:
    """Copy blocks of the robot's, but for zeros between branches and where nothing is carried."""
    a, u, reach = matrices.a, matrices.u, matrices.factors.reach
    for i in range(len(a)):
        own, kept = M[a[i]], matrices.M[i]
        matrices.h_a[i] = h[a[i]]
        for j in range(len(a)):
            kept[j] = own[a[j]]
    for i in matrices.carriers:
        own, kept = M[a[i]], matrices.M_au[i]
        for j in range(len(u)):
            kept[j] = own[u[j]]
    for i in range(len(u)):
        own, kept = M[u[i]], matrices.M_uu[i]
        matrices.h_u[i] = h[u[i]]
        for j in range(i, reach[i]):
            kept[j] = matrices.M_uu[j, i] = own[u[j]]


@compiled
def _turn(address: int, X: Float64[np.ndarray, "nu m"], shares: Float64[np.ndarray, " m"]) -> None:
    to_coordinates(X, view(ReducedMatrices, address).factors, shares)
