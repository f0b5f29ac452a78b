"""The study of reduced dynamics: its measures against oracles, its parts on a standstill."""

import json
import subprocess
import sys
from importlib import import_module

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.clocked import Turns, take_turns
from benchmarks.methods import timed_methods
from benchmarks.walk_recording import Answer, WalkRecording, WalkSubject
from poise.control import Command, CommandStatus
from poise.dynamics import Partitions, RobotState
from poise.locomotion import Stride, plan_footsteps
from poise.locomotion._walking._step_planner import StepPlanner
from poise.robots import load_robot
from studies.plan import StudyOptions
from studies.reduced_dynamics import PLAN, walk_run
from studies.reduced_dynamics.accuracy_section import QUANTITIES, Judge, accuracy_section
from studies.reduced_dynamics.base_section import PaperTorques, base_section
from studies.reduced_dynamics.difference_section import difference_section
from studies.reduced_dynamics.order_section import Sequential, order_section
from studies.reduced_dynamics.sizes_section import sizes_section
from studies.reduced_dynamics.timing_section import timing_section
from tests.benchmarks.test_dof import robot as dof_robot

for package in ("matplotlib", "mujoco", "osqp"):
    pytest.importorskip(package)

TRACKING = """
import json
from studies.reduced_dynamics.tracking_section import _VARIANTS, _findings, _run, _stand
from poise.robots import load_robot
robot = load_robot("humanoid33")
curves = [_run(_stand, robot, v, 60, lambda share: None) for v in _VARIANTS]
print(json.dumps([[f.ours, f.ok] for f in _findings("double support", curves)]))
"""
OPTIONS = StudyOptions(quick=True)
DT = 0.02


@pytest.fixture(scope="module")
def run():
    """The robot stands while time and targets go on, into the first single support."""
    with pytest.MonkeyPatch.context() as patch:
        # What does not move never comes over the foot that stays: no step would seem worth it.
        patch.setattr(StepPlanner, "cost", lambda planner, lifted: 0.0)
        yield standing_run()


def standing_run():
    robot = load_robot("humanoid33")
    plan = plan_footsteps(robot, [Stride(steps=1, length=0.1)])
    states = tuple(
        RobotState(robot.q_home, np.zeros(robot.nv), time=DT * i, contacts={}) for i in range(66)
    )
    robot_feet = np.full(len(states), 2, dtype=np.int64)
    zeros = np.zeros(len(states))
    walk = WalkRecording(
        robot=robot, plan=plan, states=states, feet=robot_feet, com_error=zeros, hand_error=zeros
    )
    subjects = {
        (m.controller, m.name): WalkSubject(walk, "table1", m)
        for m in timed_methods("reduced", None)
    }
    turns = Turns(ticks=len(states), batch=11, slow=1)
    quick, slow = (
        [s for (_, name), s in subjects.items() if ("/" in name) is cascade]
        for cascade in (False, True)
    )
    for _ in take_turns(quick, slow, turns):
        pass
    judge = Judge(walk, "table1")
    for i, state in enumerate(states):
        judge.place(state)
        robot_feet[i] = sum(c.active for c in judge.lead.stack.contacts)
    return walk_run.WalkRun(recording=walk, turns=turns, subjects=subjects)


@pytest.fixture
def installed(run):
    """The standstill in the place of the walk that the parts share."""
    holder = walk_run._holder(True)
    before = list(holder)
    holder[:] = [run]
    yield run
    holder[:] = before


def test_both_stances_occur(run):
    assert set(np.unique(run.recording.feet)) == {1, 2}


@pytest.mark.parametrize(
    "section",
    [timing_section, sizes_section, difference_section, base_section, accuracy_section,
     order_section],
)  # fmt: skip
def test_a_part_says_its_findings_and_comes_to_its_end(installed, section, monkeypatch):
    module = import_module("studies.reduced_dynamics.order_section")
    monkeypatch.setattr(module, "_DEMANDS", (10.0,))
    monkeypatch.setattr(module, "_QUICK_EVERY", 20)
    seen = []
    result = section(OPTIONS, lambda done, total: seen.append(done / total))
    assert seen[-1] == 1.0
    assert seen == sorted(seen)
    assert result.findings
    assert result.tables
    names = [finding.name for finding in result.findings]
    assert len(set(names)) == len(names)


def test_full_and_reduced_are_one_wherever_no_limit_of_the_hanging_chain_is_active(run):
    full, own = (run.subjects[c, "direct"] for c in ("whole_body", "reduced"))
    alone = own.programs == 1
    assert alone.sum() > 30
    for kind in ("acceleration", "torque", "wrench"):
        one, other = (getattr(s, kind)[alone] for s in (full, own))
        assert np.abs(one - other).max() < 1e-9 * np.abs(one).max()


def test_the_sizes_are_those_of_the_paper(installed):
    findings = sizes_section(OPTIONS, lambda done, total: None).findings
    assert [f.paper for f in findings] == [51, 36, 21, 45, 24, 27]
    assert [f.name for f in findings if not f.ok] == []


def test_the_judge_finds_nothing_in_an_exact_answer_and_every_change_of_it(run):
    judge = Judge(run.recording, "table1")
    subject = run.subjects["whole_body", "direct"]
    tick = len(run.recording.states) - 1
    for state in run.recording.states:
        judge.place(state)
    judge.evaluate()
    exact = {
        name: getattr(subject, name)[tick].copy() for name in ("acceleration", "torque", "wrench")
    }
    assert judge.measure(Answer(**exact)).max() < 1e-9
    names = [name for _, name, _ in QUANTITIES]
    for key, index, change, what in (
        ("torque", 0, 0.5, "joint torque"),
        ("acceleration", 0, 1e-3, "COM"),
        ("wrench", -4, 2.0, "base force"),
    ):
        other = {name: value.copy() for name, value in exact.items()}
        other[key][index] += change
        assert judge.measure(Answer(**other))[names.index(what)] > 1e-4


def test_what_17_leaves_out_is_what_the_accelerating_base_asks_of_the_chain(run):
    robot = run.recording.robot
    rng = np.random.default_rng(5)
    q = pin.integrate(robot.model, robot.q_home, 0.3 * rng.standard_normal(robot.nv))
    v, dv = rng.standard_normal((2, robot.nv))
    state = RobotState(q, v)
    form, soles = PaperTorques(robot), tuple(robot.soles)
    u = Partitions(robot).of(soles).u.index
    alone, still = np.zeros(robot.nv), v.copy()
    alone[u] = dv[u]
    still[: robot.base_dofs] = 0.0
    data = robot.model.createData()

    def torque(velocity, acceleration):
        return pin.rnea(robot.model, data, q, velocity, acceleration)[u]

    joints = u - robot.base_dofs
    missing = form.left_out(state, dv, soles)
    assert missing[joints] == pytest.approx(torque(v, dv) - torque(v, alone), abs=1e-9)
    missing = form.left_out(state, dv, soles, fixed_base=True)
    assert missing[joints] == pytest.approx(torque(v, dv) - torque(still, alone), abs=1e-9)
    others = np.setdiff1d(np.arange(robot.nj), joints)
    assert not missing[others].any()
    command = Command(
        status=CommandStatus.OK,
        torque=np.zeros(robot.nj),
        acceleration=dv,
        wrenches={name: np.zeros(6) for name in soles},
    )
    assert form.alter(state, command).torque == pytest.approx(-form.left_out(state, dv, soles))


def test_the_papers_order_keeps_dynamics_and_balance_and_changes_what_energy_decides(run):
    walk = run.recording
    judge, full = Judge(walk, "table1"), run.subjects["whole_body", "direct"]
    sequential = Sequential(walk.robot, judge.lead.stack)
    tick = 30
    for state in walk.states[: tick + 1]:
        judge.place(state)
    answer = sequential.step(walk.states[tick])
    judge.evaluate()
    measured = judge.measure(
        Answer(acceleration=answer.acceleration, torque=answer.torque, wrench=answer.wrench)
    )
    assert measured.max() < 1e-8
    assert answer.missing < 1e-8
    assert np.abs(answer.acceleration - full.acceleration[tick]).max() > 1e-3


def test_figure_5_compares_with_the_numbers_of_the_paper(monkeypatch):
    results = [
        *dof_robot(20, 200.0, 210.0, 5000.0, 3700.0),
        *dof_robot(45, 250.0, 140.0, 9000.0, 3000.0),
    ]
    results += [
        r
        for n, own in ((20, 1.0), (45, 0.5))
        for r in dof_robot(n, 200.0, 200.0 * own, 5e3, 5e3 * own, contacts="single")
    ]
    module = import_module("studies.reduced_dynamics.dof_section")
    monkeypatch.setattr(module, "bench_dof", lambda plan, progress: results)
    section = module.dof_section(OPTIONS, lambda done, total: None)
    found = {f.name: f for f in section.findings}
    small = found["Figure 5, 20 joints, double support, cascade/osqp: decrease"]
    assert (small.paper, small.ours, small.ok) == (pytest.approx(24.27, abs=0.01), 26.0, True)
    large = found["Figure 5, 45 joints, double support, cascade/osqp: decrease"]
    assert (large.paper, large.ours) == (
        pytest.approx(67.68, abs=0.01),
        pytest.approx(66.67, abs=0.01),
    )
    assert not large.ok
    assert sum(f.ok for f in section.findings) == 5
    assert [f.name for f in section.figures] == ["figure-5"]


@pytest.mark.slow
def test_both_methods_track_alike_in_the_loop():
    # Without the shape checks of the tests, which take five times as long.
    done = subprocess.run(
        [sys.executable, "-c", TRACKING], capture_output=True, text=True, check=True
    )
    com, hand, _, hand_17 = json.loads(done.stdout)
    assert com == [pytest.approx(1.0, abs=0.1), True]
    assert hand == [pytest.approx(1.0, abs=0.1), True]
    # What (17) leaves out moves the hand.
    assert hand_17[0] > 2.0


def test_parts_have_names_of_their_own():
    names = [part.name for part in PLAN.parts]
    assert len(set(names)) == len(names)
