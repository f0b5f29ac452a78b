import tempfile
from pathlib import Path

import mujoco
import numpy as np

import poise

robot = poise.load_robot("biped20")
controller = poise.WholeBodyController(robot)
FOLDER = Path(tempfile.mkdtemp())
MODEL = Path(poise.__file__).parents[2] / "examples" / "models" / "walker12.urdf"

# %% Plant PlantConfig SensorConfig Block
from poise.sim import Block, PlantConfig, SensorConfig

block = Block(center=(2.0, 0.0), size=(0.3, 0.6, 0.05))  # on the floor [m]
config = PlantConfig(control_dt=0.002, sensors=SensorConfig.typical(), blocks=(block,))  # [s]
plant = poise.Plant(robot, config, seed=1)
plant.push("torso", (0.0, 50.0, 0.0), duration=0.1, start=0.05)  # [N], [s]

# %% rollout Recorder RunRecord Tick
recorder = poise.Recorder(FOLDER / "log.mcap")
for tick in poise.rollout(plant, controller, observers=[recorder], duration=0.1):  # a Tick
    assert tick.command.status.ok
record = recorder.record  # a RunRecord
times, torques = record.signal("torque")  # [s], [N m]

# %% read_log
from poise.sim import read_log

record = read_log(FOLDER / "log.mcap")
print(record.names)


# %% Observer
class Count:  # a poise.sim.Observer
    def begin(self, plant, controller, leader):
        self.ticks = 0

    def observe(self, tick):
        self.ticks += 1

    def end(self):
        print(self.ticks)


# %% Body
body: poise.sim.Body = plant
print(body.time, body.state().q[:3], body.fallen)  # [s], [m]

# %% Camera Marker
from poise.sim import Camera, Marker

ball = Marker(position=(0.3, 0.0, 0.5), radius=0.05)  # in the world [m]
with Camera(robot, plant.drawn_model()) as camera:
    pixels = camera.picture(plant.true_state().q, [ball])  # height x width x 3

# %% render_video
from poise.sim import render_video

render_video(plant, *record.signal("q"), FOLDER / "run.mp4")

# %% MujocoBridge
model = plant.model  # or a mujoco.MjModel of your own
data = mujoco.MjData(model)
bridge = poise.sim.MujocoBridge(robot, model)
bridge.place(data)
bridge.apply(controller.step(bridge.state(data)), data)

# %%
for _ in poise.rollout(poise.Plant(robot), controller, observers=[Count()], duration=0.01):
    pass
assert np.isfinite(data.ctrl).all()

# %% MotorConfig
from poise.sim import MotorConfig

drives = PlantConfig(control_dt=0.002, motors=MotorConfig.g1())
g1_motors = [motor.joints for motor in drives.motors.motors]

# %% HoistedPlant
from poise.sim import HoistedPlant

hanging = HoistedPlant(robot, PlantConfig(control_dt=0.002))
hanging.step(None)
