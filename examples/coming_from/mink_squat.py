"""The squat of 14_coming_from.py with mink (tried: 1.3.0 with mujoco 4.0.0, daqp 0.11.0)."""

import sys

import mink
import mujoco
import numpy as np

DT, HOME = 0.002, {"hip_pitch": -0.35, "knee": 0.7, "ankle_pitch": -0.35}

spec = mujoco.MjSpec.from_file(sys.argv[1])
spec.worldbody.first_body().add_freejoint()
model = spec.compile()
q = model.qpos0.copy()
for joint, angle in HOME.items():
    for side in ("left", "right"):
        q[model.joint(f"{side}_{joint}").qposadr] = angle
configuration = mink.Configuration(model, q)
start = configuration.data.subtree_com[1].copy()

feet = [mink.FrameTask(f"{side}_foot", "body", 1.0, 1.0) for side in ("left", "right")]
com = mink.ComTask(cost=1.0)
pelvis = mink.FrameTask("pelvis_link", "body", position_cost=0.0, orientation_cost=1.0)
posture = mink.PostureTask(model, cost=1e-3)
for task in (*feet, pelvis, posture):
    task.set_target_from_configuration(configuration)
joints = [model.joint(j).name for j in range(1, model.njnt)]
limits = [
    mink.ConfigurationLimit(model),
    mink.VelocityLimit(model, dict.fromkeys(joints, 10.0)),
]

for k in range(round(1.5 / DT)):
    x = min(1.0, (k + 1) * DT)
    com.set_target(start + (3 * x**2 - 2 * x**3) * np.array([0.0, 0.02, -0.05]))
    velocity = mink.solve_ik(
        configuration, [com, pelvis, posture], DT, "daqp", limits=limits, constraints=feet
    )
    configuration.integrate_inplace(velocity, DT)  # to the robot: velocity[6:]

moved = 1e3 * (configuration.data.subtree_com[1] - start)
print(f"CoM moved by {moved[0]:.2f} {moved[1]:.2f} {moved[2]:.2f} mm")
for joint in ("left_hip_roll", "left_knee", "right_ankle_pitch"):
    print(f"{joint} {configuration.q[model.joint(joint).qposadr[0]]:.4f} rad")
