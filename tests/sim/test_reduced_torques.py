"""Torques and wrenches of the reduced controller, applied to MuJoCo's own model of the robot."""

import numpy as np
import pinocchio as pin
import pytest
from oracles import near_home
from stances import HUMANOIDS, stances

mujoco = pytest.importorskip("mujoco")

from poise.control import ReducedController  # noqa: E402
from poise.sim import PlantConfig, StateMap  # noqa: E402
from poise.sim._build import build_model  # noqa: E402
from poise.stack import ComTask, FrameTask, MomentumTask, PointContact, Stack, SurfaceContact  # noqa: E402

TOLERANCE = 1e-7


class ForwardDynamics:
    """MuJoCo's accelerations under given torques and wrenches: no contacts, stops or damping."""

    def __init__(self, robot):
        self.robot, self.model = robot, build_model(robot, PlantConfig())
        flags = mujoco.mjtDisableBit
        self.model.opt.disableflags |= (
            flags.mjDSBL_CONSTRAINT | flags.mjDSBL_DAMPER | flags.mjDSBL_SPRING
        )
        self.map, self.data = StateMap(robot, self.model), mujoco.MjData(self.model)

    def acceleration(self, state, torque, wrenches):
        """Generalized acceleration as Pinocchio has it."""
        robot, model, data = self.robot, self.model, self.data
        data.qpos[:] = self.map.qpos(state.q)
        data.qvel[:] = self.map.qvel(state.q, state.v)
        order, base = self.map.dof_order, robot.base_dofs
        data.qfrc_applied[:] = 0.0
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        for site, wrench in wrenches.items():
            linear, angular = np.zeros((3, robot.nv)), np.zeros((3, robot.nv))
            mujoco.mj_jacSite(model, data, linear, angular, model.site(site).id)
            world_R_site = data.site(site).xmat.reshape(3, 3)
            data.qfrc_applied += linear.T @ world_R_site @ wrench[:3]
            if len(wrench) == 6:
                data.qfrc_applied += angular.T @ world_R_site @ wrench[3:]
        data.qfrc_applied[order[base:]] += torque
        mujoco.mj_forward(model, data)
        dv = data.qacc[order]
        if base:
            # The base's linear velocity stands in the world there, and turns with it here.
            world_R_base = pin.Quaternion(state.q[3:7]).toRotationMatrix()
            dv[:3] = world_R_base.T @ data.qacc[:3] - np.cross(state.v[3:6], state.v[:3])
        return dv


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("stance", ["double support", "left support", "hand contact"])
@pytest.mark.parametrize("name", HUMANOIDS)
def test_mujoco_accelerates_as_was_asked_for(get_robot, name, stance):
    robot = get_robot(name)
    frames = stances(robot)[stance]
    contacts = [SurfaceContact(f) if f in robot.soles else PointContact(f) for f in frames]
    free = [FrameTask(h) for h in robot.hands if h not in frames]
    stack = Stack(
        contacts,
        [
            [ComTask(kp=40.0), FrameTask(robot.pelvis, "orientation")],
            free,
            [MomentumTask("angular_xy")],
        ],
    )
    controller, forward = ReducedController(robot, stack), ForwardDynamics(robot)
    asked = 0
    for seed in range(8):
        controller.reset()
        state = near_home(robot, seed, spread=0.1, speed=0.3)
        command = controller.step(state)
        if not command.status.ok:
            continue
        asked += 1
        wanted = command.acceleration
        found = forward.acceleration(state, command.torque, command.wrenches)
        assert np.abs(found - wanted).max() < TOLERANCE * max(1.0, np.abs(wanted).max())
    assert asked >= 6
