"""The plant made different from its description, which the controller keeps."""

import mujoco
import numpy as np

from poise.errors import UnknownNameError
from poise.robots.robot import Robot
from poise.sim.config import PlantConfig
from poise.sim.disturbances import LinkError


def apply_model_error(model: mujoco.MjModel, robot: Robot, config: PlantConfig) -> None:
    """Scale masses and inertias and shift centres of mass in a compiled model.

    Payloads and geometry of our own keep their mass.

    Args:
        model: the compiled model, changed in place.
        robot: the robot, not changed.
        config: says what differs.

    Raises:
        UnknownNameError: a link of the configuration does not exist.
    """
    names = [model.body(i).name for i in range(model.nbody)]
    links = [i for i, name in enumerate(names) if name and name != "world"]
    model.body_mass[links] *= config.mass_scale
    model.body_inertia[links] *= config.mass_scale * config.inertia_scale
    for error in config.link_errors:
        if error.link not in names:
            raise UnknownNameError(
                f"unknown link of robot {robot.name!r}",
                got=error.link,
                choices=[names[i] for i in links],
            )
        _apply_to_link(model, names.index(error.link), error)
    # Quantities derived from the masses (subtree masses, inverse weights) must follow.
    mujoco.mj_setConst(model, mujoco.MjData(model))


def _apply_to_link(model: mujoco.MjModel, body: int, error: LinkError) -> None:
    model.body_mass[body] *= error.mass_scale
    model.body_inertia[body] *= error.mass_scale * error.inertia_scale
    model.body_ipos[body] += np.array(error.com_offset)
    # MuJoCo skips the offset of the inertial frame where a body says it has none.
    model.body_sameframe[body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    model.body_simple[body] = 0
