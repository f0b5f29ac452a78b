"""The world around the robot: floor, blocks, light, and how things touch."""

import mujoco
import numpy as np
import pinocchio as pin

from poise.robots import Robot
from poise.sim._config import PlantConfig

FLOOR_ONLY = (0, 1)
"""Collision type and affinity of the robot's geometry: it meets the ground, never itself."""

_GROUND = (1, 0)
_CONTACT_IMPEDANCE = (0.95, 0.99, 0.001, 0.5, 2.0)
"""Stiff from the first touch, MuJoCo's solimp: a 100 kg robot sinks in by about 0.01 mm."""

_FRICTION_DIMENSIONS = 3
"""Sliding only: a sole's yaw moment comes from its corners, as it should."""


def add_world(spec: mujoco.MjSpec, robot: Robot, config: PlantConfig) -> None:
    """Add the floor, the blocks, sky and light to the specification.

    A fixed-base robot gets a floor to look at that it cannot touch.
    """
    contype, conaffinity = _GROUND if robot.floating_base else (0, 0)
    surface = {
        "contype": contype,
        "conaffinity": conaffinity,
        "condim": _FRICTION_DIMENSIONS,
        "friction": (config.friction, 0.005, 0.0001),
        "solref": (config.contact_time_constant, 1.0),
        "solimp": _CONTACT_IMPEDANCE,
        # The ground decides how a contact feels, whatever the robot's document says.
        "priority": 1,
    }
    _add_looks(spec)
    slope = np.array([*config.floor_slope, 0.0])
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=(0.0, 0.0, 0.05),
        quat=_exponential(slope),
        material="plant_floor",
        **surface,
    )
    for i, block in enumerate(config.blocks):
        length, width, height = block.size
        pose = pin.SE3ToXYZQUAT(block.pose)
        spec.worldbody.add_geom(
            name=f"block{i}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=(length / 2, width / 2, height / 2),
            pos=pose[:3],
            quat=pose[[6, 3, 4, 5]],  # MuJoCo has w first.
            rgba=(0.55, 0.6, 0.65, 1.0),
            **surface,
        )


def _exponential(rotation_vector: np.ndarray) -> np.ndarray:
    angle = float(np.linalg.norm(rotation_vector))
    quaternion = np.array([1.0, 0.0, 0.0, 0.0])
    if angle > 0.0:
        mujoco.mju_axisAngle2Quat(quaternion, rotation_vector / angle, angle)
    return quaternion


def _add_looks(spec: mujoco.MjSpec) -> None:
    """Light colours, no shadows and no reflections: software rendering is slow enough."""
    spec.add_texture(
        name="plant_sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.93, 0.95, 0.98),
        rgb2=(0.70, 0.78, 0.88),
        width=128,
        height=128,
    )
    spec.add_texture(
        name="plant_checker",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=(0.86, 0.88, 0.90),
        rgb2=(0.76, 0.79, 0.82),
        width=256,
        height=256,
    )
    floor = spec.add_material(
        name="plant_floor", texrepeat=(2.0, 2.0), texuniform=True, reflectance=0.0
    )
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "plant_checker"
    spec.worldbody.add_light(
        name="plant_sun",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=(0.0, 0.0, 4.0),
        dir=(-0.4, 0.3, -1.0),
        diffuse=(0.5, 0.5, 0.5),
        specular=(0.1, 0.1, 0.1),
        castshadow=False,
    )
    spec.visual.headlight.ambient = (0.34, 0.34, 0.34)
    spec.visual.headlight.diffuse = (0.3, 0.3, 0.3)
    spec.visual.headlight.specular = (0.05, 0.05, 0.05)
    # Balls and cylinders of fewer facets than MuJoCo's default: a third off the time of a picture.
    spec.visual.quality.numslices = 20
    spec.visual.quality.numstacks = 10
