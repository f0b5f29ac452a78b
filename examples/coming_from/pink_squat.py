"""The squat of 14_coming_from.py with pink (tried: pin-pink 4.4.0 with pin 4.1.0, daqp 0.11.0)."""

import sys

import numpy as np
import pink
import pinocchio as pin

DT, HOME = 0.002, {"hip_pitch": -0.35, "knee": 0.7, "ankle_pitch": -0.35}

model = pin.buildModelFromUrdf(sys.argv[1], pin.JointModelFreeFlyer())
q = pin.neutral(model)
for joint, angle in HOME.items():
    for side in ("left", "right"):
        q[model.joints[model.getJointId(f"{side}_{joint}")].idx_q] = angle
configuration = pink.Configuration(model, model.createData(), q)
start = pin.centerOfMass(model, configuration.data, q).copy()

feet = [pink.tasks.FrameTask(f"{side}_foot", 1.0, 1.0) for side in ("left", "right")]
com = pink.tasks.ComTask(cost=1.0)
pelvis = pink.tasks.FrameTask("pelvis_link", position_cost=0.0, orientation_cost=1.0)
posture = pink.tasks.PostureTask(cost=1e-3)
for task in (*feet, pelvis, posture):
    task.set_target_from_configuration(configuration)
limits = [pink.limits.ConfigurationLimit(model), pink.limits.VelocityLimit(model)]

for k in range(round(1.5 / DT)):
    x = min(1.0, (k + 1) * DT)
    com.set_target(start + (3 * x**2 - 2 * x**3) * np.array([0.0, 0.02, -0.05]))
    velocity = pink.solve_ik(
        configuration, [com, pelvis, posture], DT, "daqp", limits=limits, constraints=feet
    )
    configuration.integrate_inplace(velocity, DT)  # to the robot: velocity[6:]

moved = 1e3 * (pin.centerOfMass(model, configuration.data, configuration.q) - start)
print(f"CoM moved by {moved[0]:.2f} {moved[1]:.2f} {moved[2]:.2f} mm")
for joint in ("left_hip_roll", "left_knee", "right_ankle_pitch"):
    print(f"{joint} {configuration.q[model.joints[model.getJointId(joint)].idx_q]:.4f} rad")
