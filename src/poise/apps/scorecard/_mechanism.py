"""The first events of a run that was not survived, from its signals."""

import numpy as np
import pinocchio as pin

from poise.apps.scenarios import Run, explain, missed_ticks, symptoms_of

LEAN_MAX = 0.5
"""A robot whose base leans further from its home attitude does not stand upright [rad]."""


def survived(run: Run) -> bool:
    """True for a robot that came through.

    No fall, no divergence, no tick without an answer; it stands upright at the end, its walk has
    ended, and what its scene checks holds, which for standing is being at rest.
    """
    return not (run.fell or run.ended_early or missed_ticks(run.signals) or _end(run))


def mechanism(run: Run) -> str:
    """The first events of a run that was not survived, and its end."""
    begun = explain(symptoms_of(run.signals, run.robot, run.scenario), run.signals.time)
    end = run.ended_early or _end(run) or "it went on to the end"
    return "; then ".join(filter(None, (begun, end)))


def lean(run: Run) -> float:
    """Angle of the base's vertical at the end of a run from that at home [rad]."""
    home, now = (
        pin.Quaternion(q[3:7]).toRotationMatrix()[:, 2]
        for q in (run.robot.q_home, run.signals.q[-1])
    )
    return float(np.arccos(np.clip(home @ now, -1.0, 1.0)))


def _end(run: Run) -> str:
    """The state at the end that is no survival, or ""."""
    if lean(run) > LEAN_MAX:
        return f"it leaned by {lean(run):.2f} rad at the end"
    if run.scenario.walk is not None and run.signals.modes[-1][1] != "walk standing":
        return f"the walk was not finished ({run.signals.modes[-1][1]})"
    own = run.checks[len(run.checks) - len(run.scenario.checks) :]
    return "; ".join(f"at the end {c.name} was {c.value:.2g} {c.unit}" for c in own if not c.ok)
