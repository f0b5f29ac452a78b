"""Tables 1 and 2: the sizes of the problems that the code builds, beside the paper's."""

from dataclasses import dataclass

import numpy as np

from poise.control import ReducedController, WholeBodyController
from poise.dynamics import Partitions
from poise.hqp import HierarchicalProblem
from studies.finding import Cell, Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.reduced_dynamics.walk_run import STACK, STANCES, WalkRun, walk_run

_CENTROID_DIM = 6
"""Coordinates of a chain's centroid."""

_PROSE = (
    "The stack is Table 1 of the paper; end effectors are both hands, and in single support the "
    "foot in the air (k = 2 and 3; the paper has one less each). A row of the code is two-sided, "
    "so that a torque limit, two inequalities in the paper, is one row. Bounds on single "
    "variables, such as those of joint accelerations, are no rows of a matrix.",
    "LQP 1 has the paper's variables: base, constraint chain, six of the centroid, wrenches. Tasks "
    "of the unconstrained chain are eliminated from it in closed form; directions in which an arm "
    "hardly moves may join as unknowns of their own. LQP 2 is the paper's (29) and (30). The code "
    "builds it, but solves it only where a limit of the unconstrained chain would be exceeded: "
    "elsewhere the chain's motion follows in closed form.",
)


@dataclass(frozen=True)
class _Sizes:
    contacts: int
    effectors: int
    n: int
    n_cc: int
    n_uc: int
    most: int
    whole: HierarchicalProblem
    first: HierarchicalProblem
    second: HierarchicalProblem | None


def sizes_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    run = walk_run(options, progress)
    tables: list[Table] = []
    findings: list[Finding] = []
    for stance in STANCES:
        sizes = _sizes(run, stance)
        tables += _tables(stance, sizes)
        findings += _findings(stance, sizes)
    return Section(prose=_PROSE, findings=tuple(findings), tables=tuple(tables))


def _sizes(run: WalkRun, stance: str) -> _Sizes:
    """Of the first tick in a stance with as many variables as most of them have."""
    robot = run.recording.robot
    ticks = run.answered("direct", stance)
    ticks = ticks[run.subjects["reduced", "direct"].programs[ticks] == 1]
    variables = run.subjects["reduced", "direct"].variables[ticks]
    tick = int(ticks[variables == np.median(variables)][0])
    leads = [run.recording.lead(STACK) for _ in range(2)]
    full = WholeBodyController(robot, leads[0].stack)
    reduced = ReducedController(robot, leads[1].stack)
    for state in run.recording.states[:tick]:
        for lead in leads:
            lead.pass_by(state)
    state = run.recording.states[tick]
    for lead, controller in zip(leads, (full, reduced), strict=True):
        lead.lead(state)
        controller.step(state)
    contacts = [c for c in full.stack.contacts if c.active]
    part = Partitions(robot).of([c.frame for c in contacts])
    program = reduced.strategy.current
    return _Sizes(
        contacts=len(contacts),
        effectors=len(robot.hands) + (stance == "single"),
        n=robot.nj,
        n_cc=part.na - robot.base_dofs,
        n_uc=part.nu,
        most=int(variables.max()),
        whole=full.strategy.current.full.problem,
        first=program.first.problem,
        second=None if program.second is None else program.second.problem,
    )


def _findings(stance: str, s: _Sizes) -> list[Finding]:
    n_r, wrench = s.n_cc + 6, 6 * s.contacts
    second = 0 if s.second is None else s.second.n
    return [
        Finding(
            name=f"{stance} support: {what}",
            paper=paper,
            ours=ours,
            ok=ours == paper,
            note=note,
        )
        for what, paper, ours, note in (
            ("variables of the full problem", s.n + 6 + wrench, s.whole.n, "(n + 6) + 6 c"),
            (
                "variables of LQP 1 but for weak directions",
                n_r + 6 + wrench,
                s.first.n - _weak(s.first),
                f"(n_r + 6) + 6 c with n_r = n_cc + 6, n_cc = {s.n_cc}. Directions in which an arm "
                f"hardly moves make it {s.first.n} at the median along the walk, {s.most} at most.",
            ),
            ("variables of LQP 2", s.n_uc, second, "n_uc"),
        )
    ]


def _weak(problem: HierarchicalProblem) -> int:
    """Unknowns of the unconstrained chain beside its one centroid."""
    name = "acceleration of the unconstrained chain"
    return sum(count for label, count in problem.labels if label == name) - _CENTROID_DIM


def _tables(stance: str, s: _Sizes) -> list[Table]:
    n_r = s.n_cc + 6
    shared = {
        "base dynamics": "6 eq",
        "contacts": f"6 c = {6 * s.contacts} eq",
        "cones": f"10 c = {10 * s.contacts} ineq",
        "com": "3 eq",
        "pelvis": "3 eq",
        "effectors": f"6 k = {6 * s.effectors} eq",
    }
    second = {"centroid": "6 eq", "effectors": shared["effectors"]}
    tables = (
        (
            "Table 1, {} support: the full problem",
            s.whole,
            shared | _limits("n", s.n),
            f"; c = {s.contacts}, k = {s.effectors}. Rows of a foot that stands are there, "
            "without bounds, and not listed.",
        ),
        (
            "Table 2, {} support: LQP 1",
            s.first,
            shared | _limits("n_r", n_r) | {"effectors": "in LQP 2"},
            f"; n_cc = {s.n_cc}. A centroid has no torque limit, so the code has n_cc rows of "
            "them. With effectors: what their tasks leave over for LQP 1.",
        ),
        (
            "Table 2, {} support: LQP 2",
            s.second,
            second | _limits("n_uc", s.n_uc),
            "; solved only where a limit would be exceeded.",
        ),
    )
    return [
        Table(
            title=title.format(stance),
            header="level | rows | in the code, two-sided | in the paper",
            rows=_rows(problem, paper),
            caption=f"{problem.n} variables, {problem.m} rows{words}",
        )
        for title, problem, paper, words in tables
        if problem is not None
    ]


def _limits(letter: str, count: int) -> dict[str, str]:
    words = f"2 {letter} = {2 * count} ineq"
    return {"torque limits": words, "joint limits": words}


def _rows(problem: HierarchicalProblem, paper: dict[str, str]) -> tuple[tuple[Cell, ...], ...]:
    """Rows by level and kind, told by the names that the problem gives its rows."""
    names = [name for name, count in problem.labels for _ in range(count)]
    counts: dict[tuple[int, str], int] = {}
    for level, view in enumerate(problem.levels, 1):
        rows = names[problem.n + view.slice.start : problem.n + view.slice.stop]
        for name, low, high in zip(rows, view.lower, view.upper, strict=True):
            # Rows without bounds belong to tasks that a contact stands in for.
            if np.isfinite(low) or np.isfinite(high):
                key = level, _kind(name)
                counts[key] = counts.get(key, 0) + 1
    joints = sum(_kind(name) == "joint limits" for name in names[: problem.n])
    if joints:
        counts[2, "joint limits"] = joints
    return tuple(
        (level, kind, count, paper.get(kind, ""))
        for (level, kind), count in sorted(counts.items(), key=lambda item: item[0][0])
    )


_KINDS = (
    ("base dynamics", "base dynamics"),
    ("torque limit", "torque limits"),
    ("motion of contact", "contacts"),
    ("wrench cone", "cones"),
    ("joint limit", "joint limits"),
    ("task com", "com"),
    ("task pelvis", "pelvis"),
    ("task", "effectors"),
    ("unconstrained chain", "effectors"),
    ("acceleration of a centroid", "centroid"),
)


def _kind(label: str) -> str:
    return next((kind for begin, kind in _KINDS if label.startswith(begin)), label)
