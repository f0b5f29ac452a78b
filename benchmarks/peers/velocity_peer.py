"""`VelocityPeer`: what pink and mink, which is modelled on it, have in common; no Poise in it."""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter, thread_time
from typing import Any

import numpy as np

SOLVER = "daqp"

_TASK_COST, _POSTURE_COST = 1.0, 1e-2

_DAMPING = 1e-8
"""Their own of the velocities, against what the tasks leave free."""


@dataclass(frozen=True, kw_only=True)
class Package:
    """Differences between the two."""

    solver: str  # its name and version, and what it solves with
    solve: Callable[..., Any]  # its `solve_ik`
    no_solution: type[Exception]  # what that raises
    # Makes a task of a frame, its costs of position and orientation and its gain
    frame_task: Callable[[str, float, float, float], Any]
    com_task: Callable[[float, float], Any]  # made of a cost and a gain
    # Made of a cost, a gain and a configuration
    posture_task: Callable[[float, float, np.ndarray], Any]
    pose: Callable[[np.ndarray, np.ndarray], Any]  # of a rotation and a point
    limits: list[Any]  # of joint positions and velocities


class VelocityPeer:
    """Inverse kinematics fed with recorded states.

    Hard: feet that stay where they were, joint positions and velocities. Weighted below: CoM,
    orientations, poses of the end effectors, posture. Targets have no velocity here: they lie
    ahead by as much as asks for it.

    Args:
        package: mink or pink.
        configuration: its robot in the first state.
        q: configurations as the package orders them, one a tick.
        q_home: likewise, of the posture.
        run: targets and facts.
    """

    def __init__(
        self,
        package: Package,
        configuration: Any,
        q: np.ndarray,
        q_home: np.ndarray,
        run: dict[str, Any],
    ) -> None:
        self.solver = package.solver  # name and version, and what it solves with
        self._package, self._configuration, self._q = package, configuration, q
        self._dt = run["facts"]["dt"]
        self._contacts = [
            package.frame_task(fact["frame"], _TASK_COST, _TASK_COST, 1.0)
            for fact in run["facts"]["contacts"]
        ]
        for contact in self._contacts:
            contact.set_target_from_configuration(configuration)
        self._aims: list[tuple[Any, np.ndarray, np.ndarray | None]] = []
        self._tasks = [self._task(fact, run, q_home) for fact in run["facts"]["tasks"]]

    def size(self) -> tuple[int, None]:
        """Velocities of the base and the joints; the rows are the package's own affair."""
        return self._configuration.model.nv, None

    def tick(self, index: int) -> tuple[list[float], float, bool]:
        """One timed tick: seconds (total, of the processor, then phases), residual, failure."""
        for task, points, rotation in self._aims:
            point = points[index]
            task.set_target(point if rotation is None else self._package.pose(rotation, point))
        package, q = self._package, self._q[index]
        cpu, begin = thread_time(), perf_counter()
        self._configuration.update(q)
        updated = perf_counter()
        try:
            velocity = package.solve(
                self._configuration,
                self._tasks,
                self._dt,
                SOLVER,
                _DAMPING,
                limits=package.limits,
                constraints=self._contacts,
                safety_break=False,
            )
        except package.no_solution:
            velocity = None
        end, cpu = perf_counter(), thread_time() - cpu
        seconds = [end - begin, cpu, updated - begin, np.nan, end - updated, np.nan]
        return seconds, np.nan if velocity is None else self._residual(velocity), velocity is None

    def _residual(self, velocity: np.ndarray) -> float:
        """Most by which the feet miss what is asked of them, relative to the velocities."""
        left = [
            self._dt * contact.compute_jacobian(self._configuration) @ velocity
            + contact.gain * contact.compute_error(self._configuration)
            for contact in self._contacts
        ]
        scale = max(1.0, float(np.linalg.norm(velocity)))
        return max(float(np.linalg.norm(one)) for one in left) / self._dt / scale

    def _task(self, fact: dict[str, Any], run: dict[str, Any], q_home: np.ndarray) -> Any:
        gain, name, package = self._dt * fact["kp"] / fact["kd"], fact["name"], self._package
        if fact["kind"] == "posture":
            return package.posture_task(_POSTURE_COST, gain, q_home)
        if fact["kind"] == "com":
            task = package.com_task(_TASK_COST, gain)
            self._aims.append((task, _points_ahead(fact, run), None))
            return task
        rotation, placed = run[f"rotation {name}"], fact["kind"] == "pose"
        task = package.frame_task(fact["frame"], _TASK_COST if placed else 0.0, _TASK_COST, gain)
        task.set_target(package.pose(rotation, np.zeros(3)))
        if placed:
            self._aims.append((task, _points_ahead(fact, run), rotation))
        return task


def _points_ahead(fact: dict[str, Any], run: dict[str, Any]) -> np.ndarray:
    """Targets x + v kd / kp, for which the feedback kp / kd e asks for the velocity v as well."""
    position, velocity, _ = run[f"path {fact['name']}"]
    return position + velocity * (fact["kd"] / fact["kp"])
