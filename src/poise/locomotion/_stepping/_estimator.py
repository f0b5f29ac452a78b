"""`StanceEstimator`: base of the robot by joints, the torso's attitude and a foot at rest."""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import is_array
from poise.control import is_usable
from poise.dynamics import CheckedWrenches, Dynamics, RobotState
from poise.estimation import (
    EstimatorConfig,
    LoadCellTare,
    LoadCellVote,
    PayloadEstimator,
    StampedPredictor,
    StateEstimator,
)
from poise.locomotion._stepping._biped import Biped
from poise.locomotion._support import Rotation, Vector3
from poise.locomotion._walking import CLEARANCE, Mode, WalkSense

_DONE = 0.5
"""Part of the accelerations commanded within the sensors' delay that counts as done: with less the
rates of the legs are off, with more that of the base."""

_CORRECTED = EstimatorConfig(tare=False, vote=False)

POSITION_GAIN = 10.0
"""k_v of (17a) and (17c), from distances to velocities of CoM and feet [1/s]."""

LANDED = 0.047
"""Load at which a foot has landed, over the weight: 30 N of the paper's robot."""

TOUCH_SPEED = 0.15
"""Largest speed of a foot downwards at the height of the ground, for the paper's soles [m/s]."""

_LOAD_RATIO = 1.2
"""In double support a foot becomes the stance that carries this many times the other's load."""

_ZMP_TIME = 0.01
"""Time constant with which the measured ZMP is smoothed [s]."""


class StanceEstimator:
    """Base by kinematics: the stance sole stays where it was put down.

    It reads joints, the attitude and angular velocity of the base, and the soles' loads; never the
    base's position or linear velocity. With readings of an inertial unit the linear velocity is
    that of a `StateEstimator`, which notices a stance sole that rocks on its edge; without, the one
    with which that sole rests. Slips of the feet are drift of the position.
    """

    def __init__(
        self,
        biped: Biped,
        q_start: Float64[np.ndarray, " nq"],
        dt: float,
        *,
        inertial: bool = False,
    ) -> None:
        robot, soles = biped.robot, biped.soles
        self.dynamics = Dynamics(robot)  # of the estimated state
        self._robot, self._data = robot, robot.model.createData()
        self._sense = WalkSense(robot, soles, self.dynamics, gain=dt / (_ZMP_TIME + dt))
        self._soles = biped.frames
        self._least_load = LANDED * biped.weight
        self._press_speed, self._dt = TOUCH_SPEED * biped.wide, dt
        self._start = RobotState(q_start, np.zeros(robot.nv))
        self._inertial = StateEstimator(robot, _CORRECTED, q_start=q_start) if inertial else None
        self.payload = PayloadEstimator(robot, attitude=True) if inertial else None
        self._now = StampedPredictor(robot, _DONE) if inertial else None
        self.tare, self._vote = LoadCellTare(soles, robot.weight), LoadCellVote(robot)
        self.anchors: list[Vector3] = []
        self.reset()

    def reset(self) -> None:
        """Restart in the configuration at the start."""
        self.tare.reset()
        self._vote.reset()
        self._sense.reset()
        self._last: RobotState | None = None
        for part in (self._inertial, self.payload, self._now):
            if part is not None:
                part.reset()
        self.dynamics.update(self._start)
        self.anchors[:] = [self.sole(foot).copy() for foot in (0, 1)]
        self.stance = 1  # index of the sole that is taken to be at rest
        self._pressing = False
        self.pressed = 0.0  # how far below its place the other foot is sent in double support [m]

    def update(self, state: RobotState) -> RobotState:
        """Estimate position and velocity of the base; return an unusable state as it is."""
        known = self._without_base_motion(state)
        if known is None or not is_usable(known, self._robot):
            return state
        inertial = None if known.readings is None else self._inertial
        if inertial is not None:
            known = self._vote.update(known, self._last, inertial.filter.rotation[2])
        estimated = self._vote.estimated
        known = self.tare.update(known, self._airborne(), estimated)
        q, v = known.q, known.v
        if self.payload is not None:
            q[3:7] = self.payload.corrected(q[3:7])
        fused = None if inertial is None else inertial.update(known)
        if inertial is not None and fused is not None and inertial.status.ok:
            # Along the base's own axes its attitude does not matter.
            v[:3] = fused.v[:3]
            pin.forwardKinematics(self._robot.model, self._data, q)
        else:
            v[:3] = self._resting_velocity(q, v)
        sole = self._soles[self.stance]
        place = pin.updateFramePlacement(self._robot.model, self._data, sole)
        np.subtract(self.anchors[self.stance], place.translation, out=q[:3])
        if self.payload is not None and not estimated:
            known = self.payload.update(known)
        self._last = known
        self.dynamics.update(known)
        if self._now is None:
            return known
        now = self._now.predict(known)
        if now is not known:
            self.dynamics.update(now)
        return now

    def command(self, acceleration: Float64[np.ndarray, " nv"] | None, time: float) -> None:
        """Take the commanded acceleration, once a tick; without it states stay late."""
        if self._now is not None:
            self._now.command(acceleration, time)

    def _without_base_motion(self, state: object) -> RobotState | None:
        """Return a copy without the base's position and linear velocity, which are not measured."""
        robot = self._robot
        if not isinstance(state, RobotState):
            return None
        if not (is_array(state.q, robot.nq) and is_array(state.v, robot.nv)):
            return None
        q, v = state.q.copy(), state.v.copy()
        q[:3], v[:3] = 0.0, 0.0
        # The payload of the last state: recomputed only where it changes.
        payload = state.payload if self.payload is None else self.payload.payload
        contacts = CheckedWrenches(state.contacts)
        return RobotState(q, v, contacts, state.time, state.readings, payload)

    def _airborne(self) -> tuple[bool, bool]:
        """Return whether each sole is clear of where it stood; the stance never is."""
        other = 1 - self.stance
        clear = self.sense.positions[other][2] - float(self.anchors[other][2]) > CLEARANCE
        return clear and other == 0, clear and other == 1

    @property
    def sense(self) -> WalkSense:
        """CoM, soles and loads of the state of `dynamics`."""
        self._sense.update(self.dynamics.state)
        return self._sense

    def sole(self, foot: int) -> Vector3:
        """Return the position of a sole's centre [m]."""
        return self.sense.sole(foot)[0]

    def rotation(self, foot: int) -> Rotation:
        """Return world_R_sole."""
        return self.sense.sole(foot)[1]

    def put_down(self, foot: int) -> None:
        """Anchor a sole to the ground at its place."""
        self.anchors[foot] = self.sole(foot).copy()

    def stand_on(self, foot: int) -> None:
        """Take this sole as the one at rest; the estimate stays continuous."""
        if foot != self.stance:
            self.put_down(foot)
            self.stance = foot

    def begin(self, before: Mode, mode: Mode) -> None:
        """Set the pose of a landed foot; on lift-off make the other foot the stance."""
        if mode is Mode.D and before.single:
            self.put_down(1 - self.stance)
        if mode.single and mode.support is not None:
            self.stand_on(mode.support)

    def follow(self, mode: Mode) -> None:
        """Take the foot with more load as the stance, each tick in double support."""
        if mode.single:
            return
        sense, stance = self.sense, self.stance
        loads = sense.loads
        if loads[1 - stance] > _LOAD_RATIO * loads[stance]:
            self.stand_on(1 - stance)
        other = 1 - self.stance
        # One that is about to be lifted is to lose its load.
        if mode.support in (None, other):
            self._press(other, sense)
        else:
            self._pressing, self.pressed = False, 0.0

    def _press(self, foot: int, sense: WalkSense) -> None:
        """Lower a foot until it is loaded."""
        anchor, height = self.anchors[foot], float(sense.sole(foot)[0][2])
        if sense.loads[foot] < self._least_load:
            anchor[2] = min(float(anchor[2]), height)
            deeper = self.pressed + self._dt * self._press_speed
            self.pressed = min(deeper, self._press_speed / POSITION_GAIN)
            self._pressing = True
        elif self._pressing:
            anchor[2], self._pressing, self.pressed = height, False, 0.0

    def _resting_velocity(
        self, q: Float64[np.ndarray, " nq"], v: Float64[np.ndarray, " nv"]
    ) -> Vector3:
        """Linear velocity of the base with which the stance sole rests, in the base's axes."""
        jacobian = pin.computeFrameJacobian(
            self._robot.model, self._data, q, self._soles[self.stance], pin.LOCAL_WORLD_ALIGNED
        )
        # That of the base stands in its own axes: a rotation.
        base_R_world = jacobian[:3, :3].T
        return -base_R_world.dot(jacobian[:3, 3:].dot(v[3:]))
