"""`Walker`: walks along a plan, or by velocities and footholds that are given while it walks."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.locomotion._support import Vector2
from poise.locomotion._walking._commands import Foothold, VelocityLimits
from poise.locomotion._walking._engine import SteppingEngine
from poise.locomotion._walking._footsteps import (
    FootstepPlan,
    Gait,
    level_floor,
    stand_of,
    usual_gait,
)
from poise.locomotion._walking._ground import Ground, Placement
from poise.locomotion._walking._modes import Mode
from poise.locomotion._walking._parts import make_parts
from poise.locomotion._walking._phases import FootMotion
from poise.locomotion._walking._settings import WalkSettings, WalkStatus
from poise.locomotion._walking._tasks import CarriedTarget
from poise.robots import Robot
from poise.stack import Stack, Task


class Walker:
    """Leader of a stack that walks, by a plan or by commands; a `poise.stack.Leader`.

    Its steps come from a plan, or from `set_velocity` and `step_to` while it walks. Every tick
    computes the next footholds from the command, and from them, by backward recursion, the desired
    DCM.
    While a foot is in the air, place and time of its touchdown are chosen from the measured one.
    Standing, the robot steps by itself when its feet cannot hold it, and comes back to rest side by
    side.

    It only sets targets of tasks and loads of contacts of the stack: the CoM task (its target, and
    the acceleration that keeps the balance), the frame task of the swing foot, the contacts of
    both soles, and every other frame task, which moves with the body. It never raises while it
    runs: `notice` has the part of a command that was cut, `status` the state of the walk.

    Args:
        robot: on two soles.
        stack: the controller's: a `ComTask` of all axes, a `FrameTask` of the pose of each sole,
            and a contact on each.
        gait: timing and shape of every step; by the robot's size when None.
        settings: feedback and touchdown.
        limits: of velocities.
        plan: footholds to begin with, each of them exact unless the robot has to be caught. It has
            its own gait, posture and ground, and the robot has to stand where it begins.
        q: how the robot stands, in its home posture when None; it may begin anywhere.
        ground: what it walks on; a floor as high as its soles when None.
        carry: names of frame tasks that move with the body; all that are on no sole when None.

    Attributes:
        stack: what it leads.
        plan: with which it began.
        gait: timing and shape of a step.
        settings: feedback and touchdown.
        limits: of velocities.
        carried: targets that move with the body, by the name of their task.

    Raises:
        ConfigurationError: the stack lacks something, the robot does not stand on two soles, a
            leg does not reach a planned foothold, or feet as far apart as in the gait touch
            or are out of reach.
        UnknownNameError: no such frame task to carry.
    """

    def __init__(
        self,
        robot: Robot,
        stack: Stack,
        gait: Gait | None = None,
        settings: WalkSettings | None = None,
        limits: VelocityLimits | None = None,
        *,
        plan: FootstepPlan | None = None,
        q: Numbers | None = None,
        ground: Ground | None = None,
        carry: Sequence[str] | None = None,
    ) -> None:
        self.stack, self.settings = stack, settings or WalkSettings()
        self.limits = limits or VelocityLimits()
        if plan is not None:
            _check_alone(gait, q, ground)
            gait, ground = plan.gait, plan.ground
        self.plan = plan
        stand = plan or stand_of(robot, q)
        self.gait = gait or usual_gait(stand.com[2] - stand.middle[2])
        self.ground = ground or level_floor(stand.start)
        stack.bind(robot)
        self._engine = SteppingEngine(
            stack,
            lambda: make_parts(
                robot, stack, stand, self.gait, self.settings, self.limits, self.ground, carry
            ),
        )
        parts = self._engine.parts
        self.height, self.commands = parts.height, parts.commands
        if plan is not None:
            # Now, so that commands before the first tick come after it.
            self.commands.follow(plan)
        self.carried: Mapping[str, CarriedTarget] = parts.tasks.carried

    def set_velocity(self, ahead: float, sideways: float = 0.0, turn: float = 0.0) -> None:
        """Set the commanded velocity; zero brings the robot to rest, feet side by side.

        Args:
            ahead: [m/s].
            sideways: to the left [m/s].
            turn: to the left [rad/s].
        """
        self.commands.set_velocity(_double(ahead), _double(sideways), _double(turn))

    def step_to(self, sole: str, x: float, y: float, yaw: float) -> None:
        """Append a step to those that are commanded or under way.

        Args:
            sole: its name.
            x: of the sole's centre in the world [m].
            y: of the sole's centre in the world [m].
            yaw: its heading [rad].
        """
        soles = self._engine.parts.stand.soles
        if sole not in soles:
            self.commands.notice = f"foothold of {sole!r} ignored: no sole of this robot"
            return
        foot = soles.index(sole)
        place = Placement(position=(_double(x), _double(y), 0.0), yaw=_double(yaw))
        self.commands.add_foothold(Foothold(foot, place))

    def hold(self, motion: FootMotion | None) -> None:
        """Move the swing foot by a motion in place of timed steps.

        The engine shifts the weight first, keeps the balance over the stance foot for as long as
        the other one is up, and takes the feet over while it has to catch the robot, or is given a
        velocity.

        Args:
            motion: of the feet; None to put down a swing foot and end.
        """
        self._engine.hold(motion)

    @property
    def mode(self) -> Mode:
        """Feet that carry the robot."""
        return self._engine.mode

    @property
    def notice(self) -> str:
        """Part of the last command that was cut or ignored; "" for nothing."""
        return self.commands.notice

    @property
    def status(self) -> WalkStatus:
        """State of the walk."""
        return self._engine.status

    @property
    def steps_made(self) -> int:
        """Number of touchdowns."""
        return self._engine.steps.steps_made

    @property
    def lifting(self) -> tuple[int, bool] | None:
        """Foot that is lifted, 0 for the left one, and whether it is in the air; None for none."""
        mode = self._engine.mode
        return None if mode is Mode.D else (self._engine.steps.foot, mode.single)

    @property
    def landing(self) -> Placement | None:
        """Foothold of the swing foot; None in double support."""
        flight = self._engine.steps.flight
        return None if flight is None else flight.goal

    @property
    def dcm_error(self) -> Vector2:
        """Deviation of the DCM from its reference [m]."""
        return self._engine.dcm_error

    @property
    def zmp(self) -> Vector2:
        """Reference of the ZMP, feedback included [m]."""
        return self._engine.zmp

    def signals(self) -> Mapping[str, Float64[np.ndarray, " n"] | float | str]:
        """Signals of the last tick for a recorder."""
        return {
            "zmp_reference": self.zmp.copy(),
            "velocity_command": np.array(self.commands.velocity),
            "mode": f"walk {self.status.value}",
            "notice": self.notice,
        }

    def leads(self, task: Task) -> bool:
        """Return whether the walk sets a task's target by itself: the CoM's and the feet's."""
        tasks = self._engine.parts.tasks
        return task is tasks.com or task in tasks.feet

    def holds(self, contact: str) -> bool:
        """Return whether the walk loads and unloads a contact of that name."""
        return any(contact == c.name for c in self._engine.parts.tasks.contacts)

    def lead(self, state: RobotState) -> None:
        """Set targets and contacts for the next tick.

        Args:
            state: of the robot; one that is not finite, its time included, is passed over.
        """
        self._engine.lead(state)


def _double(value: float) -> float:
    """Return a number of any kind as a double, infinite where none holds it."""
    # Those of a joystick are of float32, which Pinocchio does not take.
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _check_alone(gait: Gait | None, q: Numbers | None, ground: Ground | None) -> None:
    """Raise ConfigurationError for an argument that the plan sets."""
    for name, value in (("gait", gait), ("q", q), ("ground", ground)):
        if value is not None:
            raise ConfigurationError(
                f"{name} of a walker that has a plan",
                got=type(value).__name__,
                wanted=f"the plan's own: give {name} when the plan is made",
            )
