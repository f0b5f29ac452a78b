"""Checks of a robot at rest: joints, gravity and inertial unit."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from poise._show import few
from poise.dynamics import Dynamics, RobotState
from poise.hardware._link import Joints, MotorState
from poise.hardware._watchdog import RULES, Trouble
from poise.robots import GRAVITY, Robot

GRAVITY_SHARE = 0.05
"""Largest error of the accelerometer at rest, along the vertical or across, by gravity: a unit
mounted askew by two degrees, and a bias of four times that of `SensorConfig.typical`."""

REST = 0.2
"""Largest root mean square of a speed at rest [rad/s]: a torso half a metre below its hooks that
swings so has a centripetal acceleration of 0.02 m/s^2, less than an accelerometer's bias."""

STOP = 0.05
"""Reach of a mechanical stop around its position limit [rad]: zeros set with a jig are within two
degrees, and a joint that rests on its stop presses it in."""

FRICTION = 0.04
"""Stiction by the torque limit: twice the dry friction in the maker's model of G1, which is 2 % at
the wrists (0.1 of 5 N m) and less elsewhere."""

MODEL_SHARE = 0.1
"""Error of a model's gravity torque: cables and covers are a tenth of a limb's mass."""

START_REACH = 0.1
"""Largest distance to the start [rad]: at the ankles it moves the CoM of a humanoid, 0.65 m above,
by 65 mm, which is more than the length of its heel."""


@dataclass(frozen=True, kw_only=True)
class PreflightCheck:
    """One check of a preflight.

    Attributes:
        name: of the check.
        seen: measured value, as text with its unit.
        wanted: the value that passes.
        remedy: advice for a failed check.
        ok: True if it passed; None if there was nothing to check.
    """

    name: str
    seen: str
    wanted: str
    remedy: str
    ok: bool | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Measurements of several states, one a row."""

    q: Float64[np.ndarray, "n nj"]
    dq: Float64[np.ndarray, "n nj"]
    tau: Float64[np.ndarray, "n nj"]
    temperature: Float64[np.ndarray, "n nj"]
    quaternion: Float64[np.ndarray, "n 4"]
    gyro: Float64[np.ndarray, "n 3"]
    acceleration: Float64[np.ndarray, "n 3"]
    time: Float64[np.ndarray, " n"]
    arrived: Float64[np.ndarray, " n"]

    @staticmethod
    def of(states: Sequence[MotorState]) -> "Samples":
        """Stack states."""
        names = Samples.__dataclass_fields__
        return Samples(**{n: np.array([getattr(s, n) for s in states], float) for n in names})

    @property
    def up(self) -> Float64[np.ndarray, "n 3"]:
        """Vertical in the base's frame, by the quaternion."""
        unit = self.quaternion / np.linalg.norm(self.quaternion, axis=1, keepdims=True)
        x, y, z, w = unit.T
        return np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)


def limbs(robot: Robot) -> dict[str, tuple[int, ...]]:
    """Return the joints that move one hand or sole alone, by its name."""
    ends = [*robot.soles, *robot.hands]
    above = {end: set(robot.joints_above(end)) for end in ends}
    counts = {
        j: sum(j in joints for joints in above.values()) for j in set().union(*above.values())
    }
    first = robot.base_dofs
    return {
        end: tuple(
            sorted(robot.model.joints[j].idx_v - first for j in above[end] if counts[j] == 1)
        )
        for end in ends
    }


def rest_check(samples: Samples) -> PreflightCheck:
    """Check that base and joints are at rest, which the checks of gravity need."""
    fastest = math.sqrt(np.square(np.hstack([samples.dq, samples.gyro])).mean(axis=0).max())
    return PreflightCheck(
        name="at rest",
        seen=f"up to {fastest:.3f} rad/s",
        wanted=f"at most {REST:g} rad/s",
        remedy="wait until nothing swings, and repeat",
        ok=fastest <= REST,
    )


def joint_checks(robot: Robot, samples: Samples, start: Joints | None) -> list[PreflightCheck]:
    """Check that all joints are heard, within limits, in balance with gravity and at the start."""
    silent = np.all(
        (np.ptp(samples.q, axis=0) == 0.0) & (np.ptp(samples.dq, axis=0) == 0.0)[None], 0
    )
    beyond = np.maximum(samples.q - robot.q_max, robot.q_min - samples.q).max(axis=0) > STOP
    checks = [
        of_joints(
            robot,
            silent,
            name="joints heard",
            good="all",
            bad="without any noise",
            wanted="positions and velocities that change",
            remedy="look at these motors' power, bus and addresses",
        ),
        of_joints(
            robot,
            beyond,
            name="position limits",
            good="all within",
            bad="outside",
            wanted=f"within the model's limits by {STOP:g} rad",
            remedy="check order, sign, unit and zero of these joints",
        ),
        _gravity_check(robot, samples),
    ]
    if start is not None:
        distance = np.abs(np.median(samples.q, axis=0) - start)
        checks.append(
            of_joints(
                robot,
                distance > START_REACH,
                name="start posture",
                good=f"within {distance.max():.3f} rad",
                bad=f"up to {distance.max():.3f} rad away",
                wanted=f"within {START_REACH:g} rad",
                remedy="bring the robot to the start posture",
            )
        )
    return checks


def imu_checks(samples: Samples) -> list[PreflightCheck]:
    """Check attitude and accelerometer at rest."""
    force, up = samples.acceleration.mean(axis=0), samples.up.mean(axis=0)
    size = float(np.linalg.norm(force))
    norm = float(np.abs(np.linalg.norm(samples.quaternion, axis=1) - 1.0).max())
    tilt = math.acos(np.clip(up[2], -1.0, 1.0))
    tilt_limit = 0.5 * limit_of(Trouble.FALL)
    cosine = float(force @ up) / max(size * float(np.linalg.norm(up)), 1e-12)
    askew = math.acos(np.clip(cosine, -1.0, 1.0))
    return [
        PreflightCheck(
            name="gravity",
            seen=f"{size:.3f} m/s^2",
            wanted=f"{GRAVITY:g} within {GRAVITY_SHARE:.0%}",
            remedy="check unit and scale of the accelerometer; keep the robot at rest",
            ok=abs(size - GRAVITY) <= GRAVITY_SHARE * GRAVITY,
        ),
        PreflightCheck(
            name="upright",
            seen=f"tilt {tilt:.3f} rad, norm of the quaternion off by {norm:.1g}",
            # A quaternion of single precision is a unit one to 1e-6; components that are lost or
            # interchanged are farther off.
            wanted=f"at most {tilt_limit:g} rad, a unit quaternion",
            remedy="hang the robot upright; the quaternion's order is (x, y, z, w)",
            ok=tilt <= tilt_limit and norm <= 1e-3,
        ),
        PreflightCheck(
            name="accelerometer",
            seen=f"{askew:.3f} rad off the quaternion's vertical",
            wanted=f"at most {GRAVITY_SHARE:g} rad",
            remedy="turn both by the mounting of the inertial unit into the base's axes",
            ok=askew <= GRAVITY_SHARE,
        ),
    ]


def _gravity_check(robot: Robot, samples: Samples) -> PreflightCheck:
    """Compare measured torques with the model's gravity; a stop may carry what pushes into it."""
    q = np.median(samples.q, axis=0)
    tau = samples.tau.mean(axis=0)
    base = robot.q_home[: -robot.nj].copy()
    if robot.floating_base:
        base[3:7] = samples.quaternion[len(samples.quaternion) // 2]
        base[3:7] /= max(float(np.linalg.norm(base[3:7])), 1e-12)
    dynamics = Dynamics(robot)
    dynamics.update(RobotState(np.append(base, q), np.zeros(robot.nv)))
    gravity = dynamics.h[robot.base_dofs :]
    missing = gravity - tau
    stop = (missing > 0.0) & (q <= robot.q_min + STOP) | (missing < 0.0) & (q >= robot.q_max - STOP)
    unknown = ~np.isfinite(tau)
    # The hoist holds the trunk: what joints between it and the base carry depends on the ropes.
    hanging = np.isin(np.arange(robot.nj), [k for joints in limbs(robot).values() for k in joints])
    off = np.abs(missing) > FRICTION * robot.tau_max + MODEL_SHARE * np.abs(gravity)
    worst = float(np.max(np.where(hanging & ~stop & ~unknown, np.abs(missing), 0.0)))
    check = of_joints(
        robot,
        off & hanging & ~stop & ~unknown,
        name="gravity torques",
        good=f"off by {worst:.2f} N m at most",
        bad=f"off by up to {worst:.2f} N m",
        wanted=f"the model's, within friction ({FRICTION:.0%} of the limit) and {MODEL_SHARE:.0%}",
        remedy="check order and sign of these joints, and the model's masses; lift the feet",
    )
    return check if not unknown.all() else _unseen(check, "torques not measured")


def _unseen(check: PreflightCheck, seen: str) -> PreflightCheck:
    return PreflightCheck(
        name=check.name, seen=seen, wanted=check.wanted, remedy=check.remedy, ok=None
    )


def of_joints(
    robot: Robot,
    faulty: Bool[np.ndarray, " nj"],
    *,
    name: str,
    good: str,
    bad: str,
    wanted: str,
    remedy: str,
) -> PreflightCheck:
    names = [robot.joint_names[k] for k in np.flatnonzero(faulty)]
    seen = f"{bad}: {few(names)}" if names else good
    return PreflightCheck(name=name, seen=seen, wanted=wanted, remedy=remedy, ok=not names)


def limit_of(trouble: Trouble) -> float:
    """Return the limit of the watchdog's default table."""
    return min(rule.limit for rule in RULES if rule.trouble is trouble)
