"""State estimation: a robot is pushed, and knows its base from its own sensors alone."""

import argparse

import numpy as np

import poise
from poise.estimation import StateEstimator

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="humanoid33", help="a name in `poise robots`, or a file")
parser.add_argument("--seconds", type=float, default=2.0)
options = parser.parse_args()

robot = poise.load_robot(options.robot)
controller = poise.WholeBodyController(robot)
sensors = poise.sim.SensorConfig.typical()
plant = poise.Plant(robot, poise.sim.PlantConfig(control_dt=0.002, sensors=sensors), seed=1)
estimator = StateEstimator(robot)
plant.push(robot.torso, (0.0, 0.1 * robot.weight, 0.0), duration=0.1, start=0.5)

errors, before = [], plant.true_state()
for tick in poise.rollout(plant, controller, estimator=estimator, duration=options.seconds):
    assert estimator.status.ok
    # What is estimated belongs to the tick's begin, `tick.truth` to its end.
    errors.append(tick.estimate.v[:3] - before.v[:3])
    before = tick.truth

print(f"base velocity within {1e3 * np.abs(errors).max():.1f} mm/s of the truth")
print(f"gyro bias {np.degrees(estimator.filter.gyro_bias).round(3)} deg/s")
