"""The study of reduced dynamics: its measures against oracles, its parts on a standstill."""

from importlib import import_module

import numpy as np
import pytest
from tick_results import tick_result

from benchmarks.clocked import Turns, take_turns
from benchmarks.methods import timed_methods
from benchmarks.walk_recording import WalkRecording, WalkSubject
from poise.dynamics import RobotState
from poise.locomotion import Stride, plan_footsteps
from poise.locomotion._walking._step_planner import StepPlanner
from poise.robots import load_robot
from studies.plan import StudyOptions
from studies.reduced_dynamics import walk_run
from studies.reduced_dynamics.difference_section import difference_section
from studies.reduced_dynamics.sizes_section import sizes_section
from studies.reduced_dynamics.timing_section import timing_section

for package in ("matplotlib", "mujoco", "osqp"):
    pytest.importorskip(package)

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
    lead = walk.lead("table1")
    for i, state in enumerate(states):
        lead.pass_by(state)
        robot_feet[i] = sum(c.active for c in lead.stack.contacts)
    return walk_run.WalkRun(recording=walk, turns=turns, subjects=subjects)


@pytest.fixture
def installed(run):
    """The standstill in the place of the walk that the parts share."""
    holder = walk_run._holder(True)
    before = list(holder)
    holder[:] = [run]
    yield run
    holder[:] = before


@pytest.mark.parametrize("section", [timing_section, sizes_section, difference_section])
def test_a_part_says_its_findings_and_comes_to_its_end(installed, section):
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


TIMES = {
    ("double", 20): (200.0, 210.0, 5000.0, 3700.0),
    ("double", 45): (250.0, 140.0, 9000.0, 3000.0),
    ("single", 20): (200.0, 200.0, 5000.0, 5000.0),
    ("single", 45): (200.0, 100.0, 5000.0, 2500.0),
}
"""Full and reduced controller by the default solver, then by the cascade [us]."""


def test_figure_5_compares_with_the_numbers_of_the_paper(monkeypatch):
    def bench(plan):
        joints = int(plan.robot.removeprefix("humanoid"))
        times = iter(TIMES[plan.contacts, joints])
        return [
            tick_result(
                robot=plan.robot,
                joints=joints,
                controller=controller,
                solver=solver,
                contacts=plan.contacts,
                p50_us=next(times),
            )
            for solver in plan.methods
            for controller in ("whole_body", "reduced")
        ]

    module = import_module("studies.reduced_dynamics.dof_section")
    monkeypatch.setattr(module, "bench_tick", bench)
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
    assert len(section.tables[0].rows) == 16
