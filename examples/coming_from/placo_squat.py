"""The squat of 14_coming_from.py with placo (tried: 0.10.2 with pin 3.8.0)."""

import sys

import numpy as np
import placo

DT, HOME = 0.002, {"hip_pitch": -0.35, "knee": 0.7, "ankle_pitch": -0.35}

robot = placo.RobotWrapper(sys.argv[1], int(placo.Flags.ignore_collisions))
for joint, angle in HOME.items():
    for side in ("left", "right"):
        robot.set_joint(f"{side}_{joint}", angle)
robot.update_kinematics()
start = robot.com_world().copy()

solver = placo.KinematicsSolver(robot)
solver.dt = DT
solver.enable_velocity_limits(True)
for side in ("left", "right"):
    foot = solver.add_frame_task(f"{side}_foot", robot.get_T_world_frame(f"{side}_foot"))
    foot.configure(f"{side}_foot", "hard", 1.0, 1.0)
com = solver.add_com_task(start)
com.configure("com", "soft", 1.0)
pelvis = solver.add_orientation_task("pelvis_link", np.eye(3))
pelvis.configure("pelvis", "soft", 1.0)
posture = solver.add_joints_task()
posture.set_joints({name: robot.get_joint(name) for name in robot.joint_names()})
posture.configure("posture", "soft", 1e-6)

for k in range(round(1.5 / DT)):
    x = min(1.0, (k + 1) * DT)
    com.target_world = start + (3 * x**2 - 2 * x**3) * np.array([0.0, 0.02, -0.05])
    velocity = solver.solve(True) / DT  # to the robot: velocity[6:]
    robot.update_kinematics()

moved = 1e3 * (robot.com_world() - start)
print(f"CoM moved by {moved[0]:.2f} {moved[1]:.2f} {moved[2]:.2f} mm")
for joint in ("left_hip_roll", "left_knee", "right_ankle_pitch"):
    print(f"{joint} {robot.get_joint(joint):.4f} rad")
