"""What the tests of the operational space formulation share: robots, stacks and oracles."""

import importlib.resources

import mujoco
import numpy as np
import pinocchio as pin
import yaml

from poise.control._osf._rows import OperationalRows, RowScales
from poise.control._rank import PHYSICS_RANK
from poise.dynamics import Dynamics
from poise.robots import load_robot
from poise.sim import PlantConfig, StateMap
from poise.sim._build import build_model
from poise.stack import (
    ComTask,
    FrameTask,
    JointTask,
    MomentumTask,
    PostureTask,
    Stack,
    SurfaceContact,
)

FLOATING = ("humanoid33", "g1")
FIXED = ("arm6", "upper17", "panda", "humanoid33 fixed")


def fixed_base(robot, folder):
    """The same robot with its root link welded to the world, through the public loader."""
    return reload_with(robot, folder, lambda _: {"base": "fixed"})


def reload_with(robot, folder, change):
    """A catalog robot that is made in code or of one file, with some facts changed."""
    path = folder / f"{robot.name}_changed.urdf"
    path.write_text(robot.source.text, encoding="utf-8")
    file = importlib.resources.files("poise.robots") / "descriptions" / f"{robot.name}.yaml"
    facts = yaml.safe_load(file.read_text(encoding="utf-8"))
    del facts["catalog"]
    return load_robot(path, facts | change(facts))


def stack_for(robot, *, friction=0.7):
    """Three or four levels of tasks for a robot of its kind, strict."""
    posture = [PostureTask()]
    if robot.floating_base:
        return Stack(
            [SurfaceContact(sole, friction=friction) for sole in robot.soles],
            [
                [ComTask(), FrameTask(robot.pelvis, "orientation")],
                [FrameTask(robot.hands[0])],
                [FrameTask(robot.hands[1], "position")],
                posture,
            ],
            softening=0.0,
        )
    if len(robot.hands) > 1:
        levels = [[FrameTask(robot.hands[0])], [FrameTask(robot.hands[1], "position")], posture]
        return Stack(levels=levels, softening=0.0)
    hand = robot.hands[0]
    return Stack(
        levels=[[FrameTask(hand, "position")], [FrameTask(hand, "orientation_xy")], posture],
        softening=0.0,
    )


def redundant_stacks(robot):
    """Stacks in which ranks are lost for certain, and which of their levels can be met."""
    contacts = [SurfaceContact(sole) for sole in robot.soles] if robot.floating_base else []
    hand, other = robot.hands[0], robot.hands[-1]
    twice = [FrameTask(hand, "position"), FrameTask(hand, "position", name="again")]
    return {
        "the same task once more": (
            Stack(contacts, [[twice[0]], [twice[1]], [PostureTask()]], softening=0.0),
            [0],
        ),
        "the same task twice in a level": (
            Stack(
                contacts,
                [[FrameTask(hand, "position", name="a"), FrameTask(hand, "position", name="b")]],
                softening=0.0,
            ),
            [],
        ),
        "nothing left": (
            Stack(contacts, [[PostureTask()], [FrameTask(other)], [ComTask()]], softening=0.0),
            [] if contacts else [0],
        ),
        "more rows than freedom": (
            Stack(
                contacts,
                [
                    [FrameTask(hand, "position")],
                    [JointTask(), FrameTask(hand), ComTask(), MomentumTask()],
                    [PostureTask()],
                ],
                softening=0.0,
            ),
            [0],
        ),
    }


class Rows:
    """The rows of a stack at any state, without a controller and its limits."""

    def __init__(self, robot, stack):
        stack.bind(robot)
        scales = RowScales(robot)
        scales.measure(stack)
        self.stack, self.dynamics = stack, Dynamics(robot)
        self.rows = OperationalRows(robot, stack, stack.contacts, scales)

    def at(self, state):
        self.dynamics.update(state)
        self.rows.fill(self.dynamics)
        return self.rows.levels


def random_references(stack, rng, size=1.0):
    for _, task in stack.tasks():
        task.set_acceleration(size * rng.normal(size=task.dim))


def dense_recursion(rows, dynamics, count=None, rank=None):
    """S and N after a number of levels, from eqs (5) to (8), with explicit inverses and projectors.

    Without `rank` it takes a pseudo-inverse, and ranks must be clear-cut. The acceleration is
    S - N M^-1 h.
    """
    M_inverse = np.linalg.inv(dynamics.M)
    N, S = np.eye(len(M_inverse)), np.zeros(len(M_inverse))
    for i, level in enumerate(rows.slices[:count]):
        J = rows.jacobian[level] * rows.scale[level][:, None]
        c = rows.target[level] * rows.scale[level]
        J_p = J @ N
        squares, U = np.linalg.eigh(J_p @ M_inverse @ J_p.T)
        if rank is None:
            U, squares = U[:, squares > 1e-8], squares[squares > 1e-8]
            gain = 1.0 / squares
        else:
            _, gain = (rank if i else PHYSICS_RANK).activate(squares)
        motion, step = M_inverse @ J_p.T @ U, gain * (U.T @ (c - J @ S))
        S = S + motion @ step
        N = N - motion @ (gain[:, None] * U.T) @ J_p
    return S, N


def dense_acceleration(rows, dynamics, **treatment):
    S, N = dense_recursion(rows, dynamics, **treatment)
    return S - N @ np.linalg.solve(dynamics.M, dynamics.h)


def relative(found, wanted):
    return np.abs(found - wanted).max() / np.abs(wanted).max()


def prioritised_singular_values(rows, dynamics):
    """Per level, the singular values of its scaled rows in what the levels above leave."""
    L = np.linalg.cholesky(dynamics.M)
    A = np.linalg.solve(L, (rows.jacobian * rows.scale[:, None]).T).T
    P, found = np.eye(len(L)), []
    for level in rows.slices:
        _, s, Vt = np.linalg.svd(A[level] @ P, full_matrices=False)
        found.append(s)
        kept = Vt[s > 1e-8]
        P = P - kept.T @ kept
    return found


class Mujoco:
    """Forward dynamics of a robot in MuJoCo, without contacts, damping or dry friction."""

    def __init__(self, robot):
        self.robot = robot
        self.model = build_model(robot, PlantConfig())
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
        assert not self.model.dof_damping.any()
        assert not self.model.dof_frictionloss.any()
        self.data, self.map = mujoco.MjData(self.model), StateMap(robot, self.model)

    def acceleration(self, state, force):
        """Generalized acceleration in Pinocchio's coordinates under a generalized force in them."""
        robot, data, (q, v) = self.robot, self.data, (state.q, state.v)
        T, Tdot = np.zeros((robot.nv, robot.nv)), np.zeros((robot.nv, robot.nv))
        T[self.map.dof_order, np.arange(robot.nv)] = 1.0
        if robot.floating_base:
            R = pin.Quaternion(q[3:7]).toRotationMatrix()
            T[:3, :3], Tdot[:3, :3] = R, R @ pin.skew(v[3:6])
        data.qpos[:], data.qvel[:] = self.map.qpos(q), self.map.qvel(q, v)
        data.qfrc_applied[:] = np.linalg.solve(T.T, force)
        mujoco.mj_forward(self.model, data)
        return np.linalg.solve(T, data.qacc - Tdot @ v)

    def site_acceleration(self, name):
        """Classical acceleration [linear; angular] of a site in the world, after `acceleration`."""
        mujoco.mj_rnePostConstraint(self.model, self.data)
        found, site = np.zeros(6), self.model.site(name).id
        kind = mujoco.mjtObj.mjOBJ_SITE
        mujoco.mj_objectAcceleration(self.model, self.data, kind, site, found, 0)
        # MuJoCo counts gravity as an acceleration of the world.
        return np.concatenate((found[3:] + self.model.opt.gravity, found[:3]))


def contact_force(robot, stack, state, wrenches):
    """Generalized force of contact wrenches, with Pinocchio's Jacobians along the frames' axes."""
    force, data = np.zeros(robot.nv), robot.model.createData()
    for contact in stack.contacts:
        if contact.name in wrenches:
            frame = robot.frame_id(contact.frame)
            J = pin.computeFrameJacobian(robot.model, data, state.q, frame, pin.LOCAL)
            force += J[: contact.dim].T @ wrenches[contact.name]
    return force


def missing(task, acceleration):
    """What a task does not get, evaluated at the last state."""
    return task.jacobian @ acceleration + task.drift - task.reference
