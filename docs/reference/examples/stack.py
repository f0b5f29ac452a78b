import numpy as np

import poise

robot = poise.load_robot("humanoid33")
state = poise.RobotState(robot.q_home, np.zeros(robot.nv))

# %% Stack SurfaceContact ComTask FrameTask PostureTask
stack = poise.Stack(
    contacts=[poise.SurfaceContact("left_sole"), poise.SurfaceContact("right_sole", friction=0.5)],
    levels=[[poise.ComTask()], [poise.FrameTask("right_hand")], [poise.PostureTask()]],
)
stack.task("com").set_target([0.0, 0.0, 0.85])  # in the world [m]
stack.task("right_hand pose").set_target(position=[0.4, -0.2, 1.1])  # in the world [m]

# %% default_stack
stack = poise.default_stack(robot)
print([(level, task.name) for level, task in stack.tasks()])

# %% Contact
contact = stack.contact("left_sole")  # a Contact
contact.release(0.3)  # unload within 0.3 s
contact.engage(0.3)  # and load again

# %% JointTask
elbow = poise.JointTask(["left_elbow"], kp=100.0)  # [1/s^2]
reach = poise.Stack(levels=[[elbow], [poise.PostureTask()]])
reach.bind(robot)  # a controller does that, too
elbow.set_target([0.5])  # [rad]

# %% RelativeFrameTask
hand = poise.RelativeFrameTask("left_hand", "torso", axes="position")
hand.set_target(position=[0.4, 0.2, 0.0])  # along the torso's axes [m]

# %% MomentumTask
calm = poise.MomentumTask(axes="angular_xy", kd=5.0)
calm.set_target([0.0, 0.0, 0.0])  # [kg m^2/s]

# %% PointContact
fingertip = poise.PointContact("left_hand", friction=0.5)

# %% TorqueLimit JointLimit
gentle = poise.Stack(
    contacts=[poise.SurfaceContact(sole) for sole in robot.soles],
    levels=[[poise.PostureTask()]],
    torque_limit=poise.TorqueLimit(scale=0.5, rate=250.0),  # half the torques; [1/s]
    joint_limit=poise.JointLimit(position_margin=0.05),  # [rad]
)

# %% BalanceLimit SelfCollisionLimit
safe = poise.Stack(
    contacts=[poise.SurfaceContact(sole) for sole in robot.soles],
    levels=[[poise.PostureTask()]],
    balance_limit=poise.BalanceLimit(margin=0.03),  # [m]
    self_collision_limit=poise.SelfCollisionLimit(margin=0.03),  # [m]
)


# %% Leader
class Nod:  # a poise.Leader
    def __init__(self, stack):
        self.stack = stack

    def lead(self, state):
        self.stack.task("com").set_target([0.0, 0.0, 0.85 + 0.02 * np.sin(state.time)])


# %%
poise.WholeBodyController(robot, stack).step(state)
Nod(stack).lead(state)
for tried in (gentle, safe):
    assert poise.WholeBodyController(robot, tried).step(state).status.ok


# %% Task
class Knee(poise.Task):
    def _resolve(self, robot):
        self.column = robot.base_dofs + robot.joint_index("left_knee")
        return 1  # row

    def _evaluate(self, dynamics):
        self.jacobian = np.eye(robot.nv)[[self.column]]
        self.error = 0.8 - dynamics.q[[self.column + 1]]  # [rad]
        self.error_rate = -dynamics.v[[self.column]]
        return np.zeros(1)


# %%
knee = Knee("knee", kp=50.0, kd=None, weight=1.0)
own = poise.Stack([poise.SurfaceContact(s) for s in robot.soles], [[knee], [poise.PostureTask()]])
assert poise.WholeBodyController(robot, own).step(state).status.ok
