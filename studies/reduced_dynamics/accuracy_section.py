"""Beyond the paper: how well each level is met along the walk, by both methods and solvers.

`Judge`: what an answer is worth at a state, by the full equations of motion.
"""

import numpy as np
from jaxtyping import Float64

from benchmarks.walk_recording import Answer, WalkLead, WalkRecording
from poise.dynamics import Dynamics, RobotState
from poise.robots import Robot
from poise.stack import Task
from studies.finding import Cell, Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.reduced_dynamics.timing_section import METHODS, SOLVERS
from studies.reduced_dynamics.walk_run import STACK, WalkRun, walk_run

QUANTITIES = (
    ("1", "base force", "N"),
    ("1", "base moment", "N m"),
    ("1", "joint torque", "N m"),
    ("2", "contacts", "m/s², rad/s²"),
    ("3", "COM", "m/s²"),
    ("3", "pelvis", "rad/s²"),
    ("4", "hands and foot", "m/s², rad/s²"),
)
"""Level, name and unit of what `Judge` measures."""


class Judge:
    """Measures answers along a walk, in physical units and apart from any solver.

    Args:
        recording: the walk.
        kind: the stack that was asked for.

    Attributes:
        lead: its targets.
        dynamics: of the state at hand.
    """

    def __init__(self, recording: WalkRecording, kind: str) -> None:
        self.lead: WalkLead = recording.lead(kind)
        self.dynamics = Dynamics(recording.robot)
        self._robot: Robot = recording.robot
        self._ends = {*recording.robot.soles, *recording.robot.hands}

    def place(self, state: RobotState) -> None:
        """Goes on to the next state."""
        self.lead.pass_by(state)
        self.dynamics.update(state)

    def evaluate(self) -> None:
        """Brings tasks and contacts up to date where answers are to be measured."""
        for contact in self.lead.stack.contacts:
            contact.evaluate(self.dynamics)
        for _, task in self.lead.stack.tasks():
            if self._is_held(task):
                # As controllers do: a foot that is lifted holds its place as it is then.
                task.reset()
            else:
                task.evaluate(self.dynamics)

    def measure(self, answer: Answer) -> Float64[np.ndarray, " quantities"]:
        """Largest absolute residual of each of `QUANTITIES`."""
        dv, stack = answer.acceleration, self.lead.stack
        force = self.dynamics.M @ dv + self.dynamics.h
        still, first = [0.0], 0
        for contact in stack.contacts:
            place = slice(first, first + contact.dim)
            first = place.stop
            if contact.active:
                force -= contact.jacobian.T @ answer.wrench[place]
                moved = contact.jacobian @ dv + contact.drift - contact.reference
                still.append(float(np.abs(moved).max()))
        base = self._robot.base_dofs
        force[base:] -= answer.torque
        found = {
            name: self._missing(stack.task(name), dv) for name in ("com", "pelvis", *self._ends)
        }
        parts = (force[:3], force[3:base], force[base:])
        return np.array(
            [
                *(float(np.abs(part).max()) for part in parts),
                max(still),
                found["com"],
                found["pelvis"],
                max(found[name] for name in self._ends),
            ]
        )

    def _missing(self, task: Task, dv: Float64[np.ndarray, " nv"]) -> float:
        if self._is_held(task):
            return 0.0
        return float(np.abs(task.jacobian @ dv + task.drift - task.reference).max())

    def _is_held(self, task: Task) -> bool:
        """Whether a contact stands in for the task, which has its frame's name then."""
        return any(c.active and c.frame == task.name for c in self.lead.stack.contacts)


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
                header=" | ".join(("level", "what", "unit", *header)),
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
            answer = run.subjects[key].answer(index)
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
        ok=bool(max(ratios) <= _SIMILAR),
        note=f"“similar magnitudes”: at most {_SIMILAR:g}. Worst: {QUANTITIES[k][1]}; largest "
        f"residual of the proposed method {own.max():.1e} {most[2]} ({most[1]}); zero where all "
        f"are below {_NOTHING:g}.",
    )
