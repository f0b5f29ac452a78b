"""Pinocchio's model and MuJoCo's, built from one document, are the same robot."""

import numpy as np
import pinocchio as pin
import pytest

mujoco = pytest.importorskip("mujoco")

from poise.robots import catalog  # noqa: E402
from poise.sim import PlantConfig, StateMap  # noqa: E402
from poise.sim._build import build_model  # noqa: E402

FLOATING = [e.name for e in catalog() if e.description.base == "floating"]
FIXED = [e.name for e in catalog() if e.description.base == "fixed"]
STATES = 10


@pytest.fixture
def both(robot):
    model = build_model(robot, PlantConfig())
    return robot, model, StateMap(robot, model)


def random_state(robot, rng):
    q = robot.q_home.copy()
    q[robot.nq - robot.nj :] = rng.uniform(robot.q_min, robot.q_max)
    if robot.floating_base:
        quaternion = rng.normal(size=4)
        q[:3], q[3:7] = rng.uniform(-1.0, 1.0, 3), quaternion / np.linalg.norm(quaternion)
    return q, rng.uniform(-2.0, 2.0, robot.nv)


def velocity_map(robot, order, q, v):
    """T with v_mujoco = T v_pinocchio, and its derivative: only the base's linear part turns."""
    T, Tdot = np.zeros((robot.nv, robot.nv)), np.zeros((robot.nv, robot.nv))
    T[order, np.arange(robot.nv)] = 1.0
    if robot.floating_base:
        world_R_base = pin.Quaternion(q[3:7]).toRotationMatrix()
        T[:3, :3] = world_R_base
        Tdot[:3, :3] = world_R_base @ pin.skew(v[3:6])
    return T, Tdot


def difference(a, b):
    """Largest difference, relative to the largest entry where that is above one."""
    return np.abs(a - b).max() / max(1.0, np.abs(b).max())


def compare(robot, model, mapping, q, v):
    """Largest differences between both models at a state, by quantity."""
    theirs = mujoco.MjData(model)
    theirs.qpos[:], theirs.qvel[:] = mapping.qpos(q), mapping.qvel(q, v)
    mujoco.mj_forward(model, theirs)
    T, Tdot = velocity_map(robot, mapping.dof_order, q, v)
    M = np.zeros((robot.nv, robot.nv))
    mujoco.mj_fullM(model, theirs, M)
    ours = robot.model.createData()
    pin.computeAllTerms(robot.model, ours, q, v)
    pin.updateFramePlacements(robot.model, ours)
    out = {
        "M": difference(T.T @ M @ T, np.triu(ours.M) + np.triu(ours.M, 1).T),
        "nle": difference(T.T @ (theirs.qfrc_bias + M @ Tdot @ v), ours.nle),
    }
    if robot.floating_base:
        out["com"] = difference(theirs.subtree_com[1], ours.com[0])
    for name in robot.roles:
        linear, angular = np.zeros((3, robot.nv)), np.zeros((3, robot.nv))
        mujoco.mj_jacSite(model, theirs, linear, angular, model.site(name).id)
        frame = robot.frame_id(name)
        J = pin.getFrameJacobian(robot.model, ours, frame, pin.LOCAL_WORLD_ALIGNED)
        out[f"J {name}"] = difference(np.vstack([linear, angular]) @ T, J)
        out[f"p {name}"] = difference(theirs.site(name).xpos, ours.oMf[frame].translation)
    return out


def compare_states(robot, model, mapping):
    rng = np.random.default_rng(20)
    found = {}
    for _ in range(STATES):
        for key, value in compare(robot, model, mapping, *random_state(robot, rng)).items():
            found[key] = max(found.get(key, 0.0), value)
    return found


@pytest.mark.fast_cases(4)
@pytest.mark.parametrize("robot", [*FLOATING, "humanoid20", "humanoid60"], indirect=True)
def test_floating_robots_are_equal_in_both_engines(both):
    found = compare_states(*both)
    assert max(found.values()) < 1e-9, found


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("robot", FIXED, indirect=True)
def test_fixed_robots_are_equal_in_both_engines(both):
    found = compare_states(*both)
    assert max(found.values()) < 1e-9, found


@pytest.mark.parametrize("robot", ["humanoid33"], indirect=True)
def test_the_comparison_sees_a_rotor_inertia_that_is_missing(both):
    robot, model, mapping = both
    model.dof_armature[:] = 0.0
    assert compare_states(robot, model, mapping)["M"] > 1e-4
