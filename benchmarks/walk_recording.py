"""`record_walk`: a walk, recorded once, and `WalkLead`, which leads any stack along it again.

`WalkSubject`: one of Poise's own controllers under the clock on it.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from benchmarks.clocked import Clocked
from benchmarks.methods import REFERENCE, Method
from benchmarks.recording import Loop, Progress, paper_contacts
from poise.control import ReducedController, WholeBodyController, make_controller
from poise.dynamics import RobotState
from poise.errors import PoiseError, UnknownNameError
from poise.locomotion import FootstepPlan, Gait, Stride, Walker, plan_footsteps
from poise.robots import Robot
from poise.sim import Plant, rollout
from poise.stack import (
    BalanceLimit,
    ComTask,
    FrameTask,
    MomentumTask,
    PostureTask,
    Stack,
    Task,
)

WALK_STACKS = ("table1", "posture")
"""Stacks of a walk, see `walk_stack`."""

_STEP_LENGTH = 0.15
"""Length of each step [m]."""

_HAND_RADIUS, _HAND_FREQUENCY, _HAND_SWELL = 0.03, 0.7, 1.0
"""The hands go round, beside what they are carried along [m, 1/s, s]."""


def walk_stack(robot: Robot, kind: str) -> Stack:
    """A new stack that a walker can lead.

    "table1" is that of Ahn et al. 2024, Table 1: CoM and pelvis orientation, then the poses of the
    end effectors, hands and the swing foot. "posture" adds torso, posture and angular momentum on
    two levels below everything, for a robot that walks on and on. Both have `paper_contacts`.
    """
    if kind not in WALK_STACKS:
        raise UnknownNameError("unknown stack of a walk", got=kind, choices=WALK_STACKS)
    soles = list(robot.soles)[:2]
    balance: list[Task] = [
        ComTask(kp=40.0),
        FrameTask(robot.pelvis, "orientation", kp=100.0, name="pelvis"),
    ]
    feet: list[Task] = [FrameTask(sole, kp=300.0, name=sole) for sole in soles]
    hands: list[Task] = [FrameTask(hand, kp=100.0, name=hand) for hand in robot.hands]
    levels: list[list[Task]] = [balance, [*feet, *hands]]
    if kind == "posture":
        levels.append([FrameTask(robot.torso, "orientation", kp=50.0, name="torso")])
        momentum = MomentumTask("angular", kd=5.0, weight=0.1, name="momentum")
        levels.append([PostureTask(), momentum])
    # The paper's problem has no balance limit, no bound on the change of torques, no softening.
    return Stack(
        paper_contacts(robot)[:2],
        levels,
        balance_limit=BalanceLimit(enabled=False),
        softening=0.0,
    )


class WalkLead:
    """A walker with hands that move, over one stack: everything a tick is told besides the state.

    Args:
        robot: the robot.
        plan: the steps.
        stack: one of `walk_stack`.
    """

    def __init__(self, robot: Robot, plan: FootstepPlan, stack: Stack) -> None:
        self.robot, self.stack = robot, stack
        self.walker = Walker(robot, stack, plan=plan)
        hands = [name for name in self.walker.carried if name in robot.hands]
        self._loops = {
            name: Loop(
                centre=self.walker.carried[name].target_position.copy(),
                displacement=np.zeros(3),
                shift=(0.0, 1.0),
                amplitude=_HAND_RADIUS * np.array([1.0, 0.5, 1.0]),
                phase=np.array([0.0, 0.0, 0.5 * np.pi]),
                frequency=_HAND_FREQUENCY,
                swell=(0.0, _HAND_SWELL),
            )
            for name in hands
        }

    def lead(self, state: RobotState) -> None:
        """Sets targets and loads of contacts for a state."""
        for name, loop in self._loops.items():
            position, velocity, acceleration = loop.at(state.time)
            self.walker.carried[name].set_target(
                position,
                velocity=np.append(velocity, np.zeros(3)),
                acceleration=np.append(acceleration, np.zeros(3)),
            )
        self.walker.lead(state)

    def pass_by(self, state: RobotState) -> None:
        """The same where no controller steps, which would move the loads of contacts on."""
        self.lead(state)
        for contact in self.stack.contacts:
            contact.advance(state.time)


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkRecording:
    """States of a walk, tick by tick."""

    robot: Robot  # whose walk
    plan: FootstepPlan  # its steps
    states: tuple[RobotState, ...]  # what the controller was told
    feet: Int64[np.ndarray, " ticks"]  # number of feet with contacts that were active at each tick
    com_error: Float64[np.ndarray, " ticks"]  # distance of the CoM from its target [m]
    hand_error: Float64[np.ndarray, " ticks"]  # distance of the left hand from its target [m]

    def lead(self, kind: str) -> WalkLead:
        """What leads a new stack of this kind along the recorded states.

        Given the states, a walker sets the same targets and loads again: it remembers nothing else.
        """
        return WalkLead(self.robot, self.plan, walk_stack(self.robot, kind))

    def ticks(self, stance: str) -> Int64[np.ndarray, " n"]:
        """Ticks in "double" or "single" support."""
        return np.flatnonzero(self.feet == (2 if stance == "double" else 1)).astype(np.int64)


def record_walk(
    robot: Robot,
    steps: int,
    progress: Progress | None = None,
    *,
    method: Method = REFERENCE,
    seconds: float = math.inf,
) -> WalkRecording:
    """Lets a robot walk straight ahead in simulation, its hands going round, and records it."""
    plan = plan_footsteps(robot, [Stride(steps=steps, length=_STEP_LENGTH)], Gait())
    lead = WalkLead(robot, plan, walk_stack(robot, "posture"))
    controller = make_controller(robot, lead.stack, method.plan())
    com, hand = lead.stack.task("com"), lead.stack.task(next(iter(robot.hands)))
    plant = Plant(robot)
    states: list[RobotState] = []
    rows: list[tuple[int, float, float]] = []
    end = min(plan.duration, seconds)
    for tick in rollout(plant, controller, lead, duration=end):
        status = lead.walker.status
        states.append(tick.state)
        errors = [float(np.linalg.norm(task.error[:3])) for task in (com, hand)]
        rows.append((sum(c.active for c in lead.stack.contacts), errors[0], errors[1]))
        if plant.fallen or not status.ok:
            raise PoiseError(
                f"{robot.name} did not walk to the end of the recording",
                got=f"{'a fall' if plant.fallen else status.value} at {plant.time:.3f} s",
            )
        if progress is not None and len(states) % 100 == 0:
            progress(plant.time, end)
    feet, com_error, hand_error = zip(*rows, strict=True)
    return WalkRecording(
        robot=robot,
        plan=plan,
        states=tuple(states),
        feet=np.array(feet, dtype=np.int64),
        com_error=np.array(com_error),
        hand_error=np.array(hand_error),
    )


class WalkSubject(Clocked):
    """A controller with a stack and a walker of its own, whose answers are kept."""

    def __init__(self, recording: WalkRecording, kind: str, method: Method) -> None:
        self.lead: WalkLead = recording.lead(kind)  # its walker
        robot, stack = recording.robot, self.lead.stack
        controller = make_controller(robot, stack, method.plan())
        super().__init__(method, controller, recording.states, self._aim_at)
        ticks = len(recording.states)
        # Answers at the ticks that were timed, NaN elsewhere [m/s^2, rad/s^2]
        self.acceleration: Float64[np.ndarray, "ticks nv"] = np.full((ticks, robot.nv), np.nan)
        # Torques of the same ticks [N m]
        self.torque: Float64[np.ndarray, "ticks nj"] = np.full((ticks, robot.nj), np.nan)
        width = sum(c.dim for c in stack.contacts)
        # Wrenches of the contacts in the order of the stack, zero of inactive ones [N, N m]
        self.wrench: Float64[np.ndarray, "ticks nf"] = np.full((ticks, width), np.nan)
        # Unknowns of the problem, of LQP 1 and of LQP 2 where that was solved
        self.variables: Float64[np.ndarray, " ticks"] = np.full(ticks, np.nan)
        # Seconds in the solver, of the full problem or of LQP 1 alone
        self.lqp: Float64[np.ndarray, " ticks"] = np.full(ticks, np.nan)
        # What a tick had to solve: 1 for one problem, which is LQP 1 of the reduced controller, 2
        # for LQP 2 as well, 3 where the whole problem had to be solved after all
        self.programs: Float64[np.ndarray, " ticks"] = np.full(ticks, np.nan)

    def tick(self, index: int) -> None:
        """Times one tick and keeps its answer."""
        super().tick(index)
        command = self.command
        if command is None or command.acceleration is None or command.torque is None:
            return
        self.acceleration[index] = command.acceleration
        self.torque[index] = command.torque
        self.variables[index] = self.controller.size[0]
        first = 0
        for contact in self.lead.stack.contacts:
            place = slice(first, first + contact.dim)
            self.wrench[index, place] = command.wrenches.get(contact.name, 0.0)
            first = place.stop
        self.lqp[index], self.programs[index] = self._solver_time()

    def skip(self, index: int) -> None:
        """Leaves one tick out; the walker goes on."""
        self.lead.pass_by(self._states[index])

    def _aim_at(self, index: int) -> None:
        self.lead.lead(self._states[index])

    def _solver_time(self) -> tuple[float, int]:
        """Seconds in the solver of the full problem or LQP 1, and what had to be solved."""
        controller = self.controller
        if isinstance(controller, WholeBodyController):
            solution = controller.strategy.current.solution
            return (np.nan, 0) if solution is None else (solution.timings["total"], 1)
        if isinstance(controller, ReducedController):
            program = controller.strategy.current
            kind = 1 if program.second_solution is None else 2
            kind = kind if program.whole_solution is None else 3
            if program.first_solution is not None:
                return program.first_solution.timings["total"], kind
            return np.nan, kind
        return np.nan, 0
