"""`Partition`: joints that carry contacts, and free chains on them."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from poise.robots import Robot

CENTROID_DIM = 6
"""Coordinates of a centroid, that is of a wrench. Chains of no more joints gain nothing by one."""


@dataclass(frozen=True, kw_only=True)
class FreeChain:
    """The unconstrained joints carried by one body; branches of their own count as one.

    They act on the rest of the robot by one wrench on that body, so that one centroid stands in for
    all of them exactly. Joints on two bodies with a joint between them need two.

    Attributes:
        body: the joint that carries the body: the base's, a constraint chain's, or "universe" on
            a robot with a fixed base.
        joints: names of the joints.
        u: places of the joints in `Partition.u`.
        z: places of the centroid among the centroids.
    """

    body: str
    joints: tuple[str, ...]
    u: slice
    z: slice


@dataclass(frozen=True, kw_only=True, eq=False)
class Partition:
    """The chains of a robot for one set of contacts, section 3.1 of Ahn et al. 2024.

    - virtual chain: the floating base;
    - constraint chain: every joint between the base and a contact. A joint that also carries
      unconstrained ones, such as the waist under a free arm while a hand is in contact (Figure
      1b), belongs here;
    - unconstrained chain: all other joints, as one `FreeChain` for each body they hang on.
      Where six joints or fewer hang on a body they are kept: they stay coordinates of their own,
      because a centroid has as many.

    Coordinates `a` are those of the virtual and the constraint chain with the kept joints, `u` the
    rest, and `z` the centroids, six for each free chain.

    No contact at all leaves the base alone in `a`, and everything else in `u`. Where contacts
    constrain every joint, or leave only kept ones, `u` is empty and the reduced robot is the whole
    one. With a fixed base `a` has no base, and without contacts nothing but kept joints.

    Attributes:
        a: coordinates of `v` of virtual chain, constraint chain and kept joints, in its order.
        u: those of the unconstrained chain, one free chain after the other.
        chains: the free chains, in the order of `u`.
        constraint: names of the joints of the constraint chain.
        kept: names of the unconstrained joints that are kept as they are.
    """

    a: Int64[np.ndarray, " na"]
    u: Int64[np.ndarray, " nu"]
    chains: tuple[FreeChain, ...]
    constraint: tuple[str, ...]
    kept: tuple[str, ...]

    @property
    def unconstrained(self) -> tuple[str, ...]:
        """Names of the joints of `u`, in its order."""
        return tuple(name for chain in self.chains for name in chain.joints)

    @property
    def na(self) -> int:
        """Number of coordinates `a`."""
        return len(self.a)

    @property
    def nu(self) -> int:
        """Number of coordinates `u`."""
        return len(self.u)

    @property
    def nz(self) -> int:
        """Number of coordinates of the centroids."""
        return CENTROID_DIM * len(self.chains)

    @property
    def nr(self) -> int:
        """Number of coordinates of the reduced robot, (a, z)."""
        return self.na + self.nz

    def merge(
        self, a: Float64[np.ndarray, " na"], u: Float64[np.ndarray, " nu"]
    ) -> Float64[np.ndarray, " nv"]:
        """Put entries of `a` and of `u` together in the order of `v`."""
        merged = np.empty(self.na + self.nu)
        merged[self.a], merged[self.u] = a, u
        return merged


class Partitions:
    """The partitions of one robot, each made once.

    Contact sets that constrain the same joints share one partition.

    Args:
        robot: the robot.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._by_joints: dict[frozenset[int], Partition] = {}

    def of(self, frames: Iterable[str]) -> Partition:
        """Return the partition for a set of contacts.

        Args:
            frames: the frames in contact; their order does not matter.

        Returns:
            The same object whenever the same joints are constrained.

        Raises:
            UnknownNameError: the robot has no such frame; the message lists those that exist.
        """
        # The joints between the world and a contact, with universe and floating base.
        model = self._robot.model
        carrying = {0, 1} if self._robot.floating_base else {0}
        for name in sorted(set(frames)):
            joint = model.frames[self._robot.frame_id(name)].parentJoint
            carrying.update(model.supports[joint].tolist())
        key = frozenset(carrying)
        if key not in self._by_joints:
            self._by_joints[key] = _make_partition(self._robot, key)
        return self._by_joints[key]


def _make_partition(robot: Robot, carrying: frozenset[int]) -> Partition:
    free = _free_joints(robot, carrying)
    reduced = {body: joints for body, joints in free.items() if len(joints) > CENTROID_DIM}
    u = [i for joints in reduced.values() for i in joints]
    kept = sorted(i for body, joints in free.items() if body not in reduced for i in joints)
    a = [i for i in range(robot.nv) if i not in set(u)]
    constraint = [i for i in a if i >= robot.base_dofs and i not in set(kept)]
    chains, first = list[FreeChain](), 0
    for k, (body, joints) in enumerate(reduced.items()):
        chains.append(
            FreeChain(
                body=robot.model.names[body],
                joints=_names(robot, joints),
                u=slice(first, first := first + len(joints)),
                z=slice(CENTROID_DIM * k, CENTROID_DIM * (k + 1)),
            )
        )
    return Partition(
        a=_frozen(a),
        u=_frozen(u),
        chains=tuple(chains),
        constraint=_names(robot, constraint),
        kept=_names(robot, kept),
    )


def _frozen(coordinates: list[int]) -> Int64[np.ndarray, " k"]:
    index = np.array(coordinates, dtype=np.int64)
    index.flags.writeable = False
    return index


def _free_joints(robot: Robot, carrying: frozenset[int]) -> dict[int, list[int]]:
    """Find the coordinates of joints that carry no contact, by the body that they hang on."""
    model = robot.model
    body_of: dict[int, int] = {}
    free: dict[int, list[int]] = {}
    # Parents come before their children.
    for joint in range(1, model.njoints):
        if joint not in carrying:
            parent = int(model.parents[joint])
            body = body_of[joint] = body_of.get(parent, parent)
            first = model.idx_vs[joint]
            free.setdefault(body, []).extend(range(first, first + model.nvs[joint]))
    return free


def _names(robot: Robot, coordinates: list[int]) -> tuple[str, ...]:
    return tuple(robot.joint_names[i - robot.base_dofs] for i in coordinates)
