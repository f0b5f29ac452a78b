"""mink on its nearest equivalent problem: held feet as equalities, tasks weighted below.

Needs mink and DAQP (tried: mink 1.3.0 with mujoco 4.0.0 and daqp 0.11.0) and no Poise.
"""

import xml.etree.ElementTree as ET
from importlib.metadata import version
from pathlib import Path
from typing import Any

import mink  # pyright: ignore[reportMissingImports]
import mujoco
import numpy as np
from velocity_peer import SOLVER, Package, VelocityPeer


class Peer(VelocityPeer):
    """mink's inverse kinematics."""

    def __init__(self, urdf: str, run: dict[str, Any]) -> None:
        joints = run["facts"]["joints"]
        model = _model(urdf)
        speeds = dict(zip(joints, run["v_max"].tolist(), strict=True))
        q, q_home = (_positions(model, q, joints) for q in (run["q"], run["q_home"][None]))

        def frame_task(frame: str, position: float, orientation: float, gain: float) -> Any:
            return mink.FrameTask(frame, "body", position, orientation, gain=gain)

        def posture_task(cost: float, gain: float, q_home: np.ndarray) -> Any:
            task = mink.PostureTask(model, cost, gain=gain)
            task.set_target(q_home)
            return task

        package = Package(
            solver=f"mink {version('mink')}/{SOLVER}",
            solve=mink.solve_ik,
            no_solution=mink.NoSolutionFound,
            frame_task=frame_task,
            com_task=lambda cost, gain: mink.ComTask(cost, gain=gain),
            posture_task=posture_task,
            pose=lambda rotation, point: mink.SE3.from_rotation_and_translation(
                mink.SO3.from_matrix(rotation), point
            ),
            limits=[mink.ConfigurationLimit(model), mink.VelocityLimit(model, speeds)],
        )
        super().__init__(package, mink.Configuration(model, q[0]), q, q_home[0], run)


def _model(urdf: str) -> Any:
    """The robot on a floating base, every link of it a body."""
    root = ET.fromstring(Path(urdf).read_text(encoding="utf-8"))
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", fusestatic="false")
    spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    spec.worldbody.first_body().add_freejoint()
    return spec.compile()


def _positions(model: Any, q: np.ndarray, joints: list[str]) -> np.ndarray:
    """Configurations as MuJoCo orders them: its quaternion begins with w, its joints have names."""
    places = [int(model.joint(name).qposadr[0]) for name in joints]
    found = np.empty((len(q), model.nq))
    found[:, :3], found[:, 3], found[:, 4:7] = q[:, :3], q[:, 6], q[:, 3:6]
    found[:, places] = q[:, 7:]
    return found
