"""`Walker`: leads the tasks and contacts of a stack along a footstep plan."""

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics import RobotState
from poise.locomotion._support import SupportPolygon
from poise.locomotion._walking._feedback import DcmFeedback, PlanShift, StepCatcher
from poise.locomotion._walking._footsteps import FootstepPlan
from poise.locomotion._walking._ground import Placement
from poise.locomotion._walking._reach import LegReach
from poise.locomotion._walking._reference import ReferencePoint, WalkReference
from poise.locomotion._walking._sense import (
    ENGAGE,
    LONGEST_TICK,
    RELEASE,
    WalkSense,
    expect_step,
)
from poise.locomotion._walking._settings import WalkSettings, WalkStatus
from poise.locomotion._walking._swing import SwingFoot
from poise.locomotion._walking._tasks import CarriedTarget, find_walk_tasks
from poise.robots import Robot
from poise.stack import Stack, Task

_LATE = 0.25
"""Ratio of the double support that a late foot may use up before the clock of the walk waits."""

_MISPLACED = 0.03
"""How far a sole may be from where the plan begins [m]."""


class Walker:
    """Walks: a `poise.stack.Leader`.

    It only sets targets of tasks and loads of contacts of the stack: the COM task (its target, and
    the acceleration that keeps the balance), the frame task of the foot in the air, the contacts
    of both soles, and every other frame task, which goes along with the body. It never raises
    while it runs; what goes wrong is a status, after which the robot stands still as well as it
    can: no foot is lifted any more, and no target moves.

    Args:
        robot: the robot.
        plan: its steps.
        stack: the controller's stack: a `ComTask` of all axes, a `FrameTask` of the pose of each
            sole, and a contact on each.
        settings: feedback, touchdown and limits.
        carry: names of frame tasks that go along with the body; all that are on no sole when None.

    Attributes:
        stack: what it leads.
        plan: the steps.
        settings: feedback, touchdown and limits.
        reference: ZMP, COM and body of the plan.
        status: how the walk stands.
        carried: targets that go along with the body, by the name of their task.

    Raises:
        ConfigurationError: the stack lacks something, or a leg does not reach.
        UnknownNameError: no such frame task to carry.
    """

    def __init__(
        self,
        robot: Robot,
        plan: FootstepPlan,
        stack: Stack,
        settings: WalkSettings | None = None,
        *,
        carry: Sequence[str] | None = None,
    ) -> None:
        self.stack, self.plan, self.settings = stack, plan, settings or WalkSettings()
        self.reference = WalkReference(plan)
        legs = LegReach(robot, plan)
        legs.check(plan, self.reference)
        stack.bind(robot)
        self._tasks = find_walk_tasks(robot, plan, stack, carry)
        self.carried: dict[str, CarriedTarget] = self._tasks.carried
        self.status = WalkStatus.READY
        omega = self.reference.omega
        self._sense = WalkSense(robot, plan.soles)
        self._feedback = DcmFeedback(omega, self.settings.dcm_gain)
        self._shift = PlanShift(omega)
        self._catcher = StepCatcher(
            plan,
            omega,
            self.settings.adjust,
            self.settings.zmp_margin,
            legs.longest_step(self.reference.height),
        )
        self._clock = 0.0
        self._time: float | None = None
        self._step = 0
        self._swing: SwingFoot | None = None
        self._stance = plan.start[0]
        self._released = False
        self._waited = 0.0
        self._support = SupportPolygon([], 0.0)
        self._middle: Float64[np.ndarray, "2"] = np.zeros(2)

    @property
    def clock(self) -> float:
        """Time of the plan [s]; it waits for a foot that is late."""
        return self._clock

    @property
    def steps_made(self) -> int:
        """How many steps are behind."""
        return self._step

    @property
    def dcm_error(self) -> Float64[np.ndarray, "2"]:
        """How far the divergent component of motion is from its reference [m]."""
        return self._feedback.error

    @property
    def zmp(self) -> Float64[np.ndarray, "2"]:
        """Where the ZMP should be, feedback included [m]."""
        return self._feedback.zmp

    @property
    def off_plan(self) -> Float64[np.ndarray, "2"]:
        """How far the last foothold is beside its plan [m]."""
        return self._shift.settled

    def leads(self, task: Task) -> bool:
        """Whether the walk sets a task's target by itself: the COM's and the feet's."""
        return task is self._tasks.com or task in self._tasks.feet

    def holds(self, contact: str) -> bool:
        """Whether the walk loads and unloads a contact of that name."""
        return any(contact == c.name for c in self._tasks.contacts)

    def lead(self, state: RobotState) -> None:
        """Sets what the next tick should do.

        Args:
            state: of the robot; one that is not finite is passed over.
        """
        if not math.isfinite(float(state.q.sum()) + float(state.v.sum())):
            return
        dt = 0.0 if self._time is None else min(max(state.time - self._time, 0.0), LONGEST_TICK)
        self._sense.update(state, dt)
        self._time = state.time
        if self.status is WalkStatus.READY:
            self._begin()
        if self.status is WalkStatus.MISPLACED:
            return
        if self._swing is not None:
            self._fly(self._swing, state, dt)
        elif self.status.ok:
            self._stand(dt)
        self._keep_balance(dt)
        self._announce_step()

    def _announce_step(self) -> None:
        """Tells the balance limit of the stack where the next step catches the robot."""
        limit, plan = self.stack.balance_limit, self.plan
        if not limit.enabled:
            return
        if self.status is not WalkStatus.WALKING:
            limit.expect_step(None)
            return
        # The last one stays until the robot stands: a foot that landed does not carry at once.
        step = plan.steps[min(self._step, plan.count - 1)]
        (x, y, z), yaw = step.goal.position, step.goal.yaw
        dx, dy = (self._shift.settled + self._shift.coming).tolist()
        x, y = x + dx, y + dy
        expect_step(limit, (x, y, z), yaw, plan.sizes[step.foot], self.settings.adjust)

    def _begin(self) -> None:
        self.status = WalkStatus.WALKING
        for foot, place in enumerate(self.plan.start):
            position, _ = self._sense.sole(foot)
            if math.dist(position.tolist(), place.position) > _MISPLACED:
                self.status = WalkStatus.MISPLACED
        self._stand_on((0, 1))

    def _stand(self, dt: float) -> None:
        """Both feet on the ground: unload the next one, and lift it when it is due."""
        plan = self.plan
        self._clock += dt
        if self._step >= plan.count:
            if self._clock >= plan.duration:
                self.status = WalkStatus.FINISHED
            return
        foot, lift = plan.steps[self._step].foot, plan.lift_off(self._step)
        ramp = RELEASE * plan.gait.double_support
        if not self._released and self._clock >= lift - ramp:
            self._tasks.contacts[foot].release(ramp)
            self._released = True
            # The tick that finds the contact gone comes before the next state: it holds the foot.
            self._tasks.feet[foot].set_target(*self._sense.sole(foot))
        if self._clock >= lift and not self._tasks.contacts[foot].active:
            self._lift(foot)

    def _lift(self, foot: int) -> None:
        step, plan = self.plan.steps[self._step], self.plan
        position, rotation = self._sense.lower_edge(foot)
        x, y, z = step.goal.position
        low = Placement(position=(x, y, z - self.settings.touchdown_depth), yaw=step.goal.yaw)
        time = max(plan.touchdown(self._step) - self._clock, 0.5 * plan.gait.swing_time)
        self._swing = SwingFoot(
            position, rotation, low, step.shape, time, self.settings.search_depth
        )
        self._waited = 0.0
        self._stand_on((1 - foot,))

    def _fly(self, swing: SwingFoot, state: RobotState, dt: float) -> None:
        """One foot in the air: move it, and put it down when it feels the ground."""
        plan, foot = self.plan, self.plan.steps[self._step].foot
        if self.status.ok:
            late = self._clock - plan.touchdown(self._step)
            if late < _LATE * plan.gait.double_support:
                self._clock += dt
            else:
                self._waited += dt
            if self._waited > self.settings.patience:
                self._stop(WalkStatus.FOOT_LOST)
        swing.advance(dt, self._shift.settled + self._shift.coming)
        if self._sense.is_down(swing, state, foot, self.settings):
            self._land(foot)
            return
        self._tasks.lead_foot(self._sense, foot, swing)

    def _land(self, foot: int) -> None:
        self._tasks.contacts[foot].engage(ENGAGE * self.plan.gait.double_support)
        position, _ = self._sense.sole(foot)
        goal = self.plan.steps[self._step].goal
        self._shift.land(position[:2] - goal.position[:2], self._until_next_foot())
        self._swing, self._released = None, False
        self._step += 1
        self._stand_on((0, 1))

    def _stand_on(self, feet: tuple[int, ...]) -> None:
        self._stance = self._sense.placement(feet[-1])
        self._support = self._sense.support(feet, self.plan, self.settings.zmp_margin)
        self._middle = np.mean([self.plan.zmp(f, self._sense.placement(f)) for f in feet], axis=0)

    def _stop(self, status: WalkStatus) -> None:
        """Gives the walk up: a foot in the air comes down, and the robot stands."""
        self.status = status
        if self._swing is not None and status is WalkStatus.FOOT_LOST:
            self._swing.stop_here()
        elif self._swing is None and self._released:
            foot = self.plan.steps[self._step].foot
            self._tasks.contacts[foot].engage(ENGAGE * self.plan.gait.double_support)

    def _keep_balance(self, dt: float) -> None:
        left = self._until_next_foot()
        self._shift.advance(dt, left)
        point = self._reference_now()
        sense = self._sense
        acceleration = self._feedback.acceleration(
            sense.com[:2], sense.com_velocity[:2], point.com[:, :2], self._support
        )
        self._tasks.lead_com(sense, point.com, acceleration)
        turn = pin.utils.rotate("z", float(point.displacement[0, 3]))
        for target in self.carried.values():
            target.write(point.displacement, turn)
        if self.status is WalkStatus.WALKING:
            self._catch(point.com, left, dt)

    def _until_next_foot(self) -> float:
        """How long until the ZMP goes over to the next foothold [s]."""
        if self._step >= self.plan.count:
            return math.inf
        taken_over = self.plan.touchdown(self._step) + 0.5 * self.plan.gait.double_support
        return max(taken_over - self._clock, 0.0)

    def _reference_now(self) -> ReferencePoint:
        """References of the plan with its shift; at rest above the soles if the walk is lost."""
        com, displacement = self.reference.at(self._clock)
        com[:, :2] += self._shift.com
        displacement[:, :2] += self._shift.com
        if not self.status.ok:
            com[0, :2] = self._middle
            com[1:], displacement[1:] = 0.0, 0.0
        return ReferencePoint(com, displacement)

    def _catch(self, com: Float64[np.ndarray, "3 3"], left: float, dt: float) -> None:
        """Moves the next foothold if need be, or gives the walk up."""
        error = self._feedback.error
        if math.hypot(*error) > self.settings.com_bound * self.reference.height:
            self._stop(WalkStatus.COM_LOST)
        elif self._swing is not None and self.settings.adjust > 0.0:
            zmp = com[0, :2] - com[2, :2] / self.reference.omega**2
            self._catcher.advance(self._step, self._stance, error, zmp, self._shift, left, dt)
