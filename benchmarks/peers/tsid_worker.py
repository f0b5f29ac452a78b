"""TSID on its nearest equivalent problem: two levels, hard physics above weighted tasks.

Needs tsid (tried: 1.7.1 with pin 3.4.0) and no Poise.
"""

from importlib.metadata import version
from time import perf_counter, thread_time
from typing import Any

import numpy as np
import pinocchio as pin
import tsid.tsid_pywrap as tsid  # pyright: ignore[reportMissingImports]

_TASK_WEIGHT = 1.0
_POSTURE_WEIGHT = 1e-2
_REGULARISATION = 1e-5
"""Weight of the posture where the stack has none, and of the contact forces: a unique solution."""


class Peer:
    """TSID's inverse dynamics, fed with recorded states.

    Hard: base dynamics (eliminated torques), still contacts, friction pyramids, torque bounds,
    bounds of joint velocity and acceleration. Weighted below: CoM, pelvis orientation, poses of
    the end effectors, posture. TSID has no level below that.
    """

    def __init__(self, urdf: str, run: dict[str, Any]) -> None:
        self.solver = f"tsid {version('tsid')}/eiquadprog"
        self._run, facts = run, run["facts"]
        model = pin.buildModelFromUrdf(urdf, pin.JointModelFreeFlyer())
        if list(model.names)[2:] != facts["joints"]:
            raise ValueError("the joints are in another order than Poise's")
        model.armature[6:] = run["armature"]
        self._robot = robot = tsid.RobotWrapper(model, tsid.FLOATING_BASE_SYSTEM, False)
        self._problem = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
        self._problem.computeProblemData(0.0, run["q"][0], run["v"][0])
        self._contacts = [self._add_contact(contact) for contact in facts["contacts"]]
        self._aims: list[tuple[Any, Any, Any, Any]] = []
        self._orientations: list[Any] = []
        self._kept: list[Any] = []
        for task in facts["tasks"]:
            self._add_task(task)
        if not any(task["kind"] == "posture" for task in facts["tasks"]):
            self._add_posture({"name": "posture", "kp": 0.0, "kd": 0.0}, _REGULARISATION)
        self._add_bounds()
        problem = self._problem
        self._qp = tsid.SolverHQuadProgFast("qp")
        self._qp.resize(problem.nVar, problem.nEq, problem.nIn)
        for task, sample in self._orientations:
            task.setReference(sample)

    def size(self) -> tuple[int, int]:
        """Unknowns, and two-sided rows of the hard level."""
        return self._problem.nVar, self._problem.nEq + self._problem.nIn

    def tick(self, index: int) -> tuple[list[float], float, bool]:
        """One timed tick: seconds (total, of the processor, then phases), residual, failure."""
        run, problem = self._run, self._problem
        for task, sample, path, pose in self._aims:
            _aim(task, sample, path[:, index], pose)
        time, q, v = float(run["time"][index]), run["q"][index], run["v"][index]
        cpu, begin = thread_time(), perf_counter()
        data = problem.computeProblemData(time, q, v)
        assembled = perf_counter()
        solution = self._qp.solve(data)
        solved = perf_counter()
        problem.getActuatorForces(solution)
        end = perf_counter()
        cpu, solve = thread_time() - cpu, solved - assembled
        seconds = [end - begin, cpu, np.nan, assembled - begin, solve, end - solved]
        failed = int(solution.status) != 0
        return seconds, np.nan if failed else self._residual(solution), failed

    def _residual(self, solution: Any) -> float:
        """Residual of the base's equation of motion, relative to its nonlinear effects."""
        problem, robot = self._problem, self._robot
        data = problem.data()
        h = robot.nonLinearEffect(data)[:6]
        base = robot.mass(data)[:6] @ problem.getAccelerations(solution) + h
        for contact in self._contacts:
            jacobian = contact.getMotionTask().getConstraint().matrix
            force = problem.getContactForce(contact.name, solution)
            base -= jacobian[:, :6].T @ (contact.getForceGeneratorMatrix @ force)
        return float(np.linalg.norm(base) / max(1.0, np.linalg.norm(h)))

    def _add_contact(self, fact: dict[str, Any]) -> Any:
        x, y = 0.5 * fact["length"], 0.5 * fact["width"]
        corners = np.array([[-x, -x, x, x], [-y, y, -y, y], [0.0, 0.0, 0.0, 0.0]])
        weight = 9.81 * self._run["facts"]["mass"]
        up = np.array([0.0, 0.0, 1.0])
        contact = tsid.Contact6d(
            fact["frame"],
            self._robot,
            fact["frame"],
            corners,
            up,
            fact["friction"],
            0.0,
            5.0 * weight,
        )
        # Still, with the damping of Poise's contacts.
        contact.setKp(np.zeros(6))
        contact.setKd(fact["damping"] * np.ones(6))
        frame = self._robot.model().getFrameId(fact["frame"])
        contact.setReference(self._robot.framePosition(self._problem.data(), frame))
        self._problem.addRigidContact(contact, _REGULARISATION)
        return contact

    def _add_task(self, fact: dict[str, Any]) -> None:
        if fact["kind"] == "posture":
            self._add_posture(fact, _POSTURE_WEIGHT)
            return
        if fact["kind"] == "com":
            task = tsid.TaskComEquality(fact["name"], self._robot)
            gains, path = np.ones(3), self._run[f"path {fact['name']}"]
            self._aims.append((task, tsid.TrajectorySample(3), path, None))
        else:
            task = tsid.TaskSE3Equality(fact["name"], self._robot, fact["frame"])
            task.useLocalFrame(False)
            gains = np.ones(6)
            rotation = self._run[f"rotation {fact['name']}"]
            sample = tsid.TrajectorySample(12, 6)
            if fact["kind"] == "orientation":
                task.setMask(np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]))
                _set_pose(sample, np.zeros((3, 3)), rotation)
                self._orientations.append((task, sample))
            else:
                path = self._run[f"path {fact['name']}"]
                self._aims.append((task, sample, path, rotation))
        task.setKp(fact["kp"] * gains)
        task.setKd(fact["kd"] * gains)
        self._problem.addMotionTask(task, _TASK_WEIGHT, 1, 0.0)
        self._kept.append(task)

    def _add_posture(self, fact: dict[str, Any], weight: float) -> None:
        joints = np.ones(self._robot.na)
        task = tsid.TaskJointPosture(fact["name"], self._robot)
        task.setKp(fact["kp"] * joints)
        task.setKd(fact["kd"] * joints)
        sample = tsid.TrajectorySample(self._robot.na)
        sample.value(self._run["q_home"][7:])
        sample.derivative(0.0 * joints)
        sample.second_derivative(0.0 * joints)
        task.setReference(sample)
        self._problem.addMotionTask(task, weight, 1, 0.0)
        self._kept.append(task)

    def _add_bounds(self) -> None:
        tau, speed = self._run["tau_max"], self._run["v_max"]
        torque = tsid.TaskActuationBounds("torque limits", self._robot)
        torque.setBounds(-tau, tau)
        self._problem.addActuationTask(torque, 1.0, 0, 0.0)
        # The time step is the horizon over which the speed limit is kept.
        joints = tsid.TaskJointBounds("joint limits", self._robot, 0.02)
        joints.setVelocityBounds(-speed, speed)
        limit = self._run["facts"]["acceleration_max"] * np.ones(self._robot.na)
        joints.setAccelerationBounds(-limit, limit)
        self._problem.addMotionTask(joints, 1.0, 0, 0.0)
        self._kept += [torque, joints]


def _aim(task: Any, sample: Any, point: np.ndarray, rotation: np.ndarray | None) -> None:
    if rotation is None:
        sample.value(point[0])
        sample.derivative(point[1])
        sample.second_derivative(point[2])
    else:
        _set_pose(sample, point, rotation)
    task.setReference(sample)


def _set_pose(sample: Any, point: np.ndarray, rotation: np.ndarray) -> None:
    still = np.zeros(3)
    sample.value(np.concatenate((point[0], rotation.ravel(order="F"))))
    sample.derivative(np.concatenate((point[1], still)))
    sample.second_derivative(np.concatenate((point[2], still)))
