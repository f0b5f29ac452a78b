"""`Controller`: commands from states, tick by tick."""

from copy import deepcopy
from html import escape
from inspect import signature
from time import perf_counter
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers, checked_number, is_time
from poise._compiled import compiled
from poise._copies import restore, restored
from poise.control._command import Command, CommandStatus, ControllerStatus, task_statuses
from poise.control._fallback import (
    FALL_HEIGHT_RATIO,
    Fallback,
    FallWatch,
    RateLimit,
    fault_of,
    is_usable,
)
from poise.control._strategy import PHYSICS_LEVELS, USABLE, Answer, Strategy
from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.hqp import SolveStatus
from poise.robots import Robot
from poise.stack import Stack, Task, TaskFaultError

C = TypeVar("C", bound="Controller")


class Controller:
    """State check, strategy and fallback of one control loop.

    `step` never raises. On a solver failure, a user's task that raises, a state that is not finite,
    a robot that has fallen, or a solve cut short by the time cap it returns the last good command,
    torques decayed towards damping or velocities to a stop, and sets the command's status.

    `WholeBodyController`, `ReducedController`, `OperationalSpaceController` and `DifferentialIK`
    are controllers of one strategy each. Settings of a running controller are members; rows,
    problems and solutions are reached by `strategy`.

    A copy, pickled or not, is constructed with the same arguments and a copy of the stack. It
    continues from the same tick with the same targets, gains, weights, loads of contacts and last
    command. Its solvers start cold, and it does not share the dynamics. "osf" computes cones at
    construction, so its copy uses the contact areas at the time of copying. Attributes that a
    subclass sets outside of its `__init__` are not copied.

    Args:
        strategy: turns the stack's rows into an answer.
        rate_limit: largest change of a command from tick to tick; unlimited when None.
        dynamics: shared with an estimator that updates them first: a state that they hold already
            is not computed again. Its own when None.

    Attributes:
        dynamics: of the last tick's state.
        timings: seconds that the four parts of the last tick took: dynamics, assembly, solve,
            command.
    """

    def __new__(cls: type[C], *arguments: Any, **options: Any) -> C:
        controller = object.__new__(cls)
        controller._made_with = arguments, options
        return controller

    def __init__(
        self,
        strategy: Strategy,
        *,
        rate_limit: RateLimit | None = None,
        dynamics: Dynamics | None = None,
    ) -> None:
        self._strategy, self._rate_limit = strategy, rate_limit
        self._shares_dynamics = dynamics is not None
        self.dynamics = Dynamics(strategy.robot) if dynamics is None else dynamics
        self.timings: dict[str, float] = {}
        self._last_status, self._reason, self._held_back = CommandStatus.OK, "", False
        self._commands_torque = strategy.commands == "torque"
        self._contacts = strategy.stack.active_contacts
        self._torque_limit = limit = strategy.stack.torque_limit
        self._fallback = (
            Fallback.of_torque(strategy.robot, limit)
            if self._commands_torque
            else Fallback.of_velocity(strategy.robot)
        )
        unbounded = np.full(strategy.robot.nj, np.inf)
        self._bounds = (
            (limit.lower, limit.upper) if self._commands_torque else (-unbounded, unbounded)
        )
        # Velocity commands may turn a robot over on purpose.
        ratio = FALL_HEIGHT_RATIO if self._commands_torque else None
        self._fall_watch = FallWatch(strategy.robot, ratio)
        # What is compiled is compiled now.
        strategy.stack.joint_limit.evaluate(self.dynamics)
        is_usable(self.dynamics.state, strategy.robot)
        _clip(np.zeros(strategy.robot.nj), *self._bounds)
        strategy.rehearse(self.dynamics)
        limit.reset()
        for _, task in strategy.stack.tasks():
            task.reset()

    def __reduce__(self) -> tuple[Any, ...]:
        arguments, options = self._made_with
        making = signature(type(self).__init__)
        call = making.bind(self, *arguments, **options)
        if "stack" in making.parameters:
            call.arguments["stack"] = self.stack
        call.arguments.pop("dynamics", None)
        strategy, kept = self._strategy, getattr(self._strategy, "kept", ())
        return (
            _make_again,
            (type(self), call.args[1:], call.kwargs, self.stack),
            {name: getattr(self, name) for name in _KEPT}
            | {"strategy": {name: getattr(strategy, name) for name in kept}},
        )

    def __setstate__(self, kept: dict[str, Any]) -> None:
        for name in _KEPT:
            setattr(self, name, restored(getattr(self, name), kept[name]))
        for name, value in kept["strategy"].items():
            setattr(self._strategy, name, value)
        self._strategy.prepare(self._contacts)

    def __repr__(self) -> str:
        kind, levels = type(self).__name__, PHYSICS_LEVELS + len(self.stack.levels)
        words = f"{kind} of {self.robot.name}: {levels} levels, commands {self._strategy.commands}"
        return f"{words}, {self._last_status.value}"

    def _repr_html_(self) -> str:
        # There is no status before the first tick.
        table: Any = self.status() if self.timings else self.stack
        return f"<p>{escape(repr(self))}</p>{table._repr_html_()}"

    @property
    def strategy(self) -> Strategy:
        """Turn the stack's rows into an answer."""
        return self._strategy

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._strategy.robot

    @property
    def stack(self) -> Stack:
        """Contacts, limits and tasks."""
        return self._strategy.stack

    @property
    def suspended(self) -> tuple[Task, ...]:
        """Tasks replaced by a contact at the last tick."""
        return self._strategy.suspended

    @property
    def size(self) -> tuple[int, int]:
        """Variables and rows of the last tick's problem, bounds on single variables among them."""
        return self._strategy.size

    def step(self, state: RobotState) -> Command:
        """Compute the command of one tick.

        Args:
            state: the robot's state.

        Returns:
            The command, with its status.
        """
        self._reason = ""
        if is_usable(state, self.robot):
            try:
                command = self._tick(state)
            except TaskFaultError as fault:
                self._reason = str(fault)
                self._pause(state)
                command = self._fall_back(CommandStatus.SOLVER_FAILED, state)
        else:
            self._reason = fault_of(state, self.robot)
            self._pause(state)
            command = self._fall_back(CommandStatus.BAD_STATE, state)
        self._last_status, self._held_back = command.status, command.held_back
        return command

    def set_gains(self, task: str, kp: Numbers | None = None, kd: Numbers | None = None) -> None:
        """Set stiffness and damping of a task, from the next tick.

        Args:
            task: its name in the stack.
            kp: stiffness, one number or one a row [1/s^2]; as it is when None.
            kd: damping [1/s]; critical, 2 sqrt(kp), when None.

        Raises:
            ConfigurationError: wrong length, or gains that are not finite or negative.
            UnknownNameError: no such task.
        """
        self.stack.task(task).set_gains(kp, kd)

    @property
    def fall_height_ratio(self) -> float | None:
        """Height of the pelvis over the lowest sole, by that at home, that counts as a fall.

        It has fallen when that lasts for 0.1 s. The default is 0.25 for torques and None, never,
        for velocities. Set None for a robot that lies or sits on purpose.

        Raises:
            ConfigurationError: no number between 0 and 1, or a robot that cannot fall.
        """
        return self._fall_watch.height_ratio

    @fall_height_ratio.setter
    def fall_height_ratio(self, ratio: float | None) -> None:
        if ratio is not None:
            ratio = checked_number(ratio, "fall_height_ratio of the controller", above=0.0)
            if not self._fall_watch.can_fall:
                what = "a robot that is fixed, or has no soles, does not fall"
                raise ConfigurationError(what, got=ratio, wanted="None")
            if ratio >= 1.0:
                what = "fall_height_ratio of the controller is out of range"
                wanted = "a number between 0 and 1, or None"
                raise ConfigurationError(what, got=ratio, wanted=wanted)
        self._fall_watch.height_ratio = ratio

    def reset(self) -> None:
        """Forget the last command, the last solution and targets taken from the robot.

        Contacts keep their loads.
        """
        self._last_status, self._reason, self._held_back = CommandStatus.OK, "", False
        self._fallback.reset()
        self._fall_watch.reset()
        self._torque_limit.reset()
        if self._rate_limit is not None:
            self._rate_limit.reset()
        for _, task in self.stack.tasks():
            task.reset()
        self._strategy.reset()

    def status(self) -> ControllerStatus:
        """Report level, error and residual of each task at the last tick."""
        residuals = self._strategy.task_residuals() if self._last_status.ok else None
        return ControllerStatus(
            command=self._last_status,
            reason=self._reason,
            held_back=self._held_back,
            tasks=task_statuses(self.stack, residuals, self.suspended),
            explanation=self._strategy.explain(),
            softened={PHYSICS_LEVELS + 1 + k: mu for k, mu in self._strategy.softened.items()},
        )

    def _tick(self, state: RobotState) -> Command:
        strategy = self._strategy
        begin = perf_counter()
        if not (self._shares_dynamics and state is self.dynamics.state):
            self.dynamics.update(state)
        if self._fall_watch.sees_fall(self.dynamics):
            self._reason = self._fall_watch.describe()
            self._pause(state)
            return self._fall_back(CommandStatus.FALLEN, state)
        for contact in strategy.stack.contacts:
            contact.advance(state.time)
        self._torque_limit.begin(state.time)
        self._contacts = strategy.stack.active_contacts
        if strategy.prepare(self._contacts):
            # A foot that landed holds its place when it is free again, not where it once was.
            for task in strategy.suspended:
                task.reset()
        after_dynamics = perf_counter()
        strategy.assemble(self.dynamics)
        after_assembly = perf_counter()
        answer = strategy.solve()
        after_solve = perf_counter()
        command = self._command(answer, state)
        self.timings = {
            "dynamics": after_dynamics - begin,
            "assembly": after_assembly - after_dynamics,
            "solve": after_solve - after_assembly,
            "command": perf_counter() - after_solve,
        }
        return command

    def _pause(self, state: object) -> None:
        """Stop load ramps until the next tick that commands, which the robot is to follow."""
        time = state.time if isinstance(state, RobotState) else None
        if is_time(time):
            for contact in self._strategy.stack.contacts:
                contact.pause(time)

    def _command(self, answer: Answer, state: RobotState) -> Command:
        joints = answer.joints
        lower, upper = self._bounds
        if answer.status not in USABLE or not _clip(joints, lower, upper):
            late = answer.status is SolveStatus.TIME_LIMIT
            return self._fall_back(
                CommandStatus.TIME_LIMIT if late else CommandStatus.SOLVER_FAILED, state
            )
        if self._rate_limit is not None:
            joints = self._rate_limit.limited(joints)
        self._fallback.remember(joints, state.time)
        if self._commands_torque:
            self._torque_limit.remember(joints, state.time)
        torque, velocity = (joints, None) if self._commands_torque else (None, joints)
        _, _, residuals, acceleration, wrenches, held_back = answer
        return Command(
            CommandStatus.OK, torque, velocity, acceleration, wrenches, residuals, held_back
        )

    def _fall_back(self, status: CommandStatus, state: object) -> Command:
        joints = self._fallback.command(state)
        if self._rate_limit is not None:
            self._rate_limit.remember(joints)
        if self._commands_torque:
            # The change of torque is not limited after a fallback.
            self._torque_limit.reset()
            return Command(status=status, torque=joints)
        return Command(status=status, velocity=joints)


_KEPT = (
    *("_contacts", "_fallback", "_fall_watch", "_rate_limit"),
    *("_last_status", "_reason", "_held_back"),
)
"""Attributes that a copy of a controller keeps, beside the stack."""


def _make_again(
    kind: type[Controller], arguments: tuple[Any, ...], options: dict[str, Any], stack: Stack
) -> Controller:
    """Make a controller like another, with the present content of the other's stack."""
    # Making a controller takes its stack through a tick and forgets what that left.
    parts = _parts(stack)
    others = {id(part): part for part in parts}
    saved = [deepcopy(part, {k: v for k, v in others.items() if v is not part}) for part in parts]
    controller = kind(*arguments, **options)
    for own, copy in zip(_parts(controller.stack), saved, strict=True):
        restore(own, copy)
    return controller


def _parts(stack: Stack) -> list[object]:
    """List the parts of a stack that have a state."""
    limits = stack.torque_limit, stack.joint_limit, stack.balance_limit, stack.self_collision_limit
    return [*stack.contacts, *(task for _, task in stack.tasks()), *limits]


@compiled
def _clip(
    joints: Float64[np.ndarray, " nj"],
    lower: Float64[np.ndarray, " nj"],
    upper: Float64[np.ndarray, " nj"],
) -> bool:
    """Clip a command to its bounds, in place; return True where all of it was finite."""
    finite = True
    for i in range(len(joints)):
        finite &= bool(np.isfinite(joints[i]))
        joints[i] = min(max(joints[i], lower[i]), upper[i])
    return finite
