"""placo on its nearest equivalent problem: hard physics and contacts above soft weighted tasks.

Needs placo (tried: 0.9.3 with pin 3.7.0) and no Poise.
"""

from importlib.metadata import version
from time import perf_counter, thread_time
from typing import Any

import numpy as np
import placo  # pyright: ignore[reportMissingImports]

_TASK_WEIGHT = 1.0
_POSTURE_WEIGHT = 1e-2
_REGULARISATION = 1e-5
"""Weight of the posture where the stack has none: a unique solution."""


class Peer:
    """placo's dynamics solver, fed with recorded states.

    Hard: base dynamics, still contacts with friction and centre of pressure, torque bounds. Soft:
    CoM, pelvis orientation, poses of the end effectors, posture. placo's joint bounds are left out.
    """

    def __init__(self, urdf: str, run: dict[str, Any]) -> None:
        self.solver = f"placo {version('placo')}/eiquadprog"
        self._run, facts = run, run["facts"]
        self._robot = robot = placo.RobotWrapper(urdf, int(placo.Flags.ignore_collisions))
        if list(robot.joint_names()) != facts["joints"]:
            raise ValueError("the joints are in another order than Poise's")
        for name, inertia, tau in zip(
            facts["joints"], run["armature"], run["tau_max"], strict=True
        ):
            robot.set_rotor_inertia(name, float(inertia))
            robot.set_torque_limit(name, float(tau))
        self._place(0)
        self._solver = solver = placo.DynamicsSolver(robot)
        solver.enable_torque_limits(True)
        self._contacts = [self._add_contact(contact) for contact in facts["contacts"]]
        self._aims: list[tuple[Any, Any]] = []
        for task in facts["tasks"]:
            self._add_task(task)
        if not any(task["kind"] == "posture" for task in facts["tasks"]):
            self._add_posture({"name": "posture", "kp": 0.0, "kd": 0.0}, _REGULARISATION)

    def size(self) -> tuple[int, None]:
        """Unknowns of placo's problem; it does not tell its rows."""
        return len(self._solver.problem.x), None

    def tick(self, index: int) -> tuple[list[float], float, bool]:
        """One timed tick: seconds (total, of the processor, then phases), residual, failure."""
        for task, path in self._aims:
            task.target_world, task.dtarget_world, task.ddtarget_world = path[:, index]
        cpu, begin = thread_time(), perf_counter()
        self._place(index)
        placed = perf_counter()
        result = self._solver.solve(False)
        torque = result.tau
        end = perf_counter()
        cpu = thread_time() - cpu
        seconds = [end - begin, cpu, placed - begin, np.nan, end - placed, np.nan]
        failed = not result.success or not np.isfinite(torque).all()
        return seconds, np.nan if failed else self._residual(result), failed

    def _place(self, index: int) -> None:
        state = self._robot.state
        state.q, state.qd = self._run["q"][index], self._run["v"][index]
        self._robot.update_kinematics()

    def _residual(self, result: Any) -> float:
        """Residual of the base's equation of motion, relative to its nonlinear effects."""
        robot = self._robot
        h = robot.non_linear_effects()[:6]
        base = robot.mass_matrix()[:6] @ result.qdd + h
        for contact, frame in self._contacts:
            jacobian = robot.frame_jacobian(frame, "local")
            base -= jacobian[:, :6].T @ contact.wrench
        return float(np.linalg.norm(base) / max(1.0, np.linalg.norm(h)))

    def _add_contact(self, fact: dict[str, Any]) -> tuple[Any, str]:
        frame = fact["frame"]
        task = self._solver.add_frame_task(frame, self._robot.get_T_world_frame(frame))
        task.configure(frame, "hard", 1.0, 1.0)
        for part in (task.position(), task.orientation()):
            part.kp, part.kd = 0.0, fact["damping"]
        contact = self._solver.add_planar_contact(task)
        contact.length, contact.width = fact["length"], fact["width"]
        contact.mu, contact.unilateral = fact["friction"], True
        return contact, frame

    def _add_task(self, fact: dict[str, Any]) -> None:
        name, solver = fact["name"], self._solver
        if fact["kind"] == "posture":
            self._add_posture(fact, _POSTURE_WEIGHT)
            return
        if fact["kind"] == "com":
            tasks = [solver.add_com_task(self._robot.com_world())]
            self._aims.append((tasks[0], self._run[f"path {name}"]))
        else:
            rotation = self._run[f"rotation {name}"]
            tasks = [solver.add_orientation_task(fact["frame"], rotation)]
            if fact["kind"] == "pose":
                path = self._run[f"path {name}"]
                tasks.append(solver.add_position_task(fact["frame"], path[0, 0]))
                self._aims.append((tasks[1], path))
        for i, task in enumerate(tasks):
            task.configure(f"{name} {i}", "soft", _TASK_WEIGHT)
            task.kp, task.kd = fact["kp"], fact["kd"]

    def _add_posture(self, fact: dict[str, Any], weight: float) -> None:
        task = self._solver.add_joints_task()
        home = self._run["q_home"][7:]
        for name, angle in zip(self._run["facts"]["joints"], home, strict=True):
            task.set_joint(name, float(angle), 0.0, 0.0)
        task.configure("posture", "soft", weight)
        task.kp, task.kd = fact["kp"], fact["kd"]
