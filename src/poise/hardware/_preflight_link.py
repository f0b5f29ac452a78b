"""Checks of what is behind a link: names, numbers, rates, clocks, temperatures, battery."""

import math
from collections.abc import Sequence

import numpy as np

from poise._show import few
from poise.hardware._last_check import LastCheck
from poise.hardware._link import Link, LinkStatus, MotorState
from poise.hardware._preflight_checks import PreflightCheck, Samples, limit_of, of_joints
from poise.hardware._watchdog import Trouble
from poise.robots import Robot

_OPTIONAL = "tau", "temperature"
"""Measurements that a link may lack: NaN."""


def wiring_checks(robot: Robot, link: Link, check: LastCheck) -> list[PreflightCheck]:
    """Check names of joints, the last check's limits and the link's status."""
    known = {"link": link.info.joints, "last check": check.joints}
    others = [whose for whose, names in known.items() if tuple(names) != robot.joint_names]
    lost = link.status is LinkStatus.LOST
    checks = [
        PreflightCheck(
            name="link",
            seen=f"{link.status.value} {link.reason}".strip(),
            wanted="not lost",
            remedy="look at cable, network interface and the robot's power",
            ok=not lost,
        ),
        PreflightCheck(
            name="joints",
            seen=f"other joints or another order: {few(others)}" if others else "the robot's",
            wanted=f"the {robot.nj} joints of {robot.name}, in their order",
            remedy="load the model of this robot, or convert with poise.robots.JointOrder",
            ok=not others,
        ),
    ]
    if not others:
        wide = (check.lower < robot.q_min) | (check.upper > robot.q_max)
        wide |= (check.v_max > robot.v_max) | (check.tau_max > robot.tau_max)
        checks.append(
            of_joints(
                robot,
                wide,
                name="last check",
                good="within the robot's",
                bad="wider than the robot's",
                wanted="limits within the robot's",
                remedy="make the LastCheck from this robot, with margin >= 0 and scale <= 1",
            )
        )
    return checks


def numbers_check(robot: Robot, states: Sequence[MotorState]) -> PreflightCheck:
    """Check that there are states, whose numbers have the right shapes and are finite."""
    joints = dict.fromkeys(("q", "dq", "tau", "temperature"), robot.nj)
    sizes = joints | {"quaternion": 4, "gyro": 3, "acceleration": 3}
    seen = "" if len(states) > 1 else f"{len(states)} states"
    for name, size in sizes.items():
        values = [np.asarray(getattr(state, name), float) for state in states]
        if any(value.shape != (size,) for value in values):
            seen = seen or f"{name} without {size} numbers"
        elif name not in _OPTIONAL and not np.isfinite(values).all():
            bad = np.flatnonzero(~np.isfinite(values).all(axis=0))
            of = f" of {few([robot.joint_names[k] for k in bad])}" if size == robot.nj else ""
            seen = seen or f"{name}{of} not finite"
    return PreflightCheck(
        name="numbers",
        seen=seen or f"{len(states)} states, all finite",
        wanted="finite numbers of all joints and of the inertial unit",
        remedy="look at the motors' power and at the drivers' log",
        ok=not seen,
    )


def timing_checks(
    link: Link, samples: Samples, elapsed: float, seconds: float
) -> list[PreflightCheck]:
    """Check rate, gaps, arrivals and clocks against the rules of the watchdog."""
    rate, late, gap = link.info.rate, limit_of(Trouble.LATE_STATE), limit_of(Trouble.GAP)
    stamps, arrivals = np.diff(samples.time), np.diff(samples.arrived)
    span = samples.arrived[-1] - samples.arrived[0]
    measured = len(arrivals) / span if span > 0.0 else math.inf
    # Two lost states, three periods, must not be a gap, nor four periods none.
    slow, fast = 3.0 / gap * rate, 4.0 / gap * rate
    steady = float(arrivals.std() * rate)
    longest, widest = float(arrivals.max() * rate), float(np.abs(stamps).max() * rate)
    pace = (samples.time[-1] - samples.time[0]) / span if span > 0.0 else math.inf
    # The first and the last state may each arrive as late as the watchdog permits.
    drift = late / rate / max(span, 1.0 / rate)
    backward, whole = int(np.count_nonzero(stamps <= 0.0)), elapsed >= seconds
    clocks = f"{pace:.4f} s of stamps a second, {backward} repeated or back"
    trip = getattr(link, "round_trip", None)
    return [
        PreflightCheck(
            name="rate",
            seen=f"{measured:.1f} states a second",
            wanted=f"{slow:.0f} to {fast:.0f}",
            remedy="correct the rate of the link or of the robot's publisher",
            ok=bool(slow <= measured <= fast),
        ),
        PreflightCheck(
            name="gaps",
            seen=f"{widest:.1f} periods between stamps at most",
            wanted=f"at most {gap:g}",
            remedy="use a cable instead of a radio link; close other subscribers",
            ok=widest <= gap,
        ),
        PreflightCheck(
            name="arrivals",
            seen=f"{longest:.1f} periods apart at most, deviation {steady:.2f}",
            wanted=f"at most {late:g}",
            remedy="give the link's process a real-time priority; unload this computer",
            ok=longest <= late,
        ),
        PreflightCheck(
            name="clock",
            seen=clocks if whole else f"the link's clock stands, at {elapsed:.3f} s of {seconds:g}",
            wanted=f"1 within {drift:.4f}, none back",
            remedy="stamp states on the robot by one monotonic clock, in seconds",
            ok=bool(whole and not backward and abs(pace - 1.0) <= drift),
        ),
        PreflightCheck(
            name="round trip",
            seen="not measured" if trip is None else f"{1e3 * trip:.1f} ms",
            wanted=f"at most {1e3 * late / rate:g} ms",
            remedy="use a cable instead of a radio link",
            ok=None if trip is None else bool(trip <= late / rate),
        ),
    ]


def supply_checks(robot: Robot, link: Link, samples: Samples) -> list[PreflightCheck]:
    """Check temperatures and battery."""
    hot = np.fmax.reduce(samples.temperature, axis=0)
    known, limit = bool(np.isfinite(hot).any()), limit_of(Trouble.HEAT)
    battery: tuple[float, float] | None = getattr(link, "battery", None)
    warmest = (
        f"{np.nanmax(hot):.1f} deg C at {robot.joint_names[np.nanargmax(hot)]}" if known else ""
    )
    volts, least = (math.nan, math.nan) if battery is None else battery
    return [
        PreflightCheck(
            name="temperature",
            seen=warmest or "not measured",
            wanted=f"at most {limit:g} deg C",
            remedy="let the motors cool down",
            ok=bool(np.nanmax(hot) <= limit) if known else None,
        ),
        PreflightCheck(
            name="battery",
            seen="not measured" if battery is None else f"{volts:.1f} V",
            wanted="" if battery is None else f"at least {least:g} V",
            remedy="charge the battery",
            ok=None if battery is None else bool(volts >= least),
        ),
    ]
