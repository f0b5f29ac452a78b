"""A robot on a fixed base, simulated by its equation of motion alone, as the papers' studies do."""

from benchmarks.fixed_base.cubic import Cubic
from benchmarks.fixed_base.encoder import Encoder, JointSensors
from benchmarks.fixed_base.gravity import EARTH, Gravity
from benchmarks.fixed_base.loop import CONTROL_DT, Tick, run_loop
from benchmarks.fixed_base.plant import RigidPlant, set_gravity, with_gravity

__all__ = [
    "CONTROL_DT",
    "EARTH",
    "Cubic",
    "Encoder",
    "Gravity",
    "JointSensors",
    "RigidPlant",
    "Tick",
    "run_loop",
    "set_gravity",
    "with_gravity",
]
