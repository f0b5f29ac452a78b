"""pink on its nearest equivalent problem: held feet as equalities, tasks weighted below.

Needs pin-pink and DAQP (tried: pin-pink 4.4.0 with pin 4.1.0 and daqp 0.11.0) and no Poise.
"""

from importlib.metadata import version
from typing import Any

import numpy as np
import pink  # pyright: ignore[reportMissingImports]
import pinocchio as pin
from pink import exceptions, limits, tasks  # pyright: ignore[reportMissingImports]
from velocity_peer import SOLVER, Package, VelocityPeer


class Peer(VelocityPeer):
    """pink's inverse kinematics."""

    def __init__(self, urdf: str, run: dict[str, Any]) -> None:
        model = pin.buildModelFromUrdf(urdf, pin.JointModelFreeFlyer())
        if list(model.names)[2:] != run["facts"]["joints"]:
            raise ValueError("the joints are in another order than Poise's")
        model.velocityLimit[6:] = run["v_max"]

        def frame_task(frame: str, position: float, orientation: float, gain: float) -> Any:
            return tasks.FrameTask(frame, position, orientation, gain=gain)

        def posture_task(cost: float, gain: float, q_home: np.ndarray) -> Any:
            task = tasks.PostureTask(cost, gain=gain)
            task.set_target(q_home)
            return task

        package = Package(
            solver=f"pink {version('pin-pink')}/{SOLVER}",
            solve=pink.solve_ik,
            no_solution=exceptions.NoSolutionFound,
            frame_task=frame_task,
            com_task=lambda cost, gain: tasks.ComTask(cost, gain=gain),
            posture_task=posture_task,
            pose=pin.SE3,
            limits=[limits.ConfigurationLimit(model), limits.VelocityLimit(model)],
        )
        configuration = pink.Configuration(model, model.createData(), run["q"][0])
        super().__init__(package, configuration, run["q"], run["q_home"], run)
