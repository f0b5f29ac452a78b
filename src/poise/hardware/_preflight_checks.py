"""Checks of a link, and of its robot at rest."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Bool, Float64

from poise._show import few
from poise.hardware._last_check import LastCheck
from poise.hardware._link import Joints, Link, LinkStatus, MotorState
from poise.hardware._server import state_kind
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

UNIT = 1e-3
"""Largest error of a quaternion's norm: single precision has 1e-6, and components that are lost or
interchanged are farther off."""


_SIZES = dict.fromkeys(("q", "dq", "tau", "temperature"), 0)  # the robot's number of joints
_SIZES |= {"quaternion": 4, "gyro": 3, "acceleration": 3}

Samples = Any  # a structured array of NumPy, as of `state_kind`


class PreflightCheck(NamedTuple):
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


def stacked(states: Sequence[MotorState]) -> Samples:
    """Return the measurements of several states, one a row."""
    samples = np.zeros(len(states), state_kind(len(states[0].q), 0))
    for name in ("time", "arrived", *_SIZES):
        samples[name] = [getattr(state, name) for state in states]
    return samples


def attitudes(samples: Samples) -> Float64[np.ndarray, "n 4"]:
    """Return the quaternions, normalised."""
    norm = np.linalg.norm(samples["quaternion"], axis=1, keepdims=True)
    return samples["quaternion"] / np.maximum(norm, 1e-12)  # all zero is no unit one, either


def vertical(samples: Samples) -> Float64[np.ndarray, "n 3"]:
    """Return the vertical in the base's frame, by the quaternions."""
    x, y, z, w = attitudes(samples).T
    return np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)


def limbs(robot: Robot) -> dict[str, tuple[int, ...]]:
    """Return the joints that move one hand or sole alone, by its name."""
    above = {end: set(robot.joints_above(end)) for end in (*robot.soles, *robot.hands)}
    parts = dict[str, tuple[int, ...]]()
    for end, joints in above.items():
        own = joints.difference(*(others for other, others in above.items() if other != end))
        parts[end] = tuple(sorted(robot.model.joints[j].idx_v - robot.base_dofs for j in own))
    return parts


def wiring_checks(robot: Robot, link: Link, check: LastCheck) -> list[PreflightCheck]:
    """Check the link's status, names of joints and the last check's limits."""
    known = {"link": link.info.joints, "last check": check.joints}
    others = [whose for whose, names in known.items() if tuple(names) != robot.joint_names]
    status = f"{link.status.value} {link.reason}".strip()
    remedy = "look at cable, network interface and the robot's power"
    checks = [
        PreflightCheck("link", status, "not lost", remedy, link.status is not LinkStatus.LOST)
    ]
    seen = f"other joints or another order: {few(others)}" if others else "the robot's"
    wanted = f"the {robot.nj} joints of {robot.name}, in their order"
    remedy = "load the model of this robot, or convert with poise.robots.JointOrder"
    checks.append(PreflightCheck("joints", seen, wanted, remedy, not others))
    if not others:
        wide = (check.lower < robot.q_min) | (check.upper > robot.q_max)
        wide |= (check.v_max > robot.v_max) | (check.tau_max > robot.tau_max)
        remedy = "make the LastCheck from this robot, with margin >= 0 and scale <= 1"
        checks.append(of_joints(robot, "last check", wide, "wider", "the robot's limits", remedy))
    return checks


def numbers_check(robot: Robot, states: Sequence[MotorState]) -> PreflightCheck:
    """Check that there are states with finite numbers; torques and temperatures may be NaN."""
    faults = [] if len(states) > 1 else [f"{len(states)} states"]
    for name, most in _SIZES.items():
        size = most or robot.nj
        values = [np.asarray(getattr(state, name), float) for state in states]
        if any(value.shape != (size,) for value in values):
            faults.append(f"{name} without {size} numbers")
        elif name not in ("tau", "temperature") and not np.isfinite(values).all():
            bad = np.flatnonzero(~np.isfinite(values).all(axis=0))
            whose = few([robot.joint_names[k] for k in bad]) if not most else "the base"
            faults.append(f"{name} of {whose} not finite")
    seen = faults[0] if faults else f"{len(states)} states, all finite"
    remedy = "look at the motors' power and at the drivers' log"
    return PreflightCheck("numbers", seen, "finite numbers", remedy, not faults)


def timing_checks(
    link: Link, samples: Samples, elapsed: float, seconds: float
) -> list[PreflightCheck]:
    """Check rate, gaps, arrivals and clocks against the rules of the watchdog, in periods."""
    rate, late, gap = link.info.rate, _limit(Trouble.LATE_STATE), _limit(Trouble.GAP)
    stamps, arrivals = np.diff(samples["time"]) * rate, np.diff(samples["arrived"]) * rate
    span, back = max(float(arrivals.sum()), 1.0), int(np.count_nonzero(stamps <= 0.0))
    pace, whole = float(stamps.sum()) / span, elapsed >= seconds and not back
    measured, trip = len(arrivals) * rate / span, getattr(link, "round_trip", None)
    clocks = f"{pace:.4f} s of stamps a second, {back} back, in {elapsed:.3f} of {seconds:g} s"
    # Two lost states, three periods, must not be a gap, nor four periods none.
    rates, use_cable = (3.0 / gap * rate, 4.0 / gap * rate), "use a cable instead of a radio link"
    # The first and the last state may each arrive as late as the watchdog permits.
    paces, stamp = (1.0 - late / span, 1.0 + late / span), "stamp states by one clock, in seconds"
    unload = "give the link's process a real-time priority; unload this computer"
    return [
        _between("rate", measured, rates, "states a second", "correct the publisher's rate"),
        _between("gaps", float(np.abs(stamps).max()), (0.0, gap), "periods of stamps", use_cable),
        _between("arrivals", float(arrivals.max()), (0.0, late), "periods apart", unload),
        _between("clock", pace if whole else math.nan, paces, "s a second", stamp, clocks),
        _between("round trip", trip, (0.0, late / rate), "s", use_cable),
    ]


def rest_checks(
    robot: Robot, link: Link, samples: Samples, start: Joints | None
) -> list[PreflightCheck]:
    """Check joints, inertial unit and supply."""
    speed = math.sqrt(np.square(np.hstack([samples["dq"], samples["gyro"]])).mean(axis=0).max())
    remedy = "wait until nothing swings, and repeat"
    checks = [_between("at rest", speed, (0.0, REST), "rad/s", remedy)]
    silent = np.all(
        [np.ptp(values, axis=0) == 0.0 for values in (samples["q"], samples["dq"])], axis=0
    )
    beyond = np.maximum(samples["q"] - robot.q_max, robot.q_min - samples["q"]).max(axis=0) > STOP
    remedy = "look at these motors' power, bus and addresses"
    checks.append(
        of_joints(robot, "joints heard", silent, "no noise", "values that change", remedy)
    )
    remedy = "check order, sign, unit and zero of these joints"
    wanted = f"within limits by {STOP:g} rad"
    checks.append(of_joints(robot, "position limits", beyond, "outside", wanted, remedy))
    checks.append(_gravity_check(robot, samples))
    if start is not None:
        far = np.abs(np.median(samples["q"], axis=0) - start)
        bad, wanted = f"up to {far.max():.3f} rad away", f"within {START_REACH:g} rad"
        remedy = "bring the robot to the start posture"
        checks.append(of_joints(robot, "start posture", far > START_REACH, bad, wanted, remedy))
    return [*checks, *_imu_checks(samples), *_supply_checks(robot, link, samples)]


def _imu_checks(samples: Samples) -> list[PreflightCheck]:
    force, up = samples["acceleration"].mean(axis=0), vertical(samples).mean(axis=0)
    size, tilt = float(np.linalg.norm(force)), _angle(up[2])
    norm = float(np.abs(np.linalg.norm(samples["quaternion"], axis=1) - 1.0).max())
    askew = _angle(force @ up / max(size * float(np.linalg.norm(up)), 1e-12))
    sizes, most = (GRAVITY * (1.0 - GRAVITY_SHARE), GRAVITY * (1.0 + GRAVITY_SHARE)), GRAVITY_SHARE
    scale = "check unit and scale of the accelerometer"
    hang, order = "hang the robot upright", "its order is (x, y, z, w)"
    turn = "turn attitude and accelerometer by the unit's mounting into the base's axes"
    return [
        _between("gravity", size, sizes, "m/s^2", scale),
        _between("upright", tilt, (0.0, 0.5 * _limit(Trouble.FALL)), "rad", f"{hang}; {order}"),
        _between("quaternion", norm, (0.0, UNIT), "off a unit one", order),
        _between("accelerometer", askew, (0.0, most), "rad off the quaternion's vertical", turn),
    ]


def _supply_checks(robot: Robot, link: Link, samples: Samples) -> list[PreflightCheck]:
    hot = np.nan_to_num(np.fmax.reduce(samples["temperature"], axis=0), nan=-math.inf)
    value, where = float(hot.max()), robot.joint_names[int(hot.argmax())]
    warmest = value if math.isfinite(value) else None
    heat, (volts, least) = (-math.inf, _limit(Trouble.HEAT)), getattr(link, "battery", (None, 0.0))
    return [
        _between("temperature", warmest, heat, f"deg C at {where}", "let the motors cool down"),
        _between("battery", volts, (least, math.inf), "V", "charge the battery"),
    ]


def _gravity_check(robot: Robot, samples: Samples) -> PreflightCheck:
    """Compare measured torques with the model's gravity; a stop may carry what pushes into it."""
    q, tau = np.median(samples["q"], axis=0), samples["tau"].mean(axis=0)
    at = np.append(robot.q_home[: -robot.nj], q)
    if robot.floating_base:
        at[3:7] = attitudes(samples)[len(q) // 2]
    torques = pin.computeGeneralizedGravity(robot.model, robot.model.createData(), at)
    gravity = torques[robot.base_dofs :]
    missing = gravity - tau
    stop = (missing > 0.0) & (q <= robot.q_min + STOP) | (missing < 0.0) & (q >= robot.q_max - STOP)
    # The hoist holds the trunk: what joints between it and the base carry depends on the ropes.
    hanging = np.isin(np.arange(robot.nj), [k for joints in limbs(robot).values() for k in joints])
    judged = hanging & ~stop & np.isfinite(tau)
    off = judged & (np.abs(missing) > FRICTION * robot.tau_max + MODEL_SHARE * np.abs(gravity))
    worst = f"off by up to {np.max(np.abs(missing[judged]), initial=0.0):.2f} N m"
    wanted = f"the model's, within {FRICTION:.0%} of the limit and {MODEL_SHARE:.0%}"
    remedy = "check order and sign of these joints, and the model's masses; lift the feet"
    check = of_joints(robot, "gravity torques", off, worst, wanted, remedy, good=worst)
    return check if judged.any() else check._replace(seen="not measured", ok=None)


def of_joints(
    robot: Robot,
    name: str,
    faulty: Bool[np.ndarray, " nj"],
    bad: str,
    wanted: str,
    remedy: str,
    good: str = "all joints",
) -> PreflightCheck:
    """Return the check that no joint is faulty."""
    names = [robot.joint_names[k] for k in np.flatnonzero(faulty)]
    seen = f"{bad}: {few(names)}" if names else good
    return PreflightCheck(name, seen, wanted, remedy, not names)


def _between(
    name: str,
    value: float | None,
    bounds: tuple[float, float],
    unit: str,
    remedy: str,
    seen: str = "",
) -> PreflightCheck:
    """Return the check of a number; None is one that is not measured."""
    if value is None:
        return PreflightCheck(name, "not measured", "", remedy, None)
    low, high = bounds
    wanted = f"{low:.4g} to {high:.4g}" if low > 0.0 else f"at most {high:g}"
    return PreflightCheck(name, seen or f"{value:.4g} {unit}", wanted, remedy, low <= value <= high)


def _limit(trouble: Trouble) -> float:
    """Return the limit of the watchdog's default table."""
    return min(rule.limit for rule in RULES if rule.trouble is trouble)


def _angle(cosine: float) -> float:
    return math.acos(np.clip(cosine, -1.0, 1.0))
