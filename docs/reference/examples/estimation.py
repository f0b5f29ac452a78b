import numpy as np

import poise
from poise.dynamics import SensorReadings

robot = poise.load_robot("biped20")
readings = SensorReadings(np.zeros(3), np.array([0.0, 0.0, 9.81]), np.zeros(robot.nj))
plant = poise.Plant(robot)
measured = plant.state()
command = poise.WholeBodyController(robot).step(measured)

# %% StateEstimator EstimatorConfig
from poise.estimation import EstimatorConfig, StateEstimator

estimator = StateEstimator(robot, EstimatorConfig(encoder=1e-4))  # [rad]
estimate = estimator.update(measured)  # the base's pose and velocity from sensors

# %% EstimatorStatus
from poise.estimation import EstimatorStatus

if estimator.status is EstimatorStatus.NO_IMU:
    print("nothing of use from the inertial unit")

# %% PayloadEstimator
from poise.estimation import PayloadEstimator

estimator = StateEstimator(robot, payload=PayloadEstimator(robot))
payload = estimator.update(measured).payload  # mass [kg], offset [m]

# %% StatePredictor
from poise.estimation import StatePredictor

predictor = StatePredictor(robot, delay=0.02, period=0.002)  # [s]
now = predictor.predict(measured)  # before leader and controller
predictor.command(command.acceleration)  # after each tick

# %% InvariantFilter
from poise.estimation import InvariantFilter

base = InvariantFilter(contacts=2)
base.start(np.eye(3), np.array([0.0, 0.0, 0.8]))  # orientation, position [m]

# %% MomentumObserver
from poise.estimation import MomentumObserver

observer = MomentumObserver(robot, gain=150.0)  # [1/s]
