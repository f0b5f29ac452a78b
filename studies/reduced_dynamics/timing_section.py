"""Table 3: time of a tick in double and single support along a walk."""

from collections.abc import Generator
from time import perf_counter

import numpy as np
from jaxtyping import Float64, Int64

from benchmarks.result import TickTimes, median_ratio
from poise.dynamics import Dynamics, Partitions, ReducedDynamics
from studies.finding import Cell, Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.reduced_dynamics.walk_run import STANCES, WalkRun, walk_run

SOLVERS = ("cascade/osqp", "direct")
METHODS = {"whole_body": "conventional", "reduced": "proposed"}

_PAPER = {
    ("double", "whole_body"): (2176, 2473, None, None, None),
    ("double", "reduced"): (981, 1203, 34, 579, 273),
    ("single", "whole_body"): (1834, 2119, None, None, None),
    ("single", "reduced"): (613, 811, 36, 243, 270),
}
"""Table 3: mean, max, dynamics, LQP 1, LQP 2 [us]."""

_PAPER_RATIO = {"double": 981 / 2176, "single": 613 / 1834}

_DYNAMICS_TICKS = 200

_PROSE = (
    "A walk of `humanoid33` is recorded once, in MuJoCo under the full controller, with hands that "
    "go round; then four controllers take turns on its states, each with a walker of its own that "
    "sets the same targets and loads. The stack is Table 1 of the paper. `cascade/osqp` is the "
    "paper's way, one program a level by OSQP; `direct` is Poise's own. `cascade/osqp`, which is "
    "slow, is timed on a part of the ticks, in the same run.",
    "Times are of one tick from state to torque, in microseconds; ratios are medians over ticks of "
    "two times on the same state. On a shared machine means and maxima also tell when another "
    "process had the core: processor time beside them does not. In Poise “dynamics” is what every "
    "controller needs of the robot's dynamics; the reduction and the rows are in “assembly”. LQP 2 "
    "is what is left of the solve: the unconstrained chain in closed form, and the program (29) "
    "where one of its limits would be exceeded.",
)


def timing_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    run = walk_run(options, progress)
    reduction = {stance: _time_reduction(run, stance) for stance in STANCES}
    return Section(
        prose=_PROSE,
        findings=tuple(_findings(run, reduction)),
        tables=tuple(_table(run, solver, reduction) for solver in SOLVERS),
    )


def _times(run: WalkRun, stance: str, controller: str, solver: str) -> TickTimes:
    return run.subjects[controller, solver].times(run.counted(solver, stance))


def _ratio(run: WalkRun, stance: str, solver: str) -> float:
    own, whole = (_times(run, stance, c, solver) for c in ("reduced", "whole_body"))
    return median_ratio(own, whole)


def _findings(run: WalkRun, reduction: dict[str, float]) -> Generator[Finding]:
    for stance in STANCES:
        yield from _of_stance(run, stance, reduction[stance])
    ratios = [_ratio(run, stance, "cascade/osqp") for stance in STANCES]
    yield Finding(
        name="Table 3: ratio in single support to ratio in double support, cascade/osqp",
        paper=_PAPER_RATIO["single"] / _PAPER_RATIO["double"],
        ours=ratios[1] / ratios[0],
        ok=ratios[1] < ratios[0],
        note="more is saved in single support, where the swing leg hangs freely, too",
    )
    seconds = run.subjects["reduced", "cascade/osqp"].lqp
    lqp_1 = [float(np.median(seconds[run.counted("cascade/osqp", s)])) for s in STANCES]
    yield Finding(
        name="Table 3: LQP 1 in single support to LQP 1 in double support, cascade/osqp",
        paper=243 / 579,
        ours=lqp_1[1] / lqp_1[0],
        ok=lqp_1[1] < lqp_1[0],
        note="fewer joints and half the contacts are left in LQP 1",
    )


def _of_stance(run: WalkRun, stance: str, reduction: float) -> Generator[Finding]:
    table, paper = f"Table 3, {stance} support:", _PAPER_RATIO[stance]
    ours, direct = (_ratio(run, stance, solver) for solver in SOLVERS)
    yield Finding(
        name=f"{table} proposed to conventional, cascade/osqp",
        paper=paper,
        ours=ours,
        ok=ours <= paper,
        note=f"a decrease by {100 * (1 - paper):.1f}%",
    )
    yield Finding(
        name=f"{table} proposed to conventional, direct",
        paper=paper,
        ours=direct,
        ok=direct < 1.0,
        note="the proposed one is quicker with any solver; the paper's number is that of OSQP, "
        "whose programs take a far larger share of the tick",
    )
    ticks = run.counted("cascade/osqp", stance)
    both = median_ratio(
        run.subjects["whole_body", "cascade/osqp"].times(ticks),
        run.subjects["reduced", "direct"].times(ticks),
    )
    yield Finding(
        name=f"{table} conventional by cascade/osqp to proposed by direct",
        paper=1.0 / paper,
        ours=both,
        ok=both >= 1.0 / paper,
        note="what reduction and solver save together; the paper's number is the reduction's alone",
    )
    total = 1e6 * float(np.median(_times(run, stance, "reduced", "cascade/osqp").total))
    mean, _, dynamics, _, _ = _PAPER[stance, "reduced"]
    share = float((dynamics or 0) / mean)
    yield Finding(
        name=f"{table} share of the reduced dynamics in the proposed tick",
        paper=100 * share,
        ours=100 * reduction / total,
        unit="%",
        ok=reduction / total <= share,
        note=f"{reduction:.0f} µs of a tick by cascade/osqp; {dynamics} µs in the paper",
    )


def _time_reduction(run: WalkRun, stance: str) -> float:
    """Median time of the reduced dynamics by themselves [us]."""
    robot, ticks = run.recording.robot, run.recording.ticks(stance)
    ticks = ticks[np.linspace(0, len(ticks) - 1, min(_DYNAMICS_TICKS, len(ticks))).astype(int)]
    soles = list(robot.soles)[:2]
    partitions, dynamics = Partitions(robot), Dynamics(robot)
    reduced = ReducedDynamics(robot, partitions.of(soles if stance == "double" else soles[:1]))
    seconds: list[float] = []
    for tick in ticks:
        dynamics.update(run.recording.states[tick])
        begin = perf_counter()
        reduced.update(dynamics)
        seconds.append(perf_counter() - begin)
    return 1e6 * float(np.median(seconds))


def _table(run: WalkRun, solver: str, reduction: dict[str, float]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for stance in STANCES:
        for controller, name in METHODS.items():
            rows.append(_row(run, stance, controller, solver, name, reduction[stance]))
            if solver == "cascade/osqp":
                mean, most, dynamics, first, second = _PAPER[stance, controller]
                blank = (None,) * 6
                rows.append((stance, f"{name}, paper", mean, most, *blank, dynamics, first, second))
    return Table(
        title=f"Table 3 by {solver}",
        header="support | method | mean [µs] | max [µs] | median [µs] | 99% [µs] | "
               "processor, 99% [µs] | dynamics [µs] | assembly [µs] | command [µs] | "
               "of it reduction [µs] | LQP 1 [µs] | LQP 2 [µs]",
        rows=tuple(rows),
        caption="From dynamics to LQP 2 medians. LQP 1 of the conventional method is its only "
        "problem.",
    )  # fmt: skip


def _row(
    run: WalkRun, stance: str, controller: str, solver: str, name: str, reduction: float
) -> tuple[Cell, ...]:
    ticks = run.counted(solver, stance)
    times = run.subjects[controller, solver].times(ticks)
    total = 1e6 * times.total
    dynamics, assembly, solve, command = (1e6 * np.median(times.phases, axis=0)).tolist()
    first = _median_us(run.subjects[controller, solver].lqp, ticks)
    numbers = (total.mean(), total.max(), np.median(total), np.percentile(total, 99),
               np.percentile(1e6 * times.cpu, 99), dynamics, assembly, command)  # fmt: skip
    own = controller == "reduced"
    return (
        stance,
        name,
        *(round(float(x), 1) for x in numbers),
        round(reduction, 1) if own else None,
        round(first, 1),
        round(solve - first, 1) if own else None,
    )


def _median_us(seconds: Float64[np.ndarray, " ticks"], ticks: Int64[np.ndarray, " n"]) -> float:
    return 1e6 * float(np.median(seconds[ticks]))
