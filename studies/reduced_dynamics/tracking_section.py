"""Figure 4: tracking errors of CoM and hand, in the loop with MuJoCo."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from benchmarks.methods import parse_method
from benchmarks.recording import record_run
from benchmarks.walk_recording import record_walk
from poise.dynamics import Dynamics
from poise.robots import Robot, load_robot
from studies.finding import Finding, Section, Table
from studies.plan import Progress, Steps, StudyOptions
from studies.reduced_dynamics.walk_run import ROBOT

_SIMILAR = 2.0
"""Of similar magnitude: RMS errors within a factor of this."""

Methods = dict[str, tuple[str, str]]
"""Controller and solver, by the name of the curve; each proposed one follows its reference."""

_DIRECT: Methods = {
    "conventional": ("whole_body", "direct"),
    "proposed": ("reduced", "direct"),
}
_BY_OSQP: Methods = {
    "conventional, cascade/osqp": ("whole_body", "cascade/osqp"),
    "proposed, cascade/osqp": ("reduced", "cascade/osqp"),
}
"""As in the paper; only in double support, because they take a while."""


class Curve(NamedTuple):
    """Errors of one run: distances of CoM and left hand from their targets [m]."""

    com: Float64[np.ndarray, " n"]
    hand: Float64[np.ndarray, " n"]


def tracking_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    robot = load_robot(ROBOT)
    cases = {
        "double support": (_stand, _DIRECT if options.quick else _DIRECT | _BY_OSQP,
                           500 if options.quick else 2000),
        "walk": (_walk, _DIRECT, 1 if options.quick else 4),
    }  # fmt: skip
    steps = Steps(progress, sum(len(methods) for _, methods, _ in cases.values()))
    curves = {
        (case, name): run(robot, controller, solver, length, steps.next())
        for case, (run, methods, length) in cases.items()
        for name, (controller, solver) in methods.items()
    }
    steps.finish()
    return Section(
        prose=(
            "The robot runs in MuJoCo under each controller in turn, and the distances of CoM and "
            "left hand from their targets are compared. In double support CoM and hands go round, "
            "as in the paper's figure, under the robot's default stack. Then it walks with the "
            "hands going round beside it; below Table 1's levels there is a posture, without which "
            "nothing would hold the joints that no task needs.",
            "“Similar magnitudes of control error” is taken as: RMS errors within a factor of two.",
        ),
        findings=tuple(_findings(curves)),
        tables=(
            Table(
                title="Tracking errors",
                header="run | method | CoM, RMS [mm] | most [mm] | hand, RMS [mm] | most [mm]",
                rows=tuple(
                    (
                        *key,
                        *(f(e) for e in (curve.com, curve.hand) for f in (_rms, _most)),
                    )
                    for key, curve in curves.items()
                ),
                caption="The CoM of the walk has no stiffness of its own: a feedback of the DCM "
                "leads it.",
            ),
        ),
    )


def _rms(errors: Float64[np.ndarray, " n"]) -> float:
    return 1e3 * float(np.sqrt(np.mean(errors**2)))


def _most(errors: Float64[np.ndarray, " n"]) -> float:
    return 1e3 * float(errors.max())


def _stand(
    robot: Robot, controller: str, solver: str, ticks: int, share: Callable[[float], None]
) -> Curve:
    recording = record_run(
        robot,
        "double",
        ticks,
        lambda done, total: share(done / total),
        method=parse_method(controller, solver),
    )
    dynamics, hand = Dynamics(robot), next(iter(robot.hands))
    name = next(n for n in recording.paths if n.startswith(hand))
    com, end = np.zeros((2, len(recording.states)))
    for i, state in enumerate(recording.states):
        dynamics.update(state)
        com[i] = np.linalg.norm(recording.paths["com"].position[i] - dynamics.com)
        place = dynamics.frame(robot.frame_id(hand)).position
        end[i] = np.linalg.norm(recording.paths[name].position[i] - place)
    return Curve(com, end)


def _walk(
    robot: Robot, controller: str, solver: str, count: int, share: Callable[[float], None]
) -> Curve:
    walk = record_walk(
        robot,
        count,
        lambda done, total: share(done / total),
        method=parse_method(controller, solver),
    )
    return Curve(walk.com_error, walk.hand_error)


def _findings(curves: dict[tuple[str, str], Curve]) -> list[Finding]:
    findings: list[Finding] = []
    for (case, name), curve in curves.items():
        if name.startswith("conventional"):
            continue
        reference = name.replace("proposed", "conventional")
        for what, words in (("com", "CoM"), ("hand", "left hand")):
            own, full = (_rms(getattr(c, what)) for c in (curve, curves[case, reference]))
            findings.append(
                Finding(
                    name=f"Figure 4, {case}, {words}: RMS error, {name} to {reference}",
                    paper=1.0,
                    ours=own / full,
                    ok=1.0 / _SIMILAR <= own / full <= _SIMILAR,
                    note=f"“similar magnitudes of control error”: {own:.3f} to {full:.3f} mm",
                )
            )
    return findings
