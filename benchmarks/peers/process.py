"""`PeerProcess`: a peer's worker in a process of its own, asked for ticks over a pipe.

What it is told: the robot as a URDF without geometry, the run's states and targets.
"""

import json
import select
import subprocess
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.peers.libdwbc import write_libdwbc_handoff
from benchmarks.recording import Recording, bench_stack
from benchmarks.result import PHASES, Ticks, TickTimes
from poise.control import ControllerPlan
from poise.errors import ConfigurationError, PoiseError
from poise.robots import Robot
from poise.stack import ComTask, FrameTask, JointTask, SurfaceContact

FRAME_PREFIX = "role_"
"""Frames with a part to play get links of their own, under a name that no document uses."""

URDF, RUN, RUN_WORDS = "robot.urdf", "run.npz", "run.txt"


def write_handoff(folder: Path, recording: Recording, kind: str) -> None:
    """Writes `robot.urdf` and `run.npz`."""
    robot = recording.robot
    (folder / URDF).write_text(_urdf(robot), encoding="utf-8")
    arrays: dict[str, Any] = {
        "q": np.array([s.q for s in recording.states]),
        "v": np.array([s.v for s in recording.states]),
        "time": np.array([s.time for s in recording.states]),
        "q_home": robot.q_home,
        "tau_max": robot.tau_max,
        "v_max": robot.v_max,
        "armature": np.array(robot.model.armature)[robot.base_dofs :],
    }
    for name, path in recording.paths.items():
        points = np.stack((path.position, path.velocity, path.acceleration))
        arrays[f"path {name}"] = points
    for name, rotation in recording.rotations.items():
        arrays[f"rotation {name}"] = rotation
    facts = json.dumps(_facts(recording, kind))
    np.savez(folder / RUN, facts=np.array(facts), **arrays)


def _facts(recording: Recording, kind: str) -> dict[str, Any]:
    """Joint order, contacts and tasks, with the gains of Poise's own."""
    robot = recording.robot
    stack = bench_stack(robot, kind, recording.stance)
    stack.bind(robot)
    tasks: list[dict[str, Any]] = []
    for _, task in stack.tasks():
        fact = {"name": task.name, "kp": float(task.kp[0]), "kd": float(task.kd[0])}
        if isinstance(task, FrameTask):
            part = "pose" if task.dim == 6 else "orientation"
            tasks.append({**fact, "kind": part, "frame": FRAME_PREFIX + task.frame})
        elif isinstance(task, ComTask):
            tasks.append({**fact, "kind": "com"})
        elif isinstance(task, JointTask):
            tasks.append({**fact, "kind": "posture"})
    contacts = [c for c in stack.contacts if isinstance(c, SurfaceContact)]
    return {
        "joints": robot.joint_names,
        "mass": robot.mass,
        "dt": ControllerPlan().dt,
        "acceleration_max": stack.joint_limit.acceleration_max,
        "contacts": [
            {
                "frame": FRAME_PREFIX + c.frame,
                "friction": c.friction,
                "damping": c.damping,
                "length": robot.soles[c.frame].length - 2.0 * c.margin,
                "width": robot.soles[c.frame].width - 2.0 * c.margin,
            }
            for c in contacts
        ],
        "tasks": tasks,
    }


def _urdf(robot: Robot) -> str:
    """The robot's document without geometry, locked joints welded, with links for its roles."""
    if robot.source.kind != "urdf":
        raise ConfigurationError(
            f"peers read URDF only, and robot {robot.name!r} is not one",
            got=robot.source.kind,
            wanted="a robot from a URDF",
        )
    root = ET.fromstring(robot.source.text)
    for link in root.findall("link"):
        for tag in ("visual", "collision"):
            for element in link.findall(tag):
                link.remove(element)
    for tag in ("transmission", "gazebo", "mujoco"):
        for element in root.findall(tag):
            root.remove(element)
    for joint in root.findall("joint"):
        if joint.get("name") in robot.source.locked_joints:
            joint.set("type", "fixed")
    for role in robot.roles.values():
        name = FRAME_PREFIX + role.name
        ET.SubElement(root, "link", name=name)
        joint = ET.SubElement(root, "joint", name=f"{name}_mount", type="fixed")
        ET.SubElement(joint, "parent", link=role.link)
        ET.SubElement(joint, "child", link=name)
        rpy = Rotation.from_matrix(role.rotation).as_euler("xyz")
        ET.SubElement(joint, "origin", xyz=_words(role.position), rpy=_words(rpy))
    return ET.tostring(root, encoding="unicode")


def _words(vector: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in vector)


PROGRAMS = {"libdwbc": "full", "libdwbc_reduced": "reduced"}
"""Peers that are a program, `libdwbc_peer.cpp`, which is told which way to solve."""

TORQUE_PEERS, VELOCITY_PEERS = ("tsid", "placo", *PROGRAMS), ("mink", "pink")
PEERS = (*TORQUE_PEERS, *VELOCITY_PEERS)
"""Packages that a worker exists for: beside controllers by torques, and beside inverse
kinematics."""


def peer_variable(name: str) -> str:
    """The environment variable that names a peer's interpreter or program."""
    return "POISE_LIBDWBC" if name in PROGRAMS else f"POISE_{name.upper()}_PYTHON"


_WORKER = Path(__file__).with_name("worker.py")

_PATIENCE = 60.0
"""A worker that has not answered for this long is given up [s]."""


class PeerProcess:
    """A peer that ticks on the recorded states when it is asked to; a context manager.

    The worker measures its own ticks, with the same clocks, from state to torques or velocities.

    Args:
        name: one of `PEERS`.
        python: interpreter of the environment that has the peer, or the program.
        recording: the run.
        kind: the stack that its problem should come near to.

    Raises:
        PoiseError: the worker did not start; the message holds its own last words.
    """

    def __init__(self, name: str, python: Path, recording: Recording, kind: str) -> None:
        self.name = name  # name of the peer
        ticks = len(recording.states)
        self._seconds = np.full((ticks, 2 + len(PHASES)), np.nan)
        self._residual = np.zeros(ticks)
        self._failed = np.zeros(ticks, dtype=np.bool_)
        self._folder = tempfile.TemporaryDirectory(prefix="poise-peer-")
        folder = Path(self._folder.name)
        self._process: subprocess.Popen[str] | None = None
        self._words = (folder / "words.txt").open("w+", encoding="utf-8")
        try:
            write_handoff(folder, recording, kind)
            command = [python, _WORKER, name, folder / URDF, folder / RUN]
            if name in PROGRAMS:
                write_libdwbc_handoff(folder / URDF, folder / RUN_WORDS, recording, kind)
                command = [python, PROGRAMS[name], folder / URDF, folder / RUN_WORDS]
            self._process = subprocess.Popen(
                [str(part) for part in command],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._words,
                text=True,
            )
            hello = self._answer()
        except OSError as error:
            self.close()
            raise PoiseError(
                f"peer {name!r} did not start ({error.strerror})", got=str(python)
            ) from None
        except PoiseError:
            self.close()
            raise
        self.solver = str(hello["solver"])  # what it solves with, and its version
        self._size = (hello["variables"], hello["rows"])

    def run(self, first: int, count: int) -> None:
        """Lets the peer do a batch of ticks."""
        if self._process is None or self._process.stdin is None:
            raise PoiseError(f"peer {self.name!r} is closed")
        try:
            self._process.stdin.write(json.dumps({"first": first, "count": count}) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise self._death() from None
        answer = self._answer()
        batch = slice(first, first + count)
        self._seconds[batch] = np.array(answer["seconds"], dtype=np.float64)
        self._residual[batch] = np.array(answer["residuals"], dtype=np.float64)
        self._failed[batch] = answer["failed"]

    def times(self, counted: Ticks) -> TickTimes:
        """Times of the ticks that count."""
        seconds = self._seconds[counted]
        return TickTimes(
            total=seconds[:, 0].copy(), cpu=seconds[:, 1].copy(), phases=seconds[:, 2:].copy()
        )

    def size(self) -> tuple[int, int | None]:
        """Number of unknowns and of rows of the peer's own problem, None where it does not tell."""
        return self._size

    def accuracy(self, counted: Ticks) -> tuple[float | None, int | None, int]:
        """Largest relative residual of its hard rows, None, failed ticks."""
        residual = float(self._residual[counted].max())
        failed = int(self._failed[counted].sum())
        return None if np.isnan(residual) else residual, None, failed

    def close(self) -> None:
        """Ends the worker and removes what it was given."""
        if self._process is not None:
            for pipe in (self._process.stdin, self._process.stdout):
                if pipe is not None:
                    pipe.close()
            try:
                # The end of its input is the worker's sign to go.
                self._process.wait(timeout=5.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            self._process = None
        self._words.close()
        self._folder.cleanup()

    def __enter__(self) -> "PeerProcess":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _answer(self) -> dict[str, Any]:
        process = self._process
        if process is None or process.stdout is None:
            raise PoiseError(f"peer {self.name!r} is closed")
        ready, _, _ = select.select([process.stdout], [], [], _PATIENCE)
        if not ready:
            process.kill()
            raise PoiseError(f"peer {self.name!r} did not answer for {_PATIENCE:g} s")
        line = process.stdout.readline()
        if not line:
            raise self._death()
        answer = json.loads(line)
        if "error" in answer:
            raise PoiseError(f"peer {self.name!r} cannot run: {answer['error']}")
        return answer

    def _death(self) -> PoiseError:
        self._words.flush()
        words = Path(self._words.name).read_text(encoding="utf-8").strip().splitlines()
        last = words[-1].strip() if words else "it said nothing"
        return PoiseError(f"peer {self.name!r} ended unexpectedly: {last}")


_INSTALL = {
    "tsid": '"tsid==1.7.1" "pin==3.4.0" "cmeel-urdfdom<5" "cmeel-tinyxml2<11"',
    "placo": '"placo==0.9.3" "pin==3.7.0" "cmeel-boost<1.88" "cmeel-urdfdom<5" "cmeel-tinyxml2<11"',
    "mink": '"mink==1.3.0" "mujoco==4.0.0" "daqp==0.11.0"',
    "pink": '"pin-pink==4.4.0" "pin==4.1.0" "daqp==0.11.0"',
}
"""What each needs in an environment of its own; the pins are those that were tried."""


def how_to_install(name: str) -> str:
    """Words on timing a peer that was not timed."""
    if name in PROGRAMS:
        return (
            "libdwbc was not timed. docs/benchmarks_peers.md says how its program is built; then:\n"
            "  python -m benchmarks peers --peers libdwbc=peers/libdwbc_peer"
        )
    benchmark = "peers" if name in TORQUE_PEERS else "ik"
    return (
        f"{name} was not timed. It needs an environment of its own:\n"
        f"  python3.11 -m venv peers/{name}\n"
        f"  peers/{name}/bin/pip install {_INSTALL[name]}\n"
        f"  python -m benchmarks {benchmark} --peers {name}=peers/{name}/bin/python"
    )
