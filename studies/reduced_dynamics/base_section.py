"""Beyond the paper: what leaving out the base's acceleration costs, (17).

The paper's (17): torques of the unconstrained chain as if the base did not accelerate.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from benchmarks.drawing import PALETTE
from poise.control import Command
from poise.dynamics import Dynamics, Partitions, RobotState
from poise.robots import Robot
from studies.finding import Figure, Finding, Section, Table, draw
from studies.plan import Progress, StudyOptions
from studies.reduced_dynamics.walk_run import STANCES, WalkRun, walk_run


class PaperTorques:
    """What (17), M_uc dv_uc + b_uc + g_uc = torque, leaves out of the exact rows.

    The exact rows are M_ua dv_a + M_uu dv_u + h_u. "On the frame of the base" b_uc may be read
    in two ways: with the base's velocity, or as that of a robot whose base is fixed.

    Args:
        robot: the robot, on two soles.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, self._partitions = robot, Partitions(robot)
        self._dynamics = Dynamics(robot)
        self._data = robot.model.createData()

    def left_out(
        self,
        state: RobotState,
        dv: Float64[np.ndarray, " nv"],
        contacts: tuple[str, ...],
        *,
        fixed_base: bool = False,
    ) -> Float64[np.ndarray, " nj"]:
        """Torque that is missing by joint, zero outside of the unconstrained chain [N m].

        Args:
            state: the state.
            dv: acceleration that is wanted.
            contacts: frames in contact.
            fixed_base: whether b_uc is that of a base that does not move, either.
        """
        part, base = self._partitions.of(contacts), self._robot.base_dofs
        self._dynamics.update(state)
        a, u = part.a.index, part.u.index
        torque = self._dynamics.M[np.ix_(u, a)] @ dv[a]
        if fixed_base:
            still = state.v.copy()
            still[:base] = 0.0
            h = pin.nonLinearEffects(self._robot.model, self._data, state.q, still)
            torque += (self._dynamics.h - h)[u]
        missing = np.zeros(self._robot.nj)
        missing[u - base] = torque
        return missing

    def alter(self, state: RobotState, command: Command) -> Command:
        """A command as (17) would have given it, in contact wherever a wrench was expected."""
        if command.torque is None or command.acceleration is None:
            return command
        missing = self.left_out(state, command.acceleration, tuple(command.wrenches))
        return replace(command, torque=command.torque - missing)


_SAME = 0.01
"""“Its dynamics is same”: torques within this [N m]; a thousandth of what an arm needs."""

_PROSE = (
    "Equation (17), M_uc dv_uc + b_uc + g_uc = Γ_uc, is that of a chain on a frame that does not "
    "accelerate. The rows of the whole robot are M_ua dv_a + M_uu dv_u + h_u: while the base "
    "accelerates, the first term is missing in (17). LQP 1 has found dv_a, so that it costs "
    "nothing to carry it along, and Poise does. Here is what would be missing in the torques "
    "along the walk.",
    "b_uc can be read with the velocity of the base in it, as h_u has it, or as that of a chain on "
    "a fixed frame; the table has both. The second leaves out Coriolis and centrifugal "
    "forces of the base's motion as well.",
)


def base_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    run = walk_run(options, lambda done, total: progress(0.8 * done / total, 1.0))
    missing = {fixed: _missing(run, fixed) for fixed in (False, True)}
    progress(1.0, 1.0)
    torque = np.abs(run.subjects["reduced", "direct"].torque)
    rows: list[tuple[str, str, float, float, float, float]] = []
    names = run.recording.robot.joint_names
    arms = [i for i, name in enumerate(names) if _group(name) == "arm"]
    findings: list[Finding] = []
    for fixed, words in ((False, "(17)"), (True, "(17) on a fixed frame")):
        for stance in STANCES:
            ticks = run.answered("direct", stance)
            worst = missing[fixed][ticks].max(axis=1)
            rows.append(
                (words, stance, float(worst.max()), float(np.median(worst)),
                 float(missing[fixed][ticks][:, arms].max()), float(torque[ticks][:, arms].max()))
            )  # fmt: skip
            if not fixed:
                findings.append(
                    Finding(
                        name=f"{stance} support: torque that (17) leaves out, most",
                        paper=0.0,
                        ours=float(worst.max()),
                        unit="N m",
                        ok=float(worst.max()) <= _SAME,
                        note="“its dynamics is same with the rigid body dynamics on the fixed "
                        "frame” does not hold while the base accelerates. Poise keeps the term.",
                    )
                )
    return Section(
        prose=_PROSE,
        findings=tuple(findings),
        figures=(_figure(run, missing[False]),),
        tables=(
            Table(
                title="Torque that is missing in the unconstrained chain",
                header="form | support | most [N m] | worst joint, median [N m] | "
                       "most of an arm's joint [N m] | largest torque of an arm's joint [N m]",
                rows=tuple(rows),
                caption="In single support the swing leg belongs to the unconstrained chain.",
            ),
        ),
    )  # fmt: skip


def _missing(run: WalkRun, fixed: bool) -> Float64[np.ndarray, "ticks nj"]:
    """Absolute torque that is missing, by tick and joint [N m]."""
    robot, one = run.recording.robot, run.subjects["reduced", "direct"]
    form = PaperTorques(robot)
    missing = np.zeros((len(run.recording.states), robot.nj))
    soles = [c.frame for c in one.lead.stack.contacts]
    for stance in STANCES:
        for tick in run.answered("direct", stance):
            wrenches = np.split(one.wrench[tick], len(soles))
            contacts = tuple(s for s, w in zip(soles, wrenches, strict=True) if np.any(w))
            missing[tick] = np.abs(
                form.left_out(
                    run.recording.states[tick], one.acceleration[tick], contacts, fixed_base=fixed
                )
            )
    return missing


def _figure(run: WalkRun, missing: Float64[np.ndarray, "ticks nj"]) -> Figure:
    time = np.array([state.time for state in run.recording.states])
    names = run.recording.robot.joint_names
    groups = {
        "arms": [i for i, n in enumerate(names) if _group(n) == "arm"],
        "waist and neck": [i for i, n in enumerate(names) if _group(n) == "trunk"],
        "legs, while they swing": [i for i, n in enumerate(names) if _group(n) == "leg"],
    }

    def paint(canvas: Any) -> None:
        panel = canvas.subplots()
        for (name, joints), colour in zip(groups.items(), PALETTE, strict=False):
            panel.plot(time, missing[:, joints].max(axis=1), color=colour, label=name)
        panel.set_xlabel("time [s]")
        panel.set_ylabel("torque left out [N m]")
        panel.legend(loc="upper left")

    return draw(
        name="base-acceleration",
        title="What (17) leaves out along the walk",
        caption="The largest of the joints in each group.",
        height=3.2,
        paint=paint,
    )


def _group(joint: str) -> str:
    if any(part in joint for part in ("hip", "knee", "ankle")):
        return "leg"
    return "trunk" if joint.startswith(("waist", "neck")) else "arm"
