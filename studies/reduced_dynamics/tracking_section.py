"""Figure 4: tracking errors of COM and hand, in the loop with MuJoCo."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from benchmarks.drawing import PALETTE
from benchmarks.methods import Method, parse_method
from benchmarks.recording import Alter, Recording, record_run
from benchmarks.walk_recording import record_walk
from poise.dynamics import Dynamics
from poise.errors import PoiseError
from poise.robots import Robot, load_robot
from studies.finding import Cell, Figure, Finding, Section, Table, draw
from studies.plan import Progress, Steps, StudyOptions
from studies.reduced_dynamics.base_section import PaperTorques
from studies.reduced_dynamics.walk_run import ROBOT

_SIMILAR = 2.0
"""Of similar magnitude: RMS errors within a factor of this."""

_TICKS, _QUICK_TICKS = 2000, 500
_STEPS, _QUICK_STEPS = 4, 1

_PROSE = (
    "The robot runs in MuJoCo under each controller in turn, and the distances of COM and left "
    "hand from where they should be are compared. In double support COM and hands go round, as in "
    "the paper's figure, under the robot's default stack. Then it walks with the hands going round "
    "beside it; below Table 1's levels there is a posture, without which nothing would hold the "
    "joints that no task needs. Beside the paper's two methods stands the proposed one with "
    "torques by its equation (17).",
    "“Similar magnitudes of control error” is taken as: RMS errors within a factor of two.",
)


@dataclass(frozen=True, kw_only=True)
class _Variant:
    """One curve of the figure."""

    name: str
    method: Method
    paper_form: bool = False


_CONVENTIONAL = _Variant(name="conventional", method=parse_method("whole_body", "direct"))
_PROPOSED = _Variant(name="proposed", method=parse_method("reduced", "direct"))
_VARIANTS = (
    _CONVENTIONAL,
    _PROPOSED,
    _Variant(name="proposed, (17)", method=_PROPOSED.method, paper_form=True),
)
_BY_OSQP = (
    _Variant(name="conventional, cascade/osqp", method=parse_method("whole_body", "cascade/osqp")),
    _Variant(name="proposed, cascade/osqp", method=parse_method("reduced", "cascade/osqp")),
)
"""As in the paper; only in double support, because they take a while."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Curve:
    """Errors of one run; empty where the robot fell."""

    variant: _Variant
    time: Float64[np.ndarray, " n"]
    com: Float64[np.ndarray, " n"]
    hand: Float64[np.ndarray, " n"]
    fell: str = ""

    def rms(self, what: str) -> float | None:
        """Root of the mean square of an error [mm]."""
        errors: Float64[np.ndarray, " n"] = getattr(self, what)
        return None if self.fell else 1e3 * float(np.sqrt(np.mean(errors**2)))


def tracking_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    robot = load_robot(ROBOT)
    standing = _VARIANTS if options.quick else (*_VARIANTS, *_BY_OSQP)
    steps = Steps(progress, len(standing) + len(_VARIANTS))
    ticks = _QUICK_TICKS if options.quick else _TICKS
    count = _QUICK_STEPS if options.quick else _STEPS
    double = [_run(_stand, robot, v, ticks, steps.next()) for v in standing]
    walk = [_run(_walk, robot, v, count, steps.next()) for v in _VARIANTS]
    steps.finish()
    cases = {"double support": double, "walk": walk}
    return Section(
        prose=_PROSE,
        findings=tuple(f for name, curves in cases.items() for f in _findings(name, curves)),
        figures=tuple(_figure(name, curves) for name, curves in cases.items()),
        tables=(_table(cases),),
    )


def _run(
    make: Callable[[Robot, _Variant, int, Alter | None, Callable[[float], None]], _Curve],
    robot: Robot,
    variant: _Variant,
    length: int,
    share: Callable[[float], None],
) -> _Curve:
    alter = PaperTorques(robot).alter if variant.paper_form else None
    try:
        return make(robot, variant, length, alter, share)
    except PoiseError as error:
        nothing = np.zeros(0)
        return _Curve(variant=variant, time=nothing, com=nothing, hand=nothing, fell=str(error))


def _stand(
    robot: Robot, variant: _Variant, ticks: int, alter: Alter | None, share: Callable[[float], None]
) -> _Curve:
    recording = record_run(
        robot,
        "double",
        ticks,
        lambda done, total: share(done / total),
        method=variant.method,
        alter=alter,
    )
    com, hand = _errors(recording)
    time = np.array([state.time for state in recording.states])
    return _Curve(variant=variant, time=time - time[0], com=com, hand=hand)


def _walk(
    robot: Robot, variant: _Variant, count: int, alter: Alter | None, share: Callable[[float], None]
) -> _Curve:
    walk = record_walk(
        robot,
        count,
        lambda done, total: share(done / total),
        method=variant.method,
        alter=alter,
    )
    time = np.array([state.time for state in walk.states])
    return _Curve(variant=variant, time=time, com=walk.com_error, hand=walk.hand_error)


def _errors(recording: Recording) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " n"]]:
    """Distances of COM and left hand from their targets [m]."""
    robot, dynamics = recording.robot, Dynamics(recording.robot)
    hand = next(iter(robot.hands))
    name = next(n for n in recording.paths if n.startswith(hand))
    com = np.zeros(len(recording.states))
    end = np.zeros(len(recording.states))
    for i, state in enumerate(recording.states):
        dynamics.update(state)
        com[i] = np.linalg.norm(recording.paths["com"].position[i] - dynamics.com)
        place = dynamics.frame(robot.frame_id(hand)).position
        end[i] = np.linalg.norm(recording.paths[name].position[i] - place)
    return com, end


def _findings(case: str, curves: list[_Curve]) -> list[Finding]:
    by_name = {curve.variant.name: curve for curve in curves}
    pairs = [(c.variant.name, "conventional") for c in curves[1:3]]
    pairs += [(c.variant.name, curves[3].variant.name) for c in curves[4:]]
    findings: list[Finding] = []
    for name, reference in pairs:
        for what, words in (("com", "COM"), ("hand", "left hand")):
            own, full = by_name[name].rms(what), by_name[reference].rms(what)
            ratio = None if own is None or full is None else own / full
            fell = by_name[name].fell or by_name[reference].fell
            findings.append(
                Finding(
                    name=f"Figure 4, {case}, {words}: RMS error, {name} to {reference}",
                    paper=1.0,
                    ours=ratio,
                    ok=ratio is not None and 1.0 / _SIMILAR <= ratio <= _SIMILAR,
                    note=fell
                    or f"“similar magnitudes of control error”: {own:.3f} to {full:.3f} mm",
                )
            )
    return findings


def _table(cases: dict[str, list[_Curve]]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for case, curves in cases.items():
        for curve in curves:
            most = [None if curve.fell else 1e3 * float(e.max()) for e in (curve.com, curve.hand)]
            rows.append(
                (case, curve.variant.name, curve.rms("com"), most[0], curve.rms("hand"), most[1],
                 curve.fell or "stood")
            )  # fmt: skip
    return Table(
        title="Tracking errors",
        header="run | method | COM, RMS [mm] | COM, most [mm] | hand, RMS [mm] | hand, most [mm] | "
               "robot",
        rows=tuple(rows),
        caption="The COM of the walk has no stiffness of its own: a feedback of the divergent "
        "component leads it.",
    )  # fmt: skip


def _figure(case: str, curves: list[_Curve]) -> Figure:
    def paint(canvas: Any) -> None:
        panels = canvas.subplots(1, 2)
        for panel, what, words in zip(panels, ("com", "hand"), ("COM", "left hand"), strict=True):
            for curve, colour, style in zip(
                curves, PALETTE, ("-", "--", ":", "-", "--"), strict=False
            ):
                errors: Float64[np.ndarray, " n"] = 1e3 * getattr(curve, what)
                panel.plot(curve.time, errors, style, color=colour, label=curve.variant.name)
            panel.set_title(words, fontweight="normal")
            panel.set_xlabel("time [s]")
            panel.set_ylabel("error [mm]")
        panels[0].legend(loc="upper left")

    return draw(
        name=f"figure-4-{case.replace(' ', '-')}",
        title=f"Figure 4: tracking errors, {case}",
        caption="Each curve is a run of its own. Conventional and proposed lie on each other.",
        height=3.8,
        paint=paint,
    )
