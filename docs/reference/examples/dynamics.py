import numpy as np

import poise

robot = poise.load_robot("humanoid33")

# %% RobotState SensorReadings
from poise.dynamics import SensorReadings

readings = SensorReadings(
    angular_velocity=np.zeros(3),  # of the inertial unit [rad/s]
    specific_force=np.array([0.0, 0.0, 9.81]),  # at rest upwards [m/s^2]
    torque=np.zeros(robot.nj),  # of the motors [N m]
)
state = poise.RobotState(robot.q_home, np.zeros(robot.nv), time=0.002, readings=readings)

# %% Dynamics
dynamics = poise.Dynamics(robot)
dynamics.update(state)
print(dynamics.M.shape, dynamics.h.shape, dynamics.com)  # [kg, kg m, kg m^2], [N, N m], [m]
hand = dynamics.frame(robot.frame_id("left_hand"))
print(hand.position, hand.jacobian.shape)  # in the world [m]

# %% PayloadEstimate
from poise.dynamics import PayloadEstimate

loaded = PayloadEstimate(mass=2.0, offset=np.zeros(3))  # [kg], first moment's change [m]
state = poise.RobotState(robot.q_home, np.zeros(robot.nv), payload=loaded)

# %% Partitions ReducedDynamics
from poise.dynamics import Partitions, ReducedDynamics

partition = Partitions(robot).of(tuple(robot.soles))  # joints between base and soles; the rest
reduced = ReducedDynamics(robot, partition)
reduced.update(dynamics)

# %% least_jerk
from poise.dynamics import least_jerk

phase, rate, acceleration = least_jerk(time=0.5, start=0.0, duration=1.0)  # 1, [1/s], [1/s^2]
