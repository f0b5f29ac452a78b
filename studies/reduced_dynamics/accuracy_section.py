"""Beyond the paper: how well each level is met along the walk, by both methods and solvers."""

import numpy as np

from studies.finding import Finding
from studies.plan import Progress, StudyOptions
from studies.reduced_dynamics.answers import QUANTITIES, Answer, Judge
from studies.reduced_dynamics.timing_section import METHODS, SOLVERS
from studies.reduced_dynamics.walk_run import STACK, WalkRun, walk_run
from studies.section import Cell, Section, Table

_SIMILAR = 10.0
"""Of similar magnitude: within a factor of this."""

_NOTHING = 1e-6
"""Residuals below this are nothing, whatever their ratio [N, N m, m/s^2, rad/s^2]."""

_PROSE = (
    "Every answer along the walk is put into the full equations of motion, contacts and tasks, "
    "apart from any solver: M dv + h − J_cᵀ F − S τ, J dv + drift − reference. All of them can be "
    "met at once here but for limits, so that what is left is the solver's.",
    "The paper says that both methods control with errors of similar magnitude; taken here as: "
    "no residual of the proposed method is more than ten times the conventional one's, or below "
    "10⁻⁶ N, N m, m/s².",
)

Worst = dict[tuple[str, str], np.ndarray]
"""Largest residuals by (controller, solver)."""


def accuracy_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    run = walk_run(options, lambda done, total: progress(0.8 * done / total, 1.0))
    worst, counts = _worst(run, progress)
    rows: list[tuple[Cell, ...]] = []
    for i, (level, name, unit) in enumerate(QUANTITIES):
        cells = [worst[c, s][i] for s in SOLVERS for c in METHODS]
        rows.append((level, name, unit, *(float(x) for x in cells)))
    header = [f"{name}, {solver}" for solver in SOLVERS for name in METHODS.values()]
    return Section(
        prose=_PROSE,
        findings=tuple(_finding(worst, solver) for solver in SOLVERS),
        tables=(
            Table(
                title="Largest residual along the walk",
                header=("level", "what", "unit", *header),
                rows=tuple(rows),
                caption="; ".join(f"{s}: {counts[s]} ticks" for s in SOLVERS)
                + ". Contacts, tasks and base by their own units.",
            ),
        ),
    )


def _worst(run: WalkRun, progress: Progress) -> tuple[Worst, dict[str, int]]:
    judge = Judge(run.recording, STACK)
    worst = {key: np.zeros(len(QUANTITIES)) for key in run.subjects}
    ticks = {
        s: set(np.concatenate([run.answered(s, d) for d in ("double", "single")]).tolist())
        for s in SOLVERS
    }
    total = len(run.recording.states)
    for index, state in enumerate(run.recording.states):
        judge.place(state)
        due = [key for key in run.subjects if index in ticks[key[1]]]
        if due:
            judge.evaluate()
        for key in due:
            one = run.subjects[key]
            answer = Answer(
                acceleration=one.acceleration[index],
                torque=one.torque[index],
                wrench=one.wrench[index],
            )
            worst[key] = np.maximum(worst[key], judge.measure(answer))
        if index % 200 == 0:
            progress(0.8 + 0.2 * index / total, 1.0)
    progress(1.0, 1.0)
    return worst, {s: len(found) for s, found in ticks.items()}


def _finding(worst: Worst, solver: str) -> Finding:
    full, own = (worst[c, solver] for c in ("whole_body", "reduced"))
    ratios = [o / max(f, _NOTHING) if o > _NOTHING else 0.0 for f, o in zip(full, own, strict=True)]
    k = int(np.argmax(ratios))
    most = QUANTITIES[int(np.argmax(own))]
    return Finding(
        name=f"{solver}: largest residual, proposed to conventional",
        paper=1.0,
        ours=float(ratios[k]),
        unit="",
        ok=bool(max(ratios) <= _SIMILAR),
        note=f"“similar magnitudes”: at most {_SIMILAR:g}. Worst: {QUANTITIES[k][1]}; largest "
        f"residual of the proposed method {own.max():.1e} {most[2]} ({most[1]}); zero where all "
        f"are below {_NOTHING:g}.",
    )
