"""Robots of one joint: a pendulum at a wall, one on a standing base, a body over one ankle."""

import numpy as np
import pinocchio as pin
import pytest

import poise
from poise import sim
from poise.control import CommandStatus

BODY = """<inertial><mass value="5"/>
<inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>"""
DOCUMENT = """<robot name="one"><link name="base">{}</link>
<link name="arm"><inertial><origin xyz="0 0 -0.3"/><mass value="2"/>
<inertia ixx=".05" iyy=".05" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" velocity="10" effort="50"/></joint>
<link name="tip"/><joint name="end" type="fixed"><parent link="arm"/><child link="tip"/>
<origin xyz="0 0 -0.5"/></joint></robot>"""

FACTS = {"pelvis": "base", "torso": "base", "armature": 0.01}
SOLE = {"length": 0.3, "width": 0.2}
ROBOTS = {
    "at a wall": FACTS | {"base": "fixed"},
    "on a standing base": FACTS
    | {"base": "floating", "soles": {"sole": {"link": "base", "position": [0, 0, -0.6], **SOLE}}},
    "over one ankle": FACTS
    | {"base": "floating", "soles": {"sole": {"link": "tip", "position": [0, 0, 0], **SOLE}}},
}

TORQUE_CONTROLLERS = {
    "direct": poise.WholeBodyController,
    "cascade": lambda robot, stack: poise.WholeBodyController(robot, stack, strategy="cascade"),
    "weighted": lambda robot, stack: poise.WholeBodyController(robot, stack, strategy="weighted"),
    "reduced": poise.ReducedController,
    "osf": lambda robot, stack: poise.OperationalSpaceController(robot, stack, torque_step=np.inf),
}


@pytest.fixture(scope="module", params=ROBOTS)
def robot(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("one") / "one.urdf"
    facts = ROBOTS[request.param]
    path.write_text(DOCUMENT.format("" if facts["base"] == "fixed" else BODY), encoding="utf-8")
    return poise.load_robot(path, description=facts)


def posture_stack(robot):
    contacts = [poise.SurfaceContact(sole) for sole in robot.soles]
    return poise.Stack(contacts=contacts, levels=[[poise.PostureTask(kp=100.0)]])


def leaning(robot):
    """The hinge 0.02 rad off home, everything at rest."""
    q = robot.q_home.copy()
    q[-1] += 0.02
    return poise.RobotState(q, np.zeros(robot.nv))


def test_its_dynamics_have_matrices_of_one_column_or_more(robot):
    dynamics = poise.Dynamics(robot)
    state = poise.RobotState(leaning(robot).q, np.linspace(0.1, 0.4, robot.nv))
    dynamics.update(state)
    model, data = robot.model, robot.model.createData()
    pin.computeCentroidalMomentum(model, data, state.q, state.v)
    assert dynamics.momentum_matrix.shape == (6, robot.nv)
    assert dynamics.com_jacobian.shape == (3, robot.nv)
    np.testing.assert_allclose(dynamics.momentum_matrix @ state.v, data.hg.vector, atol=1e-12)
    np.testing.assert_allclose(dynamics.com_jacobian @ state.v, data.vcom[0], atol=1e-12)


@pytest.mark.parametrize("name", TORQUE_CONTROLLERS)
def test_every_torque_controller_turns_its_joint_as_its_posture_asks(robot, name):
    controller = TORQUE_CONTROLLERS[name](robot, posture_stack(robot))
    state = leaning(robot)
    command = controller.step(state)
    assert command.status is CommandStatus.OK
    assert command.torque.shape == (1,)
    # "weighted" trades levels, the acceleration energy below all tasks among them.
    tolerance = 0.03 if name == "weighted" else 1e-6
    np.testing.assert_allclose(command.acceleration[-1], -100.0 * 0.02, rtol=tolerance)
    dynamics = poise.Dynamics(robot)
    dynamics.update(state)
    force = dynamics.M @ command.acceleration + dynamics.h
    for sole, wrench in command.wrenches.items():
        frame = dynamics.frame(robot.frame_id(sole))
        force -= frame.jacobian.T @ np.kron(np.eye(2), frame.rotation) @ wrench
    # The base has no motors: the residual of its equation is zero.
    np.testing.assert_allclose(force, [*np.zeros(robot.base_dofs), *command.torque], atol=1e-6)


@pytest.mark.parametrize("strategy", ["closed_form", "hqp"])
def test_differential_ik_turns_its_joint_back(robot, strategy):
    dt = 0.001
    controller = poise.DifferentialIK(robot, posture_stack(robot), dt=dt, strategy=strategy)
    command = controller.step(leaning(robot))
    assert command.status is CommandStatus.OK
    # kp / kd with critical damping: 100 / 20.
    np.testing.assert_allclose(command.velocity, [-5.0 * 0.02], rtol=1e-6)


def test_the_default_stacks_of_all_controllers_hold_it(robot):
    for make in (
        poise.WholeBodyController,
        poise.ReducedController,
        poise.OperationalSpaceController,
    ):
        controller = make(robot)
        for _ in range(3):
            command = controller.step(poise.RobotState(robot.q_home, np.zeros(robot.nv)))
        assert command.status is CommandStatus.OK
        np.testing.assert_allclose(command.torque, 0.0, atol=1e-6)


def test_a_batch_answers_as_single_ticks_do(robot):
    state = leaning(robot)
    one = poise.WholeBodyController(robot, posture_stack(robot)).step(state)
    batch = poise.WholeBodyController(robot, posture_stack(robot)).solve_batch([state] * 2)
    np.testing.assert_allclose(batch.torque, [one.torque] * 2, atol=1e-9)


def test_it_is_held_in_a_plant_and_through_a_bridge(robot):
    plant = sim.Plant(robot)
    controller = poise.WholeBodyController(robot)
    for _ in poise.rollout(plant, controller, duration=0.1):
        pass
    np.testing.assert_allclose(plant.true_state().q, robot.q_home, atol=1e-3)
    bridge = sim.MujocoBridge(robot, plant.model)
    np.testing.assert_allclose(bridge.state(plant.data).q, plant.true_state().q, atol=1e-12)
