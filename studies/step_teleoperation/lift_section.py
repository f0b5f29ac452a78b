"""Scenario 2: from the lifted device to the lifted foot, by COM shifter and by preview control."""

from collections import deque

import numpy as np
from jaxtyping import Float64

from poise.apps.teleoperation import SCRIPTS, TeleopRun
from poise.locomotion import Mode, PreviewControl
from poise.robots import load_robot
from studies.finding import Finding, Section, Table, draw
from studies.plan import Progress, Steps, StudyOptions
from studies.step_teleoperation.literal import AS_MEASURED, LiteralTeleoperator
from studies.step_teleoperation.pictures import films, paint_sideways, snapshots
from studies.step_teleoperation.runs import (
    SOFT,
    STIFF,
    constants,
    fall_note,
    first,
    least_margin,
    left_undone,
    lift_off,
    run_script,
    script_parameters,
)


class PreviewDriver:
    """A `poise.locomotion.ComDriver`: the reference goes through a buffer of N ticks first.

    What the controller takes for the present is the reference of N ticks ago; the buffer holds
    what comes after it. So a reference that jumps acts N T later, and the ZMP begins to move
    earlier.

    Args:
        height: of the COM [m].
        dt: length of a tick [s].
        length: N.
    """

    def __init__(self, height: float, dt: float, length: int) -> None:
        self.control = PreviewControl(height, dt, length)
        self.omega = self.control.omega
        self._buffer: deque[Float64[np.ndarray, "2"]] = deque(maxlen=length)
        self._acceleration = np.zeros(2)

    def drive(
        self,
        reference: Float64[np.ndarray, "2"],
        position: Float64[np.ndarray, "2"],
        velocity: Float64[np.ndarray, "2"],
        dt: float,
    ) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"]]:
        """One tick, with the position fed back."""
        del dt
        missing = self.control.length - len(self._buffer)
        self._buffer.extend([reference.copy()] * max(missing, 1))
        # The newest reference is N ticks ahead: until then nothing is to be seen of it.
        state = np.stack((position, velocity, self._acceleration))
        jerk = self.control.jerk(state, np.stack(self._buffer))
        _, velocity, self._acceleration = self.control.advance(state, jerk)
        return velocity, self._acceleration

    def restart(
        self, commanded: Float64[np.ndarray, "2"], measured: Float64[np.ndarray, "2"]
    ) -> Float64[np.ndarray, "2"]:
        """The commanded velocity: the pattern goes on across modes."""
        del measured
        return commanded


_LENGTHS = (240, 120)
_LIFTED = 0.565
"""When the script lifts the right device, as in the paper [s]."""

_STEADY = (3.0, 4.4)
"""When the ZMP counts as steady [s]."""


def lift_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    robot = load_robot("biped20")
    script = SCRIPTS["lift_one_foot"](robot)
    dt = script_parameters(robot, script).dt
    steps = Steps(progress, 3 + len(_LENGTHS))
    steps.next()
    runs = {"COM shifter": run_script(robot, script)}
    literal: dict[str, TeleopRun] = {}
    for servos in (SOFT, STIFF):
        steps.next()
        with constants(AS_MEASURED):
            literal[f"the paper's rules and no others, servos {servos}"] = run_script(
                robot, script, servos, leader=LiteralTeleoperator
            )
    gains = {}
    for length in _LENGTHS:
        steps.next()
        driver = PreviewDriver(script.com_height, dt, length)
        name = f"preview control, N = {length}"
        gains[length] = driver.control.dc_gain
        runs[name] = run_script(robot, script, driver=driver, rotator=False)
    steps.finish()

    figure = draw(
        name="figure-10",
        title="Figure 10: from double to single support",
        caption=f"The right device is lifted at {_LIFTED} s; SL begins with the event e_TS.",
        height=3.8,
        paint=lambda canvas: paint_sideways(canvas, runs, (0.3, 2.6)),
    )
    shifter = runs["COM shifter"]
    pictures, notes = snapshots(
        options,
        "figure-9",
        "Figure 9: lifting the right foot",
        "Seen from the front.",
        [("", shifter, (0.5, 0.8, 1.1, 1.5, 3.0))],
        azimuth=180.0,
    )
    findings = [
        _event(shifter, "COM shifter", 0.5, (0.45, 0.55), "around 0.5 s; asked: 0.45 to 0.55 s"),
        _steady(shifter, "COM shifter", 0.0, (-2.0, 2.0), "no steady error; asked: below 2 mm"),
    ]
    for length in _LENGTHS:
        name, nominal = f"preview control, N = {length}", length * dt
        # The gain acts on the whole step, from the middle to the foot.
        predicted = -1e3 * (1.0 - gains[length]) * 0.5 * script.feet_apart
        findings += [
            _event(runs[name], name, nominal, (0.93 * nominal, 1.1 * nominal), "N T, within 10%"),
            _steady(
                runs[name], name, None, (predicted - 2.0, predicted + 2.0),
                f"its DC gain {gains[length]:.3f} predicts {predicted:.1f} mm; within 2 mm",
            ),
        ]  # fmt: skip
    findings += [
        Finding(name=f"{name}: time on one foot", paper=script.duration - _LIFTED - 0.5,
                ours=dt * int(run.log.when(Mode.SL).sum()), unit="s",
                ok=not (undone := left_undone(robot, run, script)),
                note=", ".join(undone) or "the paper's robot lifts its foot in around 0.5 s")
        for name, run in literal.items()
    ]  # fmt: skip
    rows = tuple(
        (name, fall_note(run), _since(first(run.log, Mode.SL)),
         _since(lift_off(run.log, 1, _LIFTED)), _error(run), least_margin(run),
         float(run.log.tilt.max()))
        for name, run in (runs | literal).items()
    )  # fmt: skip
    return Section(
        prose=(
            "Feet 0.42 m apart and COM 0.765 m high, as in the paper, so that `r_lift` is its "
            "0.12 m. Preview control drives the COM in place of the shifter, with the body "
            "rotator off: its steady error of the ZMP would wind the torso up. The COM shifter "
            "here is Poise's, with its departures. By the paper's rules alone what becomes of the "
            "robot depends on its servos: on Poise's it falls, on stiff ones it stands on both "
            "feet, as (14e) holds for a moment at once, and the foot that still carries has "
            "landed. See the part rules.",
            *notes,
        ),
        findings=tuple(findings),
        figures=(*pictures, figure),
        films=films(options, [("scenario-2", "Scenario 2, by the COM shifter", shifter)]),
        tables=(
            Table(
                title="Lifting one foot",
                header="controller | robot | e_TS after the lift [s] | lift-off [s] | "
                       "steady ZMP error [mm] | ZMP to edge, least [mm] | torso, most [rad]",
                rows=rows,
                caption="Lift-off: the sole is 2 mm up. The ZMP passes the polygon's edge where "
                "the polygon shrinks to one foot.",
            ),
        ),
    )  # fmt: skip


def _since(time: float | None) -> float | None:
    # Ticks are 5 ms: what is left behind the sixth digit is rounding.
    return None if time is None else round(time - _LIFTED, 6)


def _error(run: TeleopRun) -> float | None:
    """Mean error of the ZMP sideways, positive outwards over the left foot [mm]."""
    log = run.log
    rows = (log.time > _STEADY[0]) & (log.time < _STEADY[1]) & log.when(Mode.SL)
    return 1e3 * float((log.zmp - log.zmp_reference)[rows, 1].mean()) if rows.any() else None


def _within(
    run: TeleopRun,
    name: str,
    bounds: tuple[float, float],
    note: str,
    *,
    paper: float | None,
    ours: float | None,
    unit: str,
) -> Finding:
    """A number that has to lie within bounds at the end of a run without a fall."""
    ok = ours is not None and not run.fell and bounds[0] <= ours <= bounds[1]
    return Finding(name=name, paper=paper, ours=ours, unit=unit, ok=ok, note=note)


def _event(
    run: TeleopRun, name: str, paper: float, bounds: tuple[float, float], note: str
) -> Finding:
    what, ours = f"e_TS after the lift event, {name}", _since(first(run.log, Mode.SL))
    return _within(run, what, bounds, note, paper=paper, ours=ours, unit="s")


def _steady(
    run: TeleopRun, name: str, paper: float | None, bounds: tuple[float, float], note: str
) -> Finding:
    what = f"steady error of the ZMP, {name}"
    return _within(run, what, bounds, note, paper=paper, ours=_error(run), unit="mm")
