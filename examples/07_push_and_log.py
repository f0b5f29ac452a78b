"""Push and log: a heavier plant than the controller knows, noisy sensors, a push, and a log."""

import argparse
from pathlib import Path

import numpy as np

import poise

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="humanoid33", help="a name in `poise robots`, or a file")
parser.add_argument("--seconds", type=float, default=3.0)
parser.add_argument("--log", type=Path, default=Path("push.mcap"), help="open it with Foxglove")
options = parser.parse_args()

robot = poise.load_robot(options.robot)
stack = poise.Stack(
    contacts=[poise.SurfaceContact(sole) for sole in robot.soles],
    levels=[
        [poise.ComTask(kp=20.0), poise.FrameTask("pelvis", axes="orientation", kp=50.0)],
        [poise.PostureTask()],
    ],
)
controller = poise.WholeBodyController(robot, stack)
config = poise.sim.PlantConfig(
    mass_scale=1.03,
    payloads=(poise.sim.PlantConfig.Payload(frame="torso", mass=0.02 * robot.mass),),
    sensors=poise.sim.SensorConfig(joint_velocity_noise=0.005, gyro_noise=0.002),
)
plant = poise.Plant(robot, config, seed=1)
# A tenth of a second, strong enough to change the speed of the whole robot by 0.1 m/s.
plant.push("torso", force=(robot.mass * 0.1 / 0.1, 0.0, 0.0), duration=0.1, start=0.5)

recorder = poise.Recorder(options.log)
for _ in poise.rollout(plant, controller, None, [recorder], duration=options.seconds):
    pass

com = recorder.record["com"]
moved = np.linalg.norm(com - com[0], axis=1)
print(f"fallen: {plant.fallen}; the CoM moved by up to {1e3 * moved.max():.1f} mm")
times, zmp = poise.sim.read_log(options.log).signal("zmp")
print(
    f"{options.log.name}: {len(times)} samples, ZMP x from {zmp[:, 0].min():.3f} m "
    f"to {zmp[:, 0].max():.3f} m"
)
