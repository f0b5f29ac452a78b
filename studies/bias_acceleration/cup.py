"""`carry_cup`: the first study's experiment, an arm that carries a cup sideways and level."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from benchmarks.bias.recording import Cubic
from benchmarks.bias.recursion import PaperRecursion
from benchmarks.bias.rows import PaperFormulation
from benchmarks.rigid_plant import (
    CONTROL_DT,
    Encoder,
    Gravity,
    Moment,
    RigidPlant,
    set_gravity,
    with_gravity,
)
from poise.control import Command, CommandStatus, OperationalSpaceController
from poise.dynamics import Dynamics, RobotState
from poise.robots import Robot, load_robot
from poise.sim import rollout
from poise.stack import FrameTask, Stack

FORMULAS = ("original", "proposed", "numerical", "fused")
"""In the order of tables and figures."""

WAY, DURATION = 0.4, 4.2
"""The cup goes this far along y [m], in this time [s]."""

KP = 100.0
"""Stiffness of both tasks [1/s^2], with critical damping; the paper does not give its gains."""

PAPER_GRAVITY = -9.8
"""The paper's [m/s^2]."""

MET = 1e-9
"""What a task of `OperationalSpaceController` misses by rounding alone; it misses more where it has
lost rank [m/s^2, rad/s^2]."""

_HAND = "hand"
_SHOULDER, _ELBOW = 0.5, 1.2
"""Joints 2 and 3 at the start [rad]; joint 5 makes the hand level, joint 1 points it to -WAY/2."""


@dataclass(frozen=True, kw_only=True)
class CupRun:
    """One carrying of the cup."""

    formula: str  # of the bias acceleration
    kp: float = KP  # stiffness of both tasks [1/s^2]
    encoder: Encoder | None = None  # of all joints; None for exact angles
    # Of the plant, and of the controller's model
    gravity: Gravity = field(default_factory=lambda: Gravity(first=PAPER_GRAVITY))
    inertia_scale: float = 1.0  # factor on the plant's link masses and inertias
    share: float = 1.0  # share of the motion that is simulated

    @property
    def ticks(self) -> int:
        """Number of control periods."""
        return round(self.share * DURATION / CONTROL_DT)


@dataclass(frozen=True, kw_only=True, eq=False)
class CupTrace:
    """Record of a run, tick by tick, right after each torque was applied."""

    states: tuple[RobotState, ...] = field(repr=False)  # what the controller was told
    time: Float64[np.ndarray, " T"]  # [s]
    torque: Float64[np.ndarray, "T n"]  # [N m]
    gravity: Float64[np.ndarray, " T"]  # vertical gravity of the plant [m/s^2]
    # Bias acceleration of the second task, NaN with `fused`, which has none by itself [rad/s^2]
    bias: Float64[np.ndarray, "T 3"]
    # (49): acceleration that the controller asked of the second task minus the true one [rad/s^2]
    sigma: Float64[np.ndarray, " T"]
    # The same with what it would have asked had it known the true state [rad/s^2]
    sigma_true: Float64[np.ndarray, " T"]
    tilt: Float64[np.ndarray, " T"]  # angle between the cup and the horizontal plane [rad]
    turn: Float64[np.ndarray, " T"]  # angle between the hand and its target orientation [rad]
    distance: Float64[np.ndarray, " T"]  # of the hand from its target [m]
    regular: bool  # whether every level kept its rank
    held: int  # ticks on which a joint came to a limit


class CupTasks:
    """The two tasks and how their targets move."""

    def __init__(self, robot: Robot, kp: float) -> None:
        self.start = level_start(robot)  # joint angles at the start [rad]
        place = _hand_at(robot, self.start)
        # home: world_R_hand at the start, which is level
        self.home, self._from = place.rotation.copy(), place.translation.copy()
        # Task 1, the hand's position
        self.position = FrameTask(_HAND, "position", kp=kp, name="position")
        # Task 2, the hand's orientation
        self.orientation = FrameTask(_HAND, "orientation", kp=kp, name="orientation")
        self.orientation.set_target(rotation=self.home)
        # Both, in this order
        self.stack = Stack([], [[self.position], [self.orientation]], softening=0.0)
        self._way = Cubic(displacement=WAY, duration=DURATION)
        self.aim(0.0)

    def aim(self, time: float) -> None:
        """Sets the targets of a time [s]."""
        y, rate, second = self._way.at(time)
        self.position.set_target(
            position=self._from + np.array([0.0, y, 0.0]),
            velocity=[0.0, rate, 0.0, 0.0, 0.0, 0.0],
            acceleration=[0.0, second, 0.0, 0.0, 0.0, 0.0],
        )


class PaperController:
    """Torques of a `PaperRecursion`: no contacts, and no limit that it would keep."""

    def __init__(self, robot: Robot, stack: Stack, recursion: PaperRecursion) -> None:
        # robot: the robot
        # recursion: with its results of the last tick
        # outside: whether some joint's acceleration left the bounds of the stack's joint limit at
        # the last tick
        self.robot, self.recursion, self.outside = robot, recursion, False
        self._formulation, self._limit = PaperFormulation(robot, stack), stack.joint_limit
        self._dynamics = Dynamics(robot)

    def step(self, state: RobotState) -> Command:
        """One tick: from state to torques."""
        dynamics = self._dynamics
        dynamics.update(state)
        self._formulation.fill(dynamics)
        acceleration = self.recursion.resolve(self._formulation.rows, dynamics)
        self._limit.evaluate(dynamics)
        self.outside = bool(
            (acceleration < self._limit.lower).any() or (acceleration > self._limit.upper).any()
        )
        torque = dynamics.M.dot(acceleration)
        torque += dynamics.h
        return Command(status=CommandStatus.OK, torque=torque, acceleration=acceleration)


class _Recorder:
    """Measures every tick on the true robot."""

    def __init__(self, plant: RigidPlant, tasks: CupTasks) -> None:
        self._model, self._tasks = plant.robot.model, tasks
        self._data = self._model.createData()
        self._hand = plant.robot.frame_id(_HAND)
        self._up = tasks.home.T[:, 2]
        self.rows: list[tuple[float, ...]] = []

    def record(self, now: Moment) -> None:
        """Adds a row: sigma, sigma_true, tilt, turn, distance."""
        model, data, hand, task = self._model, self._data, self._hand, self._tasks.orientation
        pin.forwardKinematics(model, data, now.q, now.v, now.acceleration)
        place = pin.updateFramePlacement(model, data, hand)
        axes = pin.LOCAL_WORLD_ALIGNED
        turning = pin.getFrameVelocity(model, data, hand, axes).angular
        turned = pin.getFrameClassicalAcceleration(model, data, hand, axes).angular
        error = pin.log3(self._tasks.home.dot(place.rotation.T))
        wanted = task.kp * error - task.kd * turning
        up = place.rotation @ self._up
        target = self._tasks.position.target_position
        self.rows.append(
            (
                float(np.linalg.norm(task.reference - turned)),
                float(np.linalg.norm(wanted - turned)),
                math.atan2(math.hypot(up[0], up[1]), up[2]),
                float(np.linalg.norm(error)),
                float(np.linalg.norm(place.translation - target)),
            )
        )


def carry_cup(run: CupRun, progress: Callable[[float], object] | None = None) -> CupTrace:
    """Simulates one run."""
    arm = load_robot("arm6")
    tasks = CupTasks(arm, run.kp)
    plant = RigidPlant(
        arm,
        tasks.start,
        gravity=run.gravity,
        inertia_scale=run.inertia_scale,
        encoder=run.encoder,
    )
    controller = _controller(run, with_gravity(arm, run.gravity.at(0.0)), tasks.stack)

    def lead(state: RobotState) -> None:
        if not run.gravity.constant:
            set_gravity(controller.robot, plant.gravity)
        tasks.aim(state.time)

    recorder, states, moments = _Recorder(plant, tasks), list[RobotState](), list[Moment]()
    bias = np.full((run.ticks, 3), np.nan)
    regular, held = True, 0
    for tick in rollout(plant, controller, lead, duration=run.ticks * CONTROL_DT):
        assert plant.moment is not None
        states.append(tick.state)
        moments.append(plant.moment)
        recorder.record(plant.moment)
        if isinstance(controller, PaperController):
            regular = regular and controller.recursion.regular
            held += controller.outside
            bias[tick.index] = controller.recursion.bias[-1]
        else:
            status = controller.status()
            regular = regular and all(task.residual < MET for task in status.tasks)
            held += "held" in status.explanation
        if progress is not None and tick.index % 100 == 0:
            progress(tick.index / run.ticks)
    sigma, sigma_true, tilt, turn, distance = np.array(recorder.rows).T.copy()
    return CupTrace(
        states=tuple(states),
        time=np.array([state.time for state in states]),
        torque=np.array([moment.torque for moment in moments]),
        gravity=np.array([moment.gravity for moment in moments]),
        bias=bias,
        sigma=sigma,
        sigma_true=sigma_true,
        tilt=tilt,
        turn=turn,
        distance=distance,
        regular=regular,
        held=held,
    )


def _controller(
    run: CupRun, robot: Robot, stack: Stack
) -> "OperationalSpaceController | PaperController":
    """Poise's own for `fused`, without a bound on the change of torques."""
    if run.formula == "fused":
        return OperationalSpaceController(robot, stack, torque_step=math.inf)
    return PaperController(robot, stack, PaperRecursion(run.formula))


def level_start(robot: Robot) -> Float64[np.ndarray, " n"]:
    """Joint angles with the hand level at y = -WAY/2, elbow and wrist well bent [rad]."""
    q = np.array([0.0, _SHOULDER, _ELBOW, 0.0, math.pi - _SHOULDER - _ELBOW, 0.0])
    reach = float(_hand_at(robot, q).translation[0])
    q[0] = -math.asin(0.5 * WAY / reach)
    return q


def _hand_at(robot: Robot, q: Float64[np.ndarray, " n"]) -> pin.SE3:
    dynamics = Dynamics(robot)
    dynamics.update(RobotState(q, np.zeros(robot.nv)))
    frame = dynamics.frame(robot.frame_id(_HAND))
    return pin.SE3(frame.rotation, frame.position)
