"""`StanceEstimator`: where the robot is, from joints, the torso's attitude and a foot at rest.

`ZmpSensor`: the ZMP from the load cells of the soles.
"""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import is_array
from poise.control import is_usable
from poise.dynamics import CheckedWrenches, Dynamics, RobotState
from poise.estimation import (
    AttitudeBiasEstimator,
    EstimatorConfig,
    LoadCellTare,
    LoadCellVote,
    PayloadEstimator,
    StampedPredictor,
    StateEstimator,
)
from poise.locomotion._stepping._stance._parameters import BASE_JOINT
from poise.locomotion._support import Rotation, Vector2, Vector3
from poise.locomotion._walking import CLEARANCE, UNLOADED, WalkSense
from poise.robots import Robot

_DONE = 0.5
"""Part of what was commanded within the sensors' delay that counts as done: with less the rates of
the legs are off, with more that of the base."""

_CORRECTED = EstimatorConfig(tare=False, vote=False)


class ZmpSensor:
    """Centre of pressure (-m_y, m_x) / f_z of both soles, smoothed; the last while none press."""

    def __init__(self, weight: float, time_constant: float, dt: float) -> None:
        self._least = UNLOADED * weight
        self._gain = dt / (time_constant + dt)
        self.zmp: Vector2 = np.zeros(2)  # x and y [m]
        self.loads: Vector2 = np.zeros(2)  # normal forces, left and right [N]
        self.pulls: list[tuple[float, float]] = [(0.0, 0.0), (0.0, 0.0)]
        self.centres: list[tuple[float, float] | None] = [None, None]
        self._fresh = True

    def update(self, sense: WalkSense) -> None:
        """Reads one measurement."""
        pressed_x = pressed_y = total = 0.0
        for i, wrench in enumerate(sense.wrenches):
            fx, fy, load, mx, my, _ = wrench or (0.0,) * 6
            self.loads[i] = load = load if load > 0.0 else 0.0
            self.pulls[i] = (fx, fy)
            self.centres[i] = (-my / load, mx / load) if load > self._least else None
            if load > self._least:
                (x, y, _), R = sense.positions[i], sense.rotations[i]
                pressed_x += load * x - R[0] * my + R[1] * mx
                pressed_y += load * y - R[3] * my + R[4] * mx
                total += load
        if total <= 0.0:
            return
        x, y = pressed_x / total, pressed_y / total
        if not self._fresh:
            before_x, before_y = self.zmp.tolist()
            x, y = before_x + self._gain * (x - before_x), before_y + self._gain * (y - before_y)
        self.zmp, self._fresh = np.array([x, y]), False


class StanceEstimator:
    """The base from kinematics: the stance sole stays where it was put down.

    It reads joints, the attitude and angular velocity of the base, and the soles' loads; never the
    base's position or linear velocity. With readings of an inertial unit the linear velocity is
    that of a `StateEstimator`, which notices a stance sole that rocks on its edge; without, the one
    with which that sole rests. What feet slip the position drifts.
    """

    def __init__(
        self,
        robot: Robot,
        soles: tuple[str, str],
        q_start: Float64[np.ndarray, " nq"],
        *,
        inertial: bool = False,
    ) -> None:
        self.dynamics = Dynamics(robot)  # of the estimated state
        self._robot, self._data = robot, robot.model.createData()
        self._sense = WalkSense(robot, soles, self.dynamics)
        self._soles = [robot.frame_id(name) for name in soles]
        self._world_R_base = self.dynamics.motion.placements[BASE_JOINT, :9].reshape(3, 3).T
        self._start = RobotState(q_start, np.zeros(robot.nv))
        self._inertial = StateEstimator(robot, _CORRECTED, q_start=q_start) if inertial else None
        self._payload = PayloadEstimator(robot) if inertial else None
        self._attitude = AttitudeBiasEstimator() if inertial else None
        self._now = StampedPredictor(robot, _DONE) if inertial else None
        self.tare, self._vote = LoadCellTare(soles, robot.weight), LoadCellVote(robot)
        self.anchors: list[Vector3] = []
        self.reset()

    def reset(self) -> None:
        """Back to the configuration at the start."""
        self.tare.reset()
        self._vote.reset()
        self._last: RobotState | None = None
        for part in (self._inertial, self._payload, self._attitude, self._now):
            if part is not None:
                part.reset()
        self.dynamics.update(self._start)
        self.anchors[:] = [self.sole(foot).copy() for foot in (0, 1)]
        self.stance = 1  # index of the sole that is taken to be at rest

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
        if self._attitude is not None:
            q[3:7] = self._attitude.corrected(q[3:7])
        fused = None if inertial is None else inertial.update(known)
        if inertial is not None and fused is not None and inertial.status.ok:
            # Along the base's own axes it does not matter how upright either says the base is.
            v[:3] = fused.v[:3]
            pin.forwardKinematics(self._robot.model, self._data, q)
        else:
            v[:3] = self._resting_velocity(q, v)
        sole = self._soles[self.stance]
        place = pin.updateFramePlacement(self._robot.model, self._data, sole)
        np.subtract(self.anchors[self.stance], place.translation, out=q[:3])
        if self._payload is not None and not estimated:
            known = self._payload.update(known)
        self._last = known
        self.dynamics.update(known)
        if self._attitude is not None and self._payload is not None and not estimated:
            force, velocity = self._payload.force, self.dynamics.com_velocity
            self._attitude.update(known.time, force, velocity, self._world_R_base)
        if self._now is None:
            return known
        now = self._now.predict(known)
        if now is not known:
            self.dynamics.update(now)
        return now

    def command(self, acceleration: Float64[np.ndarray, " nv"] | None, time: float) -> None:
        """Takes in what the robot was commanded, once a tick; without it states stay late."""
        if self._now is not None:
            self._now.command(acceleration, time)

    def _without_base_motion(self, state: object) -> RobotState | None:
        """A copy less what no sensor gives: where the base is and how fast it goes along."""
        robot = self._robot
        if not isinstance(state, RobotState):
            return None
        if not (is_array(state.q, robot.nq) and is_array(state.v, robot.nv)):
            return None
        q, v = state.q.copy(), state.v.copy()
        q[:3], v[:3] = 0.0, 0.0
        # The payload of the last state: the estimate is made anew only where it changes.
        payload = state.payload if self._payload is None else self._payload.payload
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
        """A sole stands on the ground where it is now."""
        self.anchors[foot] = self.sole(foot).copy()

    def stand_on(self, foot: int) -> None:
        """From now on this sole is the one at rest; the estimate stays continuous."""
        if foot != self.stance:
            self.put_down(foot)
            self.stance = foot

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
