import numpy as np

import poise

robot = poise.load_robot("biped20")

# %% Walker walking_stack VelocityLimits WalkSettings
from poise.locomotion import VelocityLimits, WalkSettings, walking_stack

stack = walking_stack(robot)
settings = WalkSettings(search_depth=0.05)  # below the expected ground [m]
walker = poise.Walker(robot, stack, settings=settings, limits=VelocityLimits(ahead=0.4))  # [m/s]
walker.set_velocity(0.3, 0.0, 0.2)  # ahead, left [m/s], turning [rad/s]
controller = poise.WholeBodyController(robot, stack)

# %% plan_footsteps Stride Gait Ground FootstepPlan
from poise.locomotion import Gait, Ground, Stride, plan_footsteps

gait = Gait(step_time=0.8, swing_height=0.05)  # [s], [m]
plan = plan_footsteps(robot, [Stride(steps=4, length=0.2)], gait, ground=Ground(height=0.0))
walker = poise.Walker(robot, walking_stack(robot), plan=plan)  # plan: a FootstepPlan
print(plan.count, plan.duration)  # steps, [s]

# %% StepTeleoperator ScriptedDevice WayPoint
from poise.locomotion import ScriptedDevice, StepTeleoperator, WayPoint

teleoperator = StepTeleoperator(robot)
points = [WayPoint(at=t, right=(0.0, 0.0, z)) for t, z in ((0.5, 0.0), (1.5, 0.08))]  # [s], [m]
teleoperator.device = ScriptedDevice(points, *teleoperator.estimator.anchors)
controller = teleoperator.controller()

# %%
plant = poise.Plant(robot, poise.sim.PlantConfig(control_dt=0.002))
for _ in poise.rollout(
    plant, controller, teleoperator, estimator=teleoperator.estimator, duration=0.02
):
    pass

# %% TeleopStatus Mode
from poise.locomotion import Mode

status = teleoperator.status  # a TeleopStatus, after the first tick
if status is not None and status.mode is Mode.D:
    print(status.zmp, status.com)  # [m]

# %% OperatorSample TrackedPose BodyCommand
from poise.locomotion import BodyCommand, OperatorSample, TrackedPose

left = TrackedPose((0.0, 0.1, 0.08), clutch=True)  # [m]
bow = BodyCommand(torso=(0.0, 0.2, 0.0))  # roll, pitch, yaw [rad]
sample = OperatorSample(time=0.01, feet=(left, None), body=bow)  # [s]


# %% Device
class Pedals:  # a Device
    def sample(self, time):
        feet = [TrackedPose.of(anchor) for anchor in teleoperator.estimator.anchors]
        return OperatorSample(time, tuple(feet))


# %% TrackedFeet
from poise.locomotion import TrackedFeet

teleoperator.device = TrackedFeet(teleoperator, lambda: sample, scale=0.5)

# %% TeleopParameters teleop_parameters
from dataclasses import replace

from poise.locomotion import teleop_parameters

parameters = teleop_parameters(robot)  # TeleopParameters, scaled to the robot
teleoperator = StepTeleoperator(robot, parameters=replace(parameters, step_max=0.3))  # [m]

# %% HandLeader HandStatus
from poise.locomotion import HandLeader, HandStatus

arms = HandLeader(robot, dt=0.002)  # [s]
stack = walking_stack(robot, arms.task)
held = [status is HandStatus.HELD for status in arms.status]

# %% OperatorGuard
from poise.locomotion import OperatorGuard

guard = OperatorGuard(dt=0.002)  # [s]

# %% ComShifter
from poise.locomotion import ComShifter

shifter = ComShifter(height=0.8, kp=40.0)  # [m], [1/s^2]
com, com_velocity, zmp = np.zeros(2), np.zeros(2), np.array([0.0, 0.05])
print(shifter.acceleration(com, com_velocity, zmp))  # [m/s^2]

# %% PreviewControl
from poise.locomotion import PreviewControl

preview = PreviewControl(height=0.8, dt=0.005, length=320)  # [m], [s], samples
