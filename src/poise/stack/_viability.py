"""`ViableAcceleration`: after which a joint can still stop before its position limits."""

from math import sqrt

import numpy as np
from jaxtyping import Float64

from poise._compiled import MemoryBlock, compiled, part, view

_STOP_FRACTION = 0.5
"""Fraction of the horizon in which a joint about to pass its limit stops.

It bounds the braking gain near the limit, where v^2 / 2s would turn measurement noise into full
braking: an ankle that stands at its limit is then asked for what its sole on the ground cannot do,
and all tasks below give way for that tick. The price is that a joint may pass its limit by
`a_max (fraction dt)^2 / 2`, 10 mrad with the defaults, where it came in need of full braking, and
by a fortieth of that where it came as planned. The position margin is there for it."""

_RETURN = 10.0
"""In how many horizons a joint beside a contact comes back from beyond its limit."""

_TINY = 1e-12
"""Keeps a joint at rest on its limit from dividing by zero [rad]."""


A_MAX, DT, MARGIN, SETTINGS = range(4)
"""Places in `Viability.settings`, and how many they are."""


class Viability(MemoryBlock):
    """Inputs of the bounds of joint accelerations."""

    q_min: Float64[np.ndarray, " nj"]  # position limits [rad]
    q_max: Float64[np.ndarray, " nj"]
    v_max: Float64[np.ndarray, " nj"]  # velocity limits [rad/s]
    braking: Float64[np.ndarray, " nj"]  # decelerations that stopping is planned with [rad/s^2]
    gentle: Float64[np.ndarray, " nj"]  # the same beside contacts, and the most asked for there
    # Acceleration limit [rad/s^2], horizon [s], room between position limits and stops [rad]
    settings: Float64[np.ndarray, " settings"]


class ViableAcceleration:
    """Accelerations after which a joint can still stop before its position limits.

    With s = q_max - q the largest one is the larger root of

        dt^2 a^2 + dt (2 v + b dt) a + v^2 - 2 b (s - v dt) = 0,

        a = sqrt(2 b (s - v dt / 2) / dt^2 + b^2 / 4) - (v / dt + b / 2),

    as long as the joint may still move towards the limit at dt, that is for s >= v dt / 2. Nearer
    to it the joint must be at rest sooner, which takes -v^2 / 2s; the root would let it swing past
    the limit and return to it at dt. The smallest one is its mirror image. Where the two cross,
    both become the one that brakes.

    Attributes:
        viability: all of them.
    """

    def __init__(
        self,
        q_min: Float64[np.ndarray, " nj"],
        q_max: Float64[np.ndarray, " nj"],
        v_max: Float64[np.ndarray, " nj"],
        *,
        a_max: float,
        dt: float,
        braking: Float64[np.ndarray, " nj"],
        margin: float = 0.0,
        gentle: Float64[np.ndarray, " nj"] | None = None,
    ) -> None:
        gentle = braking if gentle is None else gentle
        self.viability = Viability(
            q_min=q_min,
            q_max=q_max,
            v_max=v_max,
            braking=braking,
            gentle=gentle,
            settings=np.array([a_max, dt, margin], dtype=np.float64),
        )

    def bounds(
        self,
        q: Float64[np.ndarray, " nj"],
        v: Float64[np.ndarray, " nj"],
        lower: Float64[np.ndarray, " nj"],
        upper: Float64[np.ndarray, " nj"],
    ) -> None:
        """Write bounds in [-a_max, a_max], which never cross."""
        _bounds(self.viability.address, q, v, lower, upper)


@compiled
def _bounds(
    address: int,
    q: Float64[np.ndarray, " nj"],
    v: Float64[np.ndarray, " nj"],
    lower: Float64[np.ndarray, " nj"],
    upper: Float64[np.ndarray, " nj"],
) -> None:
    bound_joints(view(Viability, address), q, v, lower, upper)


@part
def bound_joints(
    viability: Viability,
    q: Float64[np.ndarray, " nj"],
    v: Float64[np.ndarray, " nj"],
    lower: Float64[np.ndarray, " nj"],
    upper: Float64[np.ndarray, " nj"],
) -> None:
    """The bounds of all joints."""
    for i in range(len(q)):
        bound_joint(i, q[i], v[i], viability.braking[i], viability, lower, upper)


@part
def bound_joint(
    i: int,
    q: float,
    v: float,
    braking: float,
    viability: Viability,
    lower: Float64[np.ndarray, " nj"],
    upper: Float64[np.ndarray, " nj"],
) -> None:
    """The bounds of one joint."""
    a_max, dt = viability.settings[A_MAX], viability.settings[DT]
    settings, v_max = (a_max, dt, braking), viability.v_max[i]
    upper[i] = largest_acceleration(viability.q_max[i] - q, v, v_max, settings)
    lower[i] = -largest_acceleration(q - viability.q_min[i], -v, v_max, settings)
    if lower[i] > upper[i]:
        lower[i] = upper[i] = upper[i] if v > 0.0 else lower[i]


@part
def braking_asked(s: float, v: float, b: float, viability: Viability) -> float:
    """The most that a joint beside a contact is asked to brake by, or to come back from a limit.

    What such a joint brakes, the body does. It stops within what is left to the limit, or within
    the margin if that is less,

        min(b, v^2 / 2 max(s, m) + 2 max(-s, 0) / (10 dt)^2),

    and comes back slowly: at 0.05 rad/s, which noise shows, it is asked for 0.13 rad/s^2 and not
    for 5, and 2 mrad beyond the limit for 0.1 and not for 8, with the defaults.
    """
    approach = max(v, 0.0)
    margin, dt = viability.settings[MARGIN], viability.settings[DT]
    distance = max(s, margin, 0.5 * _STOP_FRACTION * dt * approach, _TINY)
    back = _RETURN * dt
    return min(b, 0.5 * approach * approach / distance + 2.0 / (back * back) * max(-s, 0.0))


@compiled
def largest_acceleration(
    s: float, v: float, v_max: float, settings: tuple[float, float, float]
) -> float:
    """The largest acceleration of a joint at a distance s from a limit, towards which it moves."""
    a_max, dt, b = settings
    if s < 0.5 * v * dt:
        a = _stop_at_once(s, v, dt)
    else:
        a = sqrt(2.0 * b * (s - 0.5 * v * dt) / (dt * dt) + 0.25 * b * b) - (v / dt + 0.5 * b)
    return max(-a_max, min(a, (v_max - v) / dt, a_max))


@part
def _stop_at_once(s: float, v: float, dt: float) -> float:
    """Acceleration of a joint within half a horizon of its limit, or beyond it."""
    approach = max(v, 0.0)
    distance = max(s, 0.5 * _STOP_FRACTION * dt * approach + _TINY)
    stop = -0.5 * approach * approach / distance
    # Beyond the limit: back to it at dt, counting the speed at which the joint returns already.
    return stop + (2.0 / (dt * dt)) * (min(s, 0.0) + dt * (approach - v))
