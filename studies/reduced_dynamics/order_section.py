"""Beyond the paper: what the order of priorities decides, and whether both methods agree on it.

`Sequential`: the paper's order, energy before the tasks of the unconstrained chain.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from benchmarks.methods import parse_method
from benchmarks.walk_recording import Answer, WalkRecording, WalkSubject
from poise.control import WholeBodyController
from poise.dynamics import Dynamics, Partitions, ReducedDynamics, RobotState
from poise.errors import PoiseError
from poise.hqp import HierarchicalProblem, Level, make_solver
from poise.robots import Robot
from poise.stack import Stack, Task
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.reduced_dynamics.accuracy_section import QUANTITIES, Judge
from studies.reduced_dynamics.walk_run import STANCES, walk_run


@dataclass(frozen=True, kw_only=True, eq=False)
class SequentialAnswer(Answer):
    """What the two problems of the paper decide one after the other, by exact rows.

    Attributes:
        missing: largest residual of a task of the unconstrained chain [m/s^2, rad/s^2].
    """

    missing: float


def _balance_alone(stack: Stack) -> Stack:
    """The first level of a stack, under the same limits."""
    return Stack(
        stack.contacts,
        stack.levels[:1],
        torque_limit=stack.torque_limit,
        balance_limit=stack.balance_limit,
        softening=stack.softening,
    )


class Sequential:
    """LQP 1, blind for the tasks of the unconstrained chain, then LQP 2 under its centroid.

    LQP 1 as (28) has it: contacts, balance and the acceleration energy with that of the centroids.
    What it decides equals what the whole problem without the other tasks decides, so that this is
    what is solved here. Then LQP 2, (29): the centroid (30), the tasks, the energy. Limits of the
    unconstrained chain are left out of LQP 2.

    Args:
        robot: the robot.
        stack: contacts and levels of a walk; the first level is LQP 1's, the others LQP 2's. Tasks
            and contacts are shared with it, and led by whoever leads it.
    """

    def __init__(self, robot: Robot, stack: Stack) -> None:
        self._robot, self._stack = robot, stack
        self._first = WholeBodyController(robot, _balance_alone(stack))
        self._tasks = [task for level in stack.levels[1:] for task in level]
        self._partitions, self._dynamics = Partitions(robot), Dynamics(robot)
        self._reduced: dict[tuple[str, ...], ReducedDynamics] = {}
        self._solver = make_solver("direct", None)

    def step(self, state: RobotState) -> SequentialAnswer:
        """The answer for a state; targets and loads are set beforehand.

        Raises:
            PoiseError: one of the two cannot be solved.
        """
        command = self._first.step(state)
        if not command.status.ok or command.acceleration is None or command.torque is None:
            raise PoiseError("LQP 1 has no answer", got=command.status.value)
        self._dynamics.update(state)
        active = [c for c in self._stack.contacts if c.active]
        reduced = self._reduced_of(tuple(c.frame for c in active))
        reduced.update(self._dynamics)
        part, dv = reduced.partition, command.acceleration
        dv_a, z = np.split(reduced.reduce(dv), [part.na])
        held = {c.frame for c in active}
        tasks = [t for t in self._tasks if getattr(t, "frame", "") not in held]
        dv_u, missing = self._second(reduced, tasks, dv_a, z)
        torque = command.torque.copy()
        base = self._robot.base_dofs
        torque[part.u.index - base] = reduced.torques_u(dv_a, dv_u)
        wrenches = [command.wrenches.get(c.name, np.zeros(c.dim)) for c in self._stack.contacts]
        return SequentialAnswer(
            acceleration=part.merge(dv_a, dv_u),
            torque=torque,
            wrench=np.concatenate(wrenches),
            missing=missing,
        )

    def _reduced_of(self, frames: tuple[str, ...]) -> ReducedDynamics:
        if frames not in self._reduced:
            self._reduced[frames] = ReducedDynamics(self._robot, self._partitions.of(frames))
        return self._reduced[frames]

    def _second(
        self,
        reduced: ReducedDynamics,
        tasks: list[Task],
        dv_a: Float64[np.ndarray, " na"],
        z: Float64[np.ndarray, " nz"],
    ) -> tuple[Float64[np.ndarray, " nu"], float]:
        """LQP 2: the unconstrained chain's acceleration and what its tasks miss at most."""
        part = reduced.partition
        for task in tasks:
            task.evaluate(self._dynamics)
        J = np.vstack([task.jacobian for task in tasks])
        wanted = np.concatenate([task.reference - task.drift for task in tasks])
        wanted -= J[:, part.a.index] @ dv_a
        J_u = J[:, part.u.index]
        problem = HierarchicalProblem(
            [
                Level(A=reduced.J_z.copy(), lower=z.copy(), upper=z.copy()),
                Level(A=J_u, lower=wanted, upper=wanted),
            ],
            H=0.5 * (reduced.M_uu + reduced.M_uu.T),
        )
        solution = self._solver.solve(problem)
        if not solution.ok:
            raise PoiseError("LQP 2 has no answer", got=solution.status.value)
        return solution.x.copy(), float(np.abs(J_u @ solution.x - wanted).max())


_EVERY, _QUICK_EVERY = 10, 40
"""One tick in so many is looked at."""

_DEMANDS = (0.0, 10.0, 40.0)
"""Further acceleration that is asked of both hands, up [m/s^2]."""

_SAME = 1e-6
"""Relative difference of accelerations up to which two answers are one."""

_ORDERS = {"table1": "hands below COM", "hands_first": "hands above COM"}
_WHY = (
    ". Where limits of the free chain are active, LQP 2 keeps to the centroid of LQP 1, which "
    "did not know them: levels are met alike, and the energy below them is up to {energy:.3f} "
    "times the full problem's."
)
_CONTROLLERS = ("whole_body", "reduced")
_COM = [name for _, name, _ in QUANTITIES].index("COM")
_HANDS = [name for _, name, _ in QUANTITIES].index("hands and foot")

_PROSE = (
    "In Table 1 the hands stand below the COM and above the acceleration energy, which decides "
    "last. In Table 2 they are in LQP 2, under the centroid that LQP 1 has chosen by its "
    "energy: the energy stands above the hands. The two are not the same problem, even where "
    "everything can be met. Poise's LQP 1 knows what the hands ask for and keeps the user's order. "
    "The paper's order is computed here beside it: LQP 1 without the end effectors, then LQP 2 "
    "under its centroid, both exact.",
    "Then hands above and below the COM: both methods get the walk's states with hands that are "
    "asked for a further acceleration, from one that can be had to one that torques and feet do "
    "not allow, where the order decides what gives.",
)


@dataclass
class _Tally:
    """Largest values over the ticks."""

    worst: dict[str, float] = field(default_factory=dict[str, float])

    def add(self, **values: float) -> None:
        for name, value in values.items():
            self.worst[name] = max(self.worst.get(name, 0.0), value)


def order_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    recording = walk_run(options, lambda d, t: progress(0.5 * d / t, 1.0)).recording
    every = _QUICK_EVERY if options.quick else _EVERY
    energy = _energy_first(recording, every, lambda share: progress(0.5 + 0.2 * share, 1.0))
    orders: dict[float, dict[str, dict[str, _Tally]]] = {}
    for i, demand in enumerate(_DEMANDS, 1):
        orders[demand] = _orders(recording, every, demand)
        progress(0.7 + 0.3 * i / len(_DEMANDS), 1.0)
    return Section(
        prose=_PROSE,
        findings=(*_energy_findings(energy), *_order_findings(orders)),
        tables=(_energy_table(energy), _order_table(orders)),
    )


def _energy_first(
    recording: WalkRecording, every: int, share: Callable[[float], None]
) -> dict[str, _Tally]:
    """Poise's order against the paper's, by stance."""
    full = WalkSubject(recording, "table1", parse_method("whole_body", "direct"))
    judge = Judge(recording, "table1")
    sequential = Sequential(recording.robot, judge.lead.stack)
    base = recording.robot.base_dofs
    tallies = {stance: _Tally() for stance in STANCES}
    for index, state in enumerate(recording.states):
        judge.place(state)
        if index % every:
            full.skip(index)
            continue
        full.tick(index)
        answer = sequential.step(state)
        judge.evaluate()
        measured = judge.measure(answer)
        gap = np.abs(answer.acceleration - full.acceleration[index])
        tallies["double" if recording.feet[index] == 2 else "single"].add(
            base=float(gap[:base].max()),
            joints=float(gap[base:].max()),
            torque=float(np.abs(answer.torque - full.torque[index]).max()),
            force=float(np.abs(answer.wrench - full.wrench[index]).max()),
            com=float(measured[_COM]),
            hands=answer.missing,
            dynamics=float(measured[:3].max()),
        )
        share(index / len(recording.states))
    return {stance: tally for stance, tally in tallies.items() if tally.worst}


def _orders(recording: WalkRecording, every: int, demand: float) -> dict[str, dict[str, _Tally]]:
    """By order and controller: residuals; under "both" the difference of the two methods."""
    found: dict[str, dict[str, _Tally]] = {}
    for kind in _ORDERS:
        subjects = {
            c: WalkSubject(recording, kind, parse_method(c, "direct")) for c in _CONTROLLERS
        }
        judge = Judge(recording, kind)
        tallies = {name: _Tally() for name in (*_CONTROLLERS, "both")}
        leads = [*(s.lead for s in subjects.values()), judge.lead]
        for index, state in enumerate(recording.states):
            if index % every:
                for subject in subjects.values():
                    subject.skip(index)
                judge.place(state)
                continue
            for lead in leads:
                lead.push_hands(demand)
            for subject in subjects.values():
                subject.tick(index)
            judge.place(state)
            judge.evaluate()
            measured = {name: judge.measure(one.answer(index)) for name, one in subjects.items()}
            for name, one in subjects.items():
                com, hands = (float(measured[name][k]) for k in (_COM, _HANDS))
                tallies[name].add(com=com, hands=hands, programs=float(one.programs[index]))
            full, own = (subjects[c].acceleration[index] for c in _CONTROLLERS)
            residual = np.abs(measured["whole_body"] - measured["reduced"]).max()
            energy = float(own @ judge.dynamics.M @ own) / float(full @ judge.dynamics.M @ full)
            tallies["both"].add(
                gap=float(np.abs(full - own).max()),
                size=float(np.abs(full).max()),
                residual=float(residual),
                energy=energy,
            )
        found[kind] = tallies
    return found


def _energy_findings(energy: dict[str, _Tally]) -> list[Finding]:
    findings: list[Finding] = []
    for stance, tally in energy.items():
        worst = tally.worst
        findings += [
            Finding(
                name=f"{stance} support, energy above hands: residual of hands and foot, most",
                paper=0.0,
                ours=worst["hands"],
                unit="m/s², rad/s²",
                ok=worst["hands"] <= _SAME,
                note="LQP 2 meets its tasks under the centroid of LQP 1, where there are joints "
                "enough",
            ),
            Finding(
                name=f"{stance} support, energy above hands: miss of the COM, most",
                paper=0.0,
                ours=worst["com"],
                unit="m/s²",
                ok=worst["com"] <= _SAME,
                note="The order matters for all else: base and wrenches are others (a contact "
                f"force by {worst['force']:.2g} N or N m, the base by {worst['base']:.2g} m/s² or "
                f"rad/s², a joint's torque by {worst['torque']:.2g} N m).",
            ),
        ]
    return findings


def _order_findings(orders: dict[float, dict[str, dict[str, _Tally]]]) -> list[Finding]:
    most = max(orders)
    findings = [
        Finding(
            name=f"hands below COM, {most:g} m/s² more asked of the hands: COM misses, {name}",
            paper=0.0,
            ours=orders[most]["table1"][name].worst["com"],
            unit="m/s²",
            ok=orders[most]["table1"][name].worst["com"] <= _SAME,
            note="The level above pays nothing for the one below. With the hands above: "
            f"{orders[most]['hands_first'][name].worst['com']:.3g} m/s².",
        )
        for name in _CONTROLLERS
    ]
    for kind, words in _ORDERS.items():
        for demand, found in orders.items():
            both = found[kind]["both"].worst
            gap = both["gap"] / max(1.0, both["size"])
            case = f"{words}, {demand:g} m/s² more asked of the hands"
            findings += [
                Finding(
                    name=f"{case}: residuals, full to reduced",
                    paper=0.0,
                    ours=both["residual"],
                    unit="N, N m, m/s², rad/s²",
                    ok=both["residual"] <= _SAME,
                    note="No level is met less well by the reduced robot, or better.",
                ),
                Finding(
                    name=f"{case}: accelerations, full to reduced",
                    paper=0.0,
                    ours=gap,
                    ok=gap <= _SAME,
                    note=f"relative to the largest, {both['size']:.3g}"
                    + ("" if gap <= _SAME else _WHY.format(energy=both["energy"])),
                ),
            ]
    return findings


def _energy_table(energy: dict[str, _Tally]) -> Table:
    keys = ("base", "joints", "torque", "force", "com", "hands", "dynamics")
    return Table(
        title="Energy above the hands (the paper's order) beside energy below them (Table 1)",
        header="support | base [m/s², rad/s²] | joints [rad/s²] | torque [N m] | wrench [N, N m] | "
               "COM misses [m/s²] | hands and foot miss [m/s², rad/s²] | dynamics miss [N, N m]",
        rows=tuple((s, *(t.worst[k] for k in keys)) for s, t in energy.items()),
        caption="Largest differences of the two along the walk; what the paper's order misses.",
    )  # fmt: skip


def _order_table(orders: dict[float, dict[str, dict[str, _Tally]]]) -> Table:
    rows = tuple(
        (
            words,
            demand,
            *(found[kind][c].worst[what] for what in ("com", "hands") for c in _CONTROLLERS),
            int(found[kind]["reduced"].worst["programs"]),
            *(found[kind]["both"].worst[what] for what in ("residual", "gap", "energy")),
        )
        for kind, words in _ORDERS.items()
        for demand, found in orders.items()
    )
    return Table(
        title="Hands above and below the COM",
        header="order | asked of the hands [m/s²] | COM misses, full [m/s²] | COM misses, reduced "
               "| hands miss, full [m/s², rad/s²] | hands miss, reduced | programs, most | "
               "residuals, full to reduced | accelerations, full to reduced | "
               "energy, reduced to full",
        rows=rows,
        caption="Largest over the ticks. Programs: 1 LQP 1 alone, 2 with LQP 2, 3 the whole "
        "problem after all.",
    )  # fmt: skip
