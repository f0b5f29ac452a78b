"""`TorqueLevel`: step teleoperation where torques are commanded, by the stepping engine."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from poise.control import Controller, ControllerPlan, make_controller
from poise.dynamics import Dynamics, RobotState
from poise.locomotion._stepping._biped import Biped, TeleopParameters
from poise.locomotion._stepping._estimator import StanceEstimator
from poise.locomotion._stepping._feet import LevelTick, SteppingLevel
from poise.locomotion._stepping._footing import Footing
from poise.locomotion._stepping._guard import DeviceStatus, OperatorGuard
from poise.locomotion._stepping._sample import BodyCommand, OperatorSample
from poise.locomotion._stepping._torque_tasks import TorqueTasks
from poise.locomotion._walking import (
    Mode,
    SteppingEngine,
    VelocityLimits,
    WalkSettings,
    level_floor,
    make_parts,
    stand_of,
    usual_gait,
)
from poise.stack import JointTask

_REST = 0.3
"""Time at rest after which the operator may move the feet again [s]."""

_STILL, _ROCKING = 0.1, 2.0
"""A CoM that is faster does not rest [m/s], and for how long at most that counts [s]: on an edge a
robot may rock for ever."""

_CLOSING = 6.0
"""For so long at most the robot goes on stepping only to have its feet nearer together [s]."""

_CAPTURE = WalkSettings(zmp_margin=0.005, clearance=0.03, bounce_time=0.03)
"""Settings while the robot steps: feet that touch each other do not come down; load cells have
noise of as much as counts as a bounce, and a sole that came down on an edge turns over it."""

_HIGHER = 1.6
"""Swing height of a capture step over that of a walk, so that it does not stumble over a bump."""


class TorqueLevel(SteppingLevel):
    """Feet by the operator's devices, or by the engine where it walks or catches the robot."""

    def __init__(
        self,
        biped: Biped,
        parameters: TeleopParameters,
        estimator: StanceEstimator,
        limbs: Sequence[JointTask],
        solved_by: str,
        q_start: Float64[np.ndarray, " nq"],
    ) -> None:
        self._tasks, self._solved_by = TorqueTasks(biped, parameters.dt, limbs), solved_by
        super().__init__(biped, parameters, estimator, self._tasks.stack, servos=False)
        stand = stand_of(biped.robot, q_start)
        gait = usual_gait(stand.com[2] - stand.middle[2])
        gait = replace(gait, swing_height=_HIGHER * gait.swing_height)
        self._crouch = gait.crouch
        self._engine = SteppingEngine(
            self._tasks.stack,
            # Trunk and arms stay whose they are.
            lambda: make_parts(
                biped.robot,
                self._tasks.stack,
                stand,
                gait,
                _CAPTURE,
                VelocityLimits(),
                level_floor(stand.start),
                (),
                estimator.sense,
            ),
        )
        # The CoM shifter's k_p under its gain rule: one setting of the DCM feedback.
        self._engine.held_gain = parameters.kp / self._engine.parts.legs.omega

    @property
    def mode(self) -> Mode:
        return self._engine.mode

    def controller(self, dynamics: Dynamics, time_limit: float | None) -> Controller:
        plan = ControllerPlan(name=self._solved_by, time_limit=time_limit)
        return make_controller(self._biped.robot, self.stack, plan, dynamics=dynamics)

    def outcome(self, footing: Footing) -> LevelTick:
        """Return the outcome of the last tick; feedback is part of the reference of the ZMP."""
        del footing
        steps, zmp = self._engine.steps, self._engine.zmp
        target = np.full(3, np.nan)
        if steps.held:
            target = self._devices.sent
        elif steps.flight is not None:
            target = np.array(steps.flight.goal.position)
        return LevelTick(target, zmp, zmp, steps.ended)

    def reset(self) -> None:
        self._engine.reset()
        parts = self._engine.parts
        self._tasks.reset()
        self._begin(parts.legs.omega, parts.region)
        self._seen, self._overruled, self._driven = Mode.D, False, False
        self._rested, self._held = 0.0, 0.0
        self._closing: float | None = None

    def lead(
        self,
        state: RobotState,
        guard: OperatorGuard,
        command: OperatorSample | None,
        body: BodyCommand,
    ) -> bool:
        """Set the stack for a tick; return whether a walk by velocity has ended in it."""
        engine, devices, footing = self._engine, self._devices, self._footing()
        devices.update(command, guard.held, footing)
        devices.turns = body.turns
        engine.rise = self._crouch + body.height
        self._limit_stoop(footing)
        self._drive(guard.velocity)
        engine.hold(None if self._overruled else devices)
        engine.lead(state)
        if engine.overrules and not self._overruled:
            self._overruled, self._rested, self._held, self._closing = True, 0.0, 0.0, None
        mode = engine.mode
        if mode is not self._seen:
            self._estimator.begin(self._seen, mode)
            self._seen = mode
            if mode is Mode.D:
                devices.update(command, guard.held, self._footing())
                devices.stand()
        self._estimator.follow(mode)
        if mode is not footing.mode or self._estimator.stance != footing.stance:
            footing = self._footing()
        self.footing = footing
        if not self._overruled:
            upright = command is not None and command.upright
            self._tasks.lead(footing, body.torso, devices.sent, upright=upright)
            return False
        guard.let_go(DeviceStatus.WALKING if self._driven else DeviceStatus.OVERRULED)
        self._tasks.accompany(footing, walks=self._driven)
        return self._settle(footing, any(guard.velocity))

    def _limit_stoop(self, footing: Footing) -> None:
        """Limit the descent of the body to the torque of the stance knee."""
        usual = self._engine.parts.height
        lowest = (1.0 - self._parameters.stoop_max) * usual
        if footing.mode.support is not None:
            lowest = self._devices.limit_descent(lowest)
        self._engine.lowest = lowest / usual

    def _drive(self, velocity: tuple[float, float, float]) -> None:
        """Walk with a velocity; zero brings the feet side by side."""
        commands = self._engine.commands
        if any(velocity) or self._driven:
            commands.set_velocity(*velocity)
            self._driven = True
        else:
            commands.closes = False
        if any(velocity):
            self._closing = None
        elif self._closing is not None:
            # Each step is another chance to stumble: near enough is enough.
            commands.closes = self._closing <= _CLOSING

    def _settle(self, footing: Footing, walks: bool) -> bool:
        """Re-engage the operator once the robot rests; return whether it has walked."""
        p = self._parameters
        rests = self._engine.at_rest and not walks
        self._held = self._held + p.dt if rests else 0.0
        x, y, z = footing.dynamics.com_velocity.tolist()
        still = x * x + y * y + z * z < _STILL * _STILL or self._held > _ROCKING
        self._rested = self._rested + p.dt if rests and still else 0.0
        fits = self._reach.spans(footing.sole(0), footing.sole(1), footing.heading)
        if self._closing is not None:
            self._closing = _CLOSING + p.dt if fits else self._closing + p.dt
        if self._rested <= _REST:
            return False
        if not fits and (self._closing or 0.0) <= _CLOSING:
            self._closing = self._closing or 0.0
            return False
        walked = self._driven
        self._overruled = self._driven = False
        self._closing = None
        self._devices.stand()
        return walked

    def _footing(self) -> Footing:
        return self._stand(
            mode=self._engine.mode,
            parts=self._engine.parts.stance.parts,
            has_left=self._devices.foot_has_left,
        )
