"""Dynamics alone: what one evaluation of a state gives, and a check of Newton's second law."""

import numpy as np

import poise

robot = poise.load_robot("humanoid33")
rng = np.random.default_rng(0)
dynamics = poise.Dynamics(robot)
dynamics.update(poise.RobotState(q=robot.q_home, v=0.2 * rng.standard_normal(robot.nv)))
print(f"{robot.name}: {robot.nj} joints, {robot.mass:.1f} kg, CoM at {dynamics.com.round(3)} m")

foot = dynamics.frame(robot.frame_id("left_sole"))
print(f"left sole: at {foot.position.round(3)} m, moving at {foot.velocity[:3].round(3)} m/s")

# In free fall with all motors off, the centre of mass accelerates with gravity and nothing else.
acceleration = np.linalg.solve(dynamics.M, -dynamics.h)
fall = dynamics.com_jacobian @ acceleration + dynamics.com_bias
print(f"CoM acceleration in free fall: {fall.round(6)} m/s^2")
