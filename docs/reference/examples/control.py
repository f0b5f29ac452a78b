import numpy as np

import poise

robot = poise.load_robot("humanoid33")
stack = poise.default_stack(robot)
state = poise.RobotState(robot.q_home, np.zeros(robot.nv))

# %% WholeBodyController Command
controller = poise.WholeBodyController(robot, stack)
command = controller.step(state)  # a Command
print(command.status, command.torque.shape, command.wrenches["left_sole"])  # [N m], [N, N m]

# %% CommandStatus
if command.status is not poise.CommandStatus.OK:
    print(controller.status().reason)

# %% Controller
assert isinstance(controller, poise.Controller)
controller.set_gains("com", kp=60.0)  # [1/s^2]
print(controller.status())

# %% ReducedController
reduced = poise.ReducedController(robot, poise.default_stack(robot))
assert np.allclose(reduced.step(state).torque, command.torque, atol=1e-3)  # [N m]

# %% OperationalSpaceController RankTreatment
from poise.control import RankTreatment

osf = poise.OperationalSpaceController(
    robot, poise.default_stack(robot), rank=RankTreatment(low=0.02, high=0.1), torque_step=5.0
)
print(osf.step(state).torque)  # changes by 5 N m a tick at most

# %% DifferentialIK
kinematic = poise.DifferentialIK(robot, poise.default_stack(robot), dt=0.005)  # [s]
print(kinematic.step(state).velocity)  # of the joints [rad/s]

# %% make_controller ControllerPlan CONTROLLERS
from poise.control import CONTROLLERS, ControllerPlan, make_controller

print(list(CONTROLLERS))  # the names that a plan may have
plan = ControllerPlan(name="reduced", time_limit=0.002)  # [s]
controller = make_controller(robot, poise.default_stack(robot), plan)
