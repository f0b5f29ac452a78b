"""Checks of a link, and of its robot at rest."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._show import few
from poise.hardware._last_check import LastCheck
from poise.hardware._link import Joints, Link, LinkStatus, MotorState
from poise.hardware._server import state_kind
from poise.hardware._watchdog import RULES, Trouble
from poise.robots import GRAVITY, Robot

_GRAVITY_SHARE = 0.05  # accelerometer's error at rest: two degrees askew, or four typical biases
_REST = 0.2  # rms [rad/s]: 0.02 m/s^2 for a torso 0.5 m below its hooks, less than a typical bias
_STOP = 0.05  # reach of a mechanical stop [rad]: zeros set with a jig are within two degrees
_FRICTION = 0.04  # by torque limit: twice that of the maker's model of G1, 0.1 of 5 N m at wrists
_MODEL_SHARE = 0.1  # error of gravity torques: cables and covers are a tenth of a limb's mass
_START_REACH = 1.0  # [rad]: within its ramp a `LinkBody` turns such a joint at 0.6 rad/s at most
_UNIT = 1e-3  # error of a quaternion's norm: single precision has 1e-6, lost components far more
_LIMIT = {rule.trouble: rule.limit for rule in RULES}
_BASE = "quaternion", "gyro", "acceleration"

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


def stacked(robot: Robot, states: Sequence[MotorState]) -> tuple[Samples, PreflightCheck]:
    """Return states as rows, and the check that they are finite, torques and temperatures aside."""
    samples = np.zeros(len(states), state_kind(robot.nj, 0))
    names, wanted = (*robot.joint_names, *_BASE), "finite arrays of all joints and of the base"
    remedy = "look at the motors' power and at the drivers' log"
    try:
        for name in ("time", "arrived", "q", "dq", "tau", "temperature", *_BASE):
            samples[name] = [getattr(state, name) for state in states]
    except ValueError:
        return samples, PreflightCheck("numbers", "another size", wanted, remedy, ok=False)
    good = np.isfinite(samples["q"]) & np.isfinite(samples["dq"])
    good = np.append(good.all(axis=0), [np.isfinite(samples[name]).all() for name in _BASE])
    check = none_of("numbers", names, ~good, "not finite", wanted, remedy)
    few_states = check._replace(seen=f"{len(samples)} states", ok=False)
    return samples, check if len(samples) > 1 else few_states


def attitudes(samples: Samples) -> Float64[np.ndarray, "n 3 3"]:
    """Return the orientations of the base; their third rows are the vertical in its frame."""
    return np.array([pin.Quaternion(q).normalized().matrix() for q in samples["quaternion"]])


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
    names, given = robot.joint_names, {"link": link.info.joints, "last check": check.joints}
    others = [whose for whose, joints in given.items() if tuple(joints) != names]
    status, on = f"{link.status.value} {link.reason}", link.status is not LinkStatus.LOST
    cable = "look at cable, network interface and the robot's power"
    seen = f"other joints or another order: {few(others)}" if others else "the robot's"
    wanted = f"the {robot.nj} joints of {robot.name}, in their order"
    convert = "load the model of this robot, or convert with poise.robots.JointOrder"
    checks = [
        PreflightCheck("link", status, "not lost", cable, on),
        PreflightCheck("joints", seen, wanted, convert, not others),
    ]
    if not others:
        wide = (check.lower < robot.q_min) | (check.upper > robot.q_max)
        wide |= (check.v_max > robot.v_max) | (check.tau_max > robot.tau_max)
        limits, make = "the robot's limits", "make the LastCheck of this robot, with margin >= 0"
        checks.append(none_of("last check", names, wide, "wider", limits, make))
    return checks


def timing_checks(
    link: Link, samples: Samples, elapsed: float, seconds: float
) -> list[PreflightCheck]:
    """Check rate, gaps, arrivals and clocks against the rules of the watchdog, in periods."""
    rate, late, gap = link.info.rate, _LIMIT[Trouble.LATE_STATE], _LIMIT[Trouble.GAP]
    stamps, arrivals = np.diff(samples["time"]) * rate, np.diff(samples["arrived"]) * rate
    span, back = max(float(arrivals.sum()), 1.0), int(np.count_nonzero(stamps <= 0.0))
    pace, whole = float(stamps.sum()) / span, elapsed >= seconds and not back
    # Two lost states, three periods, must not be a gap, nor four periods none.
    rates, cable = (3.0 / gap * rate, 4.0 / gap * rate), "use a cable instead of a radio link"
    # The first and the last state may each arrive as late as the watchdog permits.
    paces, stamp = (1.0 - late / span, 1.0 + late / span), "stamp states by one clock, in seconds"
    unload, trip = "give the link's process a real-time priority", getattr(link, "round_trip", None)
    clock = _between("clock", pace if whole else math.nan, paces, "", stamp)
    seen = f"{pace:.4f} s of stamps a second, {back} back, in {elapsed:.3f} of {seconds:g} s"
    measured = len(arrivals) * rate / span
    return [
        _between("rate", measured, rates, "states a second", "correct the publisher's rate"),
        _between("gaps", float(np.abs(stamps).max()), (0.0, gap), "periods of stamps", cable),
        _between("arrivals", float(arrivals.max()), (0.0, late), "periods apart", unload),
        clock._replace(seen=seen),
        _between("round trip", trip, (0.0, late / rate), "s", cable),
    ]


def rest_checks(
    robot: Robot, link: Link, samples: Samples, start: Joints | None
) -> list[PreflightCheck]:
    """Check joints, inertial unit and supply."""
    names, q, dq = robot.joint_names, samples["q"], samples["dq"]
    speed = math.sqrt(np.square(np.hstack([dq, samples["gyro"]])).mean(axis=0).max())
    silent = (np.ptp(q, axis=0) == 0.0) & (np.ptp(dq, axis=0) == 0.0)
    beyond = np.maximum(q - robot.q_max, robot.q_min - q).max(axis=0) > _STOP
    wait, power = "wait until nothing swings", "look at these motors' power, bus and addresses"
    limits, remedy = f"limits, within {_STOP:g} rad", "check order, sign, unit and zero"
    checks = [
        _between("at rest", speed, (0.0, _REST), "rad/s", wait),
        none_of("joints heard", names, silent, "no noise", "values that change", power),
        none_of("position limits", names, beyond, "outside", limits, remedy),
        _gravity_check(robot, samples),
    ]
    if start is not None:
        far, remedy = np.abs(np.median(q, axis=0) - start), "bring the robot to the start posture"
        bad, wanted = f"up to {far.max():.3f} rad away", f"within {_START_REACH:g} rad"
        checks.append(none_of("start posture", names, far > _START_REACH, bad, wanted, remedy))
    return [*checks, *_imu_checks(samples), *_supply_checks(robot, link, samples)]


def _imu_checks(samples: Samples) -> list[PreflightCheck]:
    force, up = samples["acceleration"].mean(axis=0), attitudes(samples)[:, 2].mean(axis=0)
    size, length = float(np.linalg.norm(force)), float(np.linalg.norm(up))
    cosines = up[2], force @ up / max(size * length, 1e-12)
    tilt, askew = np.arccos(np.clip(cosines, -1.0, 1.0)).tolist()
    norm = float(np.abs(np.linalg.norm(samples["quaternion"], axis=1) - 1.0).max())
    sizes = GRAVITY * (1.0 - _GRAVITY_SHARE), GRAVITY * (1.0 + _GRAVITY_SHARE)
    tilts, scale = (0.0, 0.5 * _LIMIT[Trouble.FALL]), "check the accelerometer's unit and scale"
    order = "the quaternion's order is (x, y, z, w)"
    turn, off = "turn both by the unit's mounting into the base's axes", "rad off the vertical"
    return [
        _between("gravity", size, sizes, "m/s^2", scale),
        _between("upright", tilt, tilts, "rad", f"hang the robot upright; {order}"),
        _between("quaternion", norm, (0.0, _UNIT), "off a unit one", order),
        _between("accelerometer", askew, (0.0, _GRAVITY_SHARE), off, turn),
    ]


def _supply_checks(robot: Robot, link: Link, samples: Samples) -> list[PreflightCheck]:
    hot = np.nan_to_num(np.fmax.reduce(samples["temperature"], axis=0), nan=-math.inf)
    warmest, unit = float(hot.max()), f"deg C at {robot.joint_names[int(hot.argmax())]}"
    warm = (warmest if warmest > -math.inf else None), (-math.inf, _LIMIT[Trouble.HEAT])
    volts, least = getattr(link, "battery", (None, 0.0))
    return [
        _between("temperature", *warm, unit, "let the motors cool down"),
        _between("battery", volts, (least, math.inf), "V", "charge the battery"),
    ]


def _gravity_check(robot: Robot, samples: Samples) -> PreflightCheck:
    """Compare measured torques with the model's gravity; a stop may carry what pushes into it."""
    q, tau = np.median(samples["q"], axis=0), samples["tau"].mean(axis=0)
    at = np.append(robot.q_home[: -robot.nj], q)
    if robot.floating_base:
        at[3:7] = samples["quaternion"][-1]
        pin.normalize(robot.model, at)
    torques = pin.computeGeneralizedGravity(robot.model, robot.model.createData(), at)
    gravity, missing = torques[robot.base_dofs :], torques[robot.base_dofs :] - tau
    low, high = q <= robot.q_min + _STOP, q >= robot.q_max - _STOP
    stop = (missing > 0.0) & low | (missing < 0.0) & high
    # The hoist holds the trunk: what joints between it and the base carry depends on the ropes.
    hanging = np.isin(np.arange(robot.nj), [k for joints in limbs(robot).values() for k in joints])
    judged = hanging & ~stop & np.isfinite(tau)
    off = judged & (np.abs(missing) > _FRICTION * robot.tau_max + _MODEL_SHARE * np.abs(gravity))
    worst = f"off by up to {np.max(np.abs(missing[judged]), initial=0.0):.2f} N m"
    wanted = f"the model's, within {_FRICTION:.0%} of the limit and {_MODEL_SHARE:.0%}"
    remedy = "check order and sign of these joints, and the model's masses; lift the feet"
    check = none_of("gravity torques", robot.joint_names, off, worst, wanted, remedy)
    return check if judged.any() else check._replace(seen="not measured", ok=None)


def none_of(
    name: str, names: Sequence[str], faulty: np.ndarray, bad: str, wanted: str, remedy: str
) -> PreflightCheck:
    """Return the check that nothing of that name is faulty."""
    found = [one for one, bad_one in zip(names, faulty, strict=True) if bad_one]
    seen = f"{bad}: {few(found)}" if found else "all"
    return PreflightCheck(name, seen, wanted, remedy, not found)


def _between(
    name: str, value: float | None, bounds: tuple[float, float], unit: str, remedy: str
) -> PreflightCheck:
    """Return the check of a number; None is one that is not measured."""
    if value is None:
        return PreflightCheck(name, "not measured", "", remedy, None)
    low, high = bounds
    wanted = f"at most {high:g}" if low <= 0.0 else f"{low:.4g} to {high:.4g}"
    wanted = wanted if high < math.inf else f"at least {low:g}"
    return PreflightCheck(name, f"{value:.4g} {unit}", wanted, remedy, low <= value <= high)
