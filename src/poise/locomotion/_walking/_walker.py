"""`Walker`: walks along a plan, or by velocities and footholds that are given while it walks."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers, all_finite, is_time
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.locomotion._support import SolePart
from poise.locomotion._walking._commands import Foothold, VelocityLimits
from poise.locomotion._walking._feedback import DcmFeedback
from poise.locomotion._walking._footsteps import (
    FootstepPlan,
    Gait,
    level_floor,
    stand_of,
    usual_gait,
)
from poise.locomotion._walking._ground import Ground, Placement
from poise.locomotion._walking._leg_momentum import JoinedSupport
from poise.locomotion._walking._parts import make_parts
from poise.locomotion._walking._sense import LONGEST_TICK
from poise.locomotion._walking._settings import WalkSettings, WalkStatus
from poise.locomotion._walking._step_cycle import Phase, StepCycle
from poise.locomotion._walking._tasks import CarriedTarget
from poise.locomotion._walking._trouble import RESPONSES, Hanging, HangWatch, Response, TroubleWatch
from poise.robots import Robot
from poise.stack import Stack, Task

_MISPLACED = 0.03
"""How far a sole may be from where a plan begins [m]."""


class Walker:
    """Walks as it is told, now: a `poise.stack.Leader`.

    Its steps come from a plan that was made before it began, or it is led by `set_velocity` and
    `step_to` while it walks. The next footholds are made anew in every tick from what is asked
    for, and from them, by backward recursion, where the divergent component of motion should be.
    While a foot is in the air, place and time of its touchdown are chosen from the measured one.
    Standing, the robot steps by itself when its feet cannot hold it, and comes back to rest side by
    side.

    It only sets targets of tasks and loads of contacts of the stack: the COM task (its target, and
    the acceleration that keeps the balance), the frame task of the foot in the air, the contacts of
    both soles, and every other frame task, which goes along with the body. It never raises while it
    runs: what is cut of a command is said by `notice`, what goes wrong by `status`.

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
        carry: names of frame tasks that go along with the body; all that are on no sole when None.

    Attributes:
        stack: what it leads.
        plan: with which it began.
        gait: timing and shape of a step.
        settings: feedback and touchdown.
        limits: of velocities.
        status: how the walk stands.
        carried: targets that go along with the body, by the name of their task.

    Raises:
        ConfigurationError: the stack lacks something, the robot does not stand on two soles, a
            leg does not reach where the plan wants it, or feet as far apart as the gait says touch
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
        parts = self._parts = make_parts(
            robot, stack, stand, self.gait, self.settings, self.limits, self.ground, carry
        )
        self.height, self.commands = parts.height, parts.commands
        if plan is not None:
            # Now, so that all that is said before the first tick comes after it.
            self.commands.follow(plan)
        self.carried: Mapping[str, CarriedTarget] = parts.tasks.carried
        self.status = WalkStatus.READY
        self._steps = StepCycle(parts)
        self._feedback = DcmFeedback(parts.legs.omega, self.settings.dcm_gain)
        self._hang_watch = HangWatch(parts.sense, parts.tasks.contacts)
        self._watch = TroubleWatch(parts.sense, self.settings, self.height)
        self._hanging: Hanging | None = None
        self._time: float | None = None

    # What somebody who leads it says --------------------------------------------------------------

    def set_velocity(self, ahead: float, sideways: float = 0.0, turn: float = 0.0) -> None:
        """Walks with a velocity from now on; zero brings the robot to rest, feet side by side.

        Args:
            ahead: [m/s].
            sideways: to the left [m/s].
            turn: to the left [rad/s].
        """
        self.commands.set_velocity(_double(ahead), _double(sideways), _double(turn))

    def take_over(
        self,
        state: RobotState,
        airborne: int | None = None,
        zmp: Float64[np.ndarray, "2"] | None = None,
    ) -> None:
        """Begins anew from what somebody else has led the robot to, who may take it back at rest.

        It makes no step but those that the robot needs in order not to fall: feet stay where they
        are as long as they hold it.

        Args:
            state: of the robot; one that is not finite, its time included, is passed over.
            airborne: the foot that is in the air, which comes down where that helps; 0 for the left
                one, None for none.
            zmp: as asked for last, from which it goes on without a jump [m]; None where there is no
                time for that.
        """
        if not _is_finite(state):
            return
        self._parts.sense.update(state)
        self._time, self._hanging = state.time, None
        # What was the trouble when it led last is long over.
        self._watch.forget()
        self._steps.stand()
        self.commands.stop()
        self.commands.closes = False
        self._begin()
        if airborne is not None:
            self._steps.put_down(airborne)
        if zmp is not None:
            feet, _, _ = self._parts.pendulum.feet(self._steps.flight)
            self._feedback.go_on_from(self._parts.legs.joined((zmp[0], zmp[1]), feet))

    def close(self, closes: bool) -> None:
        """Brings the feet side by side, as after a walk, or leaves them where they are.

        Args:
            closes: whether.
        """
        self.commands.closes = closes

    def feel(self, state: RobotState) -> None:
        """Learns what soles carry on, and whether one hangs, while somebody else leads two feet.

        Contacts are told what has carried lately, on the average: a sole that rocks for a moment
        has another area in every tick, and one that stands on an edge tips over where all of it is
        taken to carry.

        Args:
            state: of the robot; one that is not finite, its time included, is passed over.
        """
        if not _is_finite(state):
            return
        dt = self._since_last(state)
        self._time = state.time
        self._parts.sense.look(state)
        for area in self._parts.areas:
            area.feel(state, dt)
        self._hang_watch.update(state, dt)

    def forget(self) -> None:
        """All of both soles carries, for all that is known, and no foot hangs."""
        self._time = None
        for area in self._parts.areas:
            area.forget()
        self._hang_watch.forget()

    def forget_everything(self) -> None:
        """Likewise, and the ground is level; whoever begins another run asks for this."""
        self.forget()
        self._parts.stance.slope = (0.0, 0.0)
        self._steps.steps_made = 0

    @property
    def parts(self) -> list[SolePart | None]:
        """What of each sole carries, left then right; None for all of it."""
        return self._parts.stance.parts

    @property
    def hanging(self) -> int | None:
        """A foot that should stand and hangs in the air, 0 for the left one; None for none."""
        return self._hang_watch.foot

    def step_to(self, sole: str, x: float, y: float, yaw: float) -> None:
        """Makes a step, after those that were asked for before and the one under way.

        Args:
            sole: its name.
            x: of the sole's centre in the world [m].
            y: likewise [m].
            yaw: its heading [rad].
        """
        soles = self._parts.stand.soles
        if sole not in soles:
            self.commands.notice = f"foothold of {sole!r} ignored: no sole of this robot"
            return
        foot = soles.index(sole)
        place = Placement(position=(_double(x), _double(y), 0.0), yaw=_double(yaw))
        self.commands.add_foothold(Foothold(foot, place))

    @property
    def notice(self) -> str:
        """What was cut or ignored of the last command; "" for nothing."""
        return self.commands.notice

    # What a recorder may know ---------------------------------------------------------------------

    @property
    def phase(self) -> Phase:
        """What the feet do."""
        return self._steps.phase

    @property
    def steps_made(self) -> int:
        """How many steps are behind."""
        return self._steps.steps_made

    @property
    def lifting(self) -> tuple[int, bool] | None:
        """Which foot is being lifted, 0 for the left one, and whether it is in the air."""
        if self.phase is Phase.STAND:
            return None
        return self._steps.foot, self.phase is Phase.SWING

    @property
    def landing(self) -> Placement | None:
        """Where the foot in the air comes down; None with both on the ground."""
        flight = self._steps.flight
        return None if flight is None else flight.goal

    @property
    def held(self) -> bool:
        """Whether the feet as they stand hold the robot, on what carries of their soles."""
        return self._steps.phase is Phase.STAND and self._steps.is_held()

    @property
    def dcm_error(self) -> Float64[np.ndarray, "2"]:
        """How far the divergent component of motion is from its reference [m]."""
        return self._feedback.error

    @property
    def zmp(self) -> Float64[np.ndarray, "2"]:
        """Where the ZMP should be, feedback included [m]."""
        feet, _, _ = self._parts.pendulum.feet(self._steps.flight)
        x, y = self._feedback.zmp.tolist()
        return np.array(self._parts.legs.parted((x, y), feet))

    def signals(self) -> Mapping[str, Float64[np.ndarray, " n"] | float | str]:
        """What a recorder should know of the last tick."""
        return {
            "zmp_reference": self.zmp.copy(),
            "velocity_command": np.array(self.commands.velocity),
            "mode": f"walk {self.status.value}",
            "notice": self.notice,
        }

    def leads(self, task: Task) -> bool:
        """Whether the walk sets a task's target by itself: the COM's and the feet's."""
        tasks = self._parts.tasks
        return task is tasks.com or task in tasks.feet

    def holds(self, contact: str) -> bool:
        """Whether the walk loads and unloads a contact of that name."""
        return any(contact == c.name for c in self._parts.tasks.contacts)

    # A tick ---------------------------------------------------------------------------------------

    def lead(self, state: RobotState) -> None:
        """Sets what the next tick should do.

        Args:
            state: of the robot; one that is not finite, its time included, is passed over.
        """
        if not _is_finite(state):
            return
        dt = self._since_last(state)
        self._time = state.time
        self._parts.sense.update(state)
        for area in self._parts.areas:
            area.update(state, dt)
        self._parts.stance.feel()
        self._hang_watch.update(state, dt)
        if self.status is WalkStatus.READY:
            self._start()
        if self.status is WalkStatus.MISPLACED or self._is_stopped_by_trouble(state, dt):
            return
        self.commands.advance(dt)
        if self.hanging is not None:
            self._steps.catch(self.hanging)
        self._steps.advance(state, dt)
        self._keep_balance(dt)
        if self.status.ok:
            self.status = self._plain_status
        self._announce_step()

    def _since_last(self, state: RobotState) -> float:
        """Since the last state [s]."""
        return 0.0 if self._time is None else min(max(state.time - self._time, 0.0), LONGEST_TICK)

    def _is_stopped_by_trouble(self, state: RobotState, dt: float) -> bool:
        """Does what `RESPONSES` says."""
        error = math.hypot(*self._feedback.error)
        flight = self._steps.flight
        trouble = self._watch.look(state, flight, error, dt)
        self.status = trouble or self._plain_status
        response = Response() if trouble is None else RESPONSES[trouble]
        self.commands.pace = response.pace
        if response.lands and flight is not None:
            flight.land()
        if response.hangs:
            self._hang(state)
        elif self._hanging is not None:
            self._hanging.end()
            self._hanging = None
            self._begin()
        return response.hangs

    @property
    def _plain_status(self) -> WalkStatus:
        return WalkStatus.STANDING if self.phase is Phase.STAND else WalkStatus.WALKING

    def _hang(self, state: RobotState) -> None:
        """Asks for nothing but that the robot stays as it is, wherever it is taken."""
        parts = self._parts
        if self._hanging is None:
            self._hanging = Hanging(state, parts.sense, parts.tasks)
            self._steps.stand()
            # Put down again, it stands until somebody says something else.
            self.commands.stop()
        mass, _ = parts.pendulum.mass(self._steps.flight)
        self._hanging.follow(state, parts.body, mass)
        self._announce_step()

    def _announce_step(self) -> None:
        limit = self.stack.balance_limit
        if limit.enabled:
            self._steps.announce(limit)

    def _start(self) -> None:
        """Begins where the robot stands, which is where its plan begins if it has one."""
        if self.plan is not None:
            for foot, place in enumerate(self.plan.start):
                if math.dist(self._parts.sense.sole(foot)[0].tolist(), place.position) > _MISPLACED:
                    self.status = WalkStatus.MISPLACED
                    return
        self._begin()

    def _begin(self) -> None:
        parts = self._parts
        self.status = WalkStatus.STANDING
        self._feedback.begin()
        self._steps.begin()
        mass, _ = parts.pendulum.mass(self._steps.flight)
        parts.body.begin(mass, float(parts.sense.com[2]), parts.stance.heading)

    def _keep_balance(self, dt: float) -> None:
        """Leads the COM, and what goes along with it, where the divergent component should be."""
        parts, steps = self._parts, self._steps
        begins = steps.steps_made == 0
        goal = parts.rise.goal(parts.stance, steps.flight, parts.body.rise[0], begins=begins)
        parts.body.move(*goal, dt)
        com = parts.body.follow(steps.dcm, dt)
        feet, velocities, accelerations = parts.pendulum.feet(steps.flight)
        joined, velocity = parts.pendulum.mass(steps.flight)
        x, y = self._feedback.acceleration(
            np.array(joined),
            np.array(velocity),
            com,
            JoinedSupport(parts.legs, parts.stance.support, feet),
            dt,
        ).tolist()
        rows = zip(com.tolist(), (feet, velocities, accelerations), parts.body.rise, strict=True)
        com = np.array([(*parts.legs.parted((a, b), f), z) for (a, b), f, z in rows])
        asked = parts.legs.parted((x, y), accelerations)
        parts.tasks.lead_com(parts.sense, com, np.array(asked))
        parts.body.carry(com)


def _double(value: float) -> float:
    """A number of any kind, infinite where no double holds it.

    Those of a joystick are of float32, which Pinocchio does not take.
    """
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _is_finite(state: RobotState) -> bool:
    """Whether a state is one to go by."""
    return is_time(state.time) and all_finite(state.q) and all_finite(state.v)


def _check_alone(gait: Gait | None, q: Numbers | None, ground: Ground | None) -> None:
    """Raises ConfigurationError if something is given that a plan has of its own."""
    for name, value in (("gait", gait), ("q", q), ("ground", ground)):
        if value is not None:
            raise ConfigurationError(
                f"{name} of a walker that has a plan",
                got=type(value).__name__,
                wanted=f"the plan's own: give {name} when the plan is made",
            )
