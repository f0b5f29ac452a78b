"""Peers run where they are named: POISE_TSID_PYTHON, POISE_PLACO_PYTHON, POISE_LIBDWBC."""

import json
import os
import stat
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.clocked import Subject
from benchmarks.methods import REFERENCE
from benchmarks.peers import libdwbc
from benchmarks.peers.libdwbc import write_libdwbc_handoff
from benchmarks.peers.process import (
    FRAME_PREFIX,
    PEERS,
    PROGRAMS,
    RUN_WORDS,
    TORQUE_PEERS,
    URDF,
    VELOCITY_PEERS,
    PeerProcess,
    how_to_install,
    peer_variable,
    write_handoff,
)
from benchmarks.result import PHASES, TickResult
from benchmarks.tick import TickBench, bench_tick, peer_figures, velocity_figures
from poise.errors import ConfigurationError, PoiseError


def path_of(peer):
    path = os.environ.get(peer_variable(peer))
    if path is None:
        pytest.skip(f"{peer_variable(peer)} does not name {peer}")
    return Path(path)


@pytest.mark.parametrize("peer", VELOCITY_PEERS)
def test_a_peer_of_inverse_kinematics_solves_the_same_states_and_holds_the_feet(peer):
    *own, other = bench_tick(
        TickBench(
            controller="differential_ik",
            stacks=("default",),
            ticks=25,
            peers={peer: path_of(peer)},
        )
    )
    assert [(r.solver, r.schedule) for r in own] == [
        ("direct", "tick"),
        ("closed_form", "tick"),
        ("direct", "batch"),
        ("closed_form", "batch"),
    ]
    assert other.controller == peer
    assert other.solver.startswith(peer)
    assert other.solver.endswith("/daqp")
    assert other.variables == 39
    assert other.missed_ticks == 0
    assert other.residual_max is not None
    assert other.residual_max < 1e-6
    assert other.cpu_p10_us is not None
    assert 0.0 < other.cpu_p10_us <= other.p99_us


def test_our_inverse_kinematics_is_held_against_mink_on_the_same_schedule():
    row = TickResult(
        robot="g1",
        joints=29,
        controller="differential_ik",
        solver="closed_form",
        stack="table1",
        contacts="double",
        schedule="batch",
        variables=29,
        rows=53,
        p50_us=60.0,
        p99_us=70.0,
        max_us=80.0,
        cpu_min_us=48.0,
        cpu_p10_us=50.0,
        cpu_p50_us=60.0,
        cpu_p99_us=70.0,
        phases_us=dict.fromkeys(PHASES, None),
        ticks=10,
        residual_max=1e-15,
        ratio_to_direct=1.0,
        ratio_to_whole=None,
        relaxed_ticks=0,
        missed_ticks=0,
    )
    slower = replace(row, solver="hqp", cpu_p10_us=120.0)
    alone = replace(row, schedule="tick", cpu_p10_us=1.0)
    mink = replace(row, controller="mink", solver="mink/daqp", cpu_p10_us=100.0)
    found = velocity_figures([alone, row, slower, mink])
    assert [(f.bound, f.ours, f.ok) for f in found] == [(1.0, 0.5, True), (1.0, 1.2, False)]
    assert velocity_figures([alone, row, slower]) == []


@pytest.mark.parametrize(
    ("peer", "stack", "bound"),
    [
        ("tsid", "default", 1e-6),
        ("placo", "default", 1e-6),
        ("libdwbc", "table1", 1e-6),
        # Its reduced dynamics have no velocity terms.
        ("libdwbc_reduced", "table1", 1e-2),
    ],
)
def test_a_peer_solves_the_same_states_and_its_base_moves_by_newtons_law(peer, stack, bound):
    path = path_of(peer)
    direct, reference, other = bench_tick(
        TickBench(
            stacks=(stack,),
            methods=(),
            ticks=25,
            peers={peer: path},
        )
    )
    assert [r.solver for r in (direct, reference)] == ["direct", "direct"]
    assert [r.schedule for r in (direct, reference, other)] == ["tick", "batch", "batch"]
    assert other.controller == peer
    assert other.solver.startswith(peer.partition("_")[0])
    assert other.missed_ticks == 0
    assert other.residual_max is not None
    assert other.residual_max < bound
    assert 0.0 < other.p50_us <= other.p99_us <= other.max_us
    assert other.cpu_p10_us is not None
    assert other.cpu_p50_us is not None
    assert 0.0 < other.cpu_p10_us <= other.cpu_p50_us
    assert other.ratio_to_direct > 0.0


@pytest.mark.parametrize("peer", list(PROGRAMS))
def test_libdwbcs_torques_are_near_ours(peer, tmp_path, recording):
    program = path_of(peer)
    write_handoff(tmp_path, recording, "table1")
    write_libdwbc_handoff(tmp_path / URDF, tmp_path / RUN_WORDS, recording, "table1")
    own = Subject(recording, "table1", REFERENCE)
    own.tick(20)
    done = subprocess.run(
        [program, PROGRAMS[peer], tmp_path / URDF, tmp_path / RUN_WORDS],
        input=json.dumps({"first": 20, "count": 1}) + "\n",
        capture_output=True,
        text=True,
        check=True,
    )
    answer = json.loads(done.stdout.splitlines()[1])
    assert own.command is not None
    torque = own.command.torque
    # Its weight on accelerations pulls the torques to those of a robot at rest.
    np.testing.assert_allclose(answer["torques"], torque, atol=0.1 * np.abs(torque).max())
    assert answer["task_error"] < 0.4


def test_libdwbc_gets_the_joints_that_carry_soles_first(tmp_path, recording):
    robot = recording.robot
    write_handoff(tmp_path, recording, "table1")
    write_libdwbc_handoff(tmp_path / URDF, tmp_path / RUN_WORDS, recording, "table1")
    moved = [
        (joint.get("name", ""), joint.find("child").attrib["link"])
        for joint in ET.parse(tmp_path / URDF).getroot().findall("joint")
        if joint.get("type") != "fixed"
    ]
    names = [name[4:] for name, _ in sorted(moved)]
    assert sorted(names) == sorted(robot.joint_names)
    assert all("hip" in name or "knee" in name or "ankle" in name for name in names[:12])
    words = [line.split() for line in (tmp_path / RUN_WORDS).read_text().splitlines()]
    links = {name[4:]: link for name, link in moved}
    assert [w[1] for w in words if w[0] == "joint"] == [links[n] for n in robot.joint_names]
    ticks = [w for w in words if w[0] == "tick"]
    assert len(ticks) == len(recording.states)
    # A state, and three points each of COM and both hands.
    assert {len(w) for w in ticks} == {2 + robot.nq + robot.nv + 27}
    assert [w[0] for w in words[-5:]][-1] == "end"


def test_a_sole_that_is_turned_is_refused_by_libdwbcs_handoff(tmp_path, recording, monkeypatch):
    write_handoff(tmp_path, recording, "table1")
    monkeypatch.setattr(libdwbc, "_mount", lambda *_: ("left_foot_link", pin.SE3.Random()))
    with pytest.raises(ConfigurationError, match="turned against left_foot_link"):
        write_libdwbc_handoff(tmp_path / URDF, tmp_path / RUN_WORDS, recording, "table1")


def test_libdwbcs_figures_are_ratios_of_processor_time_where_both_were_timed():
    own = TickResult(
        robot="humanoid33",
        joints=33,
        controller="whole_body",
        solver="direct",
        stack="table1",
        contacts="double",
        schedule="batch",
        variables=51,
        rows=124,
        p50_us=100.0,
        p99_us=120.0,
        max_us=150.0,
        cpu_min_us=40.0,
        cpu_p10_us=60.0,
        cpu_p50_us=99.0,
        cpu_p99_us=119.0,
        phases_us=dict.fromkeys(PHASES, 25.0),
        ticks=10,
        residual_max=1e-15,
        ratio_to_direct=1.0,
        ratio_to_whole=1.0,
        relaxed_ticks=0,
        missed_ticks=0,
    )
    theirs = replace(own, controller="libdwbc", cpu_p10_us=2400.0)
    reduced = replace(own, controller="reduced", cpu_p10_us=80.0)
    slower = replace(own, controller="libdwbc_reduced", cpu_p10_us=1200.0)
    full, less = peer_figures([own, reduced, theirs, slower])
    assert (full.ours, full.bound, full.ok) == (40.0, 35.0, True)
    assert (less.ours, less.bound, less.ok) == (15.0, 18.0, False)
    assert "libdwbc_reduced over reduced" in less.words()
    assert peer_figures([own, reduced, slower]) == [less]
    assert peer_figures([replace(one, stack="default") for one in (own, theirs)]) == []


def test_a_robot_is_handed_over_with_its_mass_joints_and_frames(tmp_path, recording):
    robot = recording.robot
    write_handoff(tmp_path, recording, "table1")
    model = pin.buildModelFromUrdf(str(tmp_path / URDF), pin.JointModelFreeFlyer())
    assert list(model.names)[2:] == list(robot.joint_names)
    assert pin.computeTotalMass(model) == pytest.approx(robot.mass, rel=1e-12)
    data, own = model.createData(), robot.model.createData()
    pin.framesForwardKinematics(model, data, robot.q_home)
    pin.framesForwardKinematics(robot.model, own, robot.q_home)
    for name in (*robot.soles, *robot.hands, robot.pelvis):
        handed = data.oMf[model.getFrameId(FRAME_PREFIX + name)]
        assert handed.isApprox(own.oMf[robot.frame_id(name)], 1e-9)


def test_an_interpreter_without_the_peer_is_said_in_one_line(recording):
    with pytest.raises(PoiseError, match="peer 'tsid' cannot run: ModuleNotFoundError"):
        PeerProcess("tsid", Path(sys.executable), recording, "table1")


def test_a_worker_that_dies_is_said_with_its_last_words(tmp_path, recording):
    script = tmp_path / "python"
    script.write_text("#!/bin/sh\necho all is lost >&2\nexit 3\n", encoding="utf-8")
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    with pytest.raises(PoiseError, match="ended unexpectedly: all is lost"):
        PeerProcess("placo", script, recording, "table1")


@pytest.mark.slow
def test_without_an_interpreter_it_says_what_to_install_and_times_the_rest():
    environment = {k: v for k, v in os.environ.items() if not k.startswith("POISE_")}
    command = [sys.executable, "-m", "benchmarks", "peers", "--ticks", "10", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert [(r["controller"], r["solver"]) for r in rows] == [
        ("whole_body", "direct"),
        ("reduced", "direct"),
    ]
    whole, reduced = rows
    assert whole["ratio_to_whole"] == 1.0
    assert reduced["ratio_to_whole"] == pytest.approx(reduced["p50_us"] / whole["p50_us"], rel=0.5)
    assert reduced["variables"] < whole["variables"] == 51
    missing = dict.fromkeys(how_to_install(name) for name in TORQUE_PEERS)
    assert done.stderr.count("was not timed") == len(missing) == 3
    assert all(words in done.stderr for words in missing)


@pytest.mark.parametrize("name", [name for name in PEERS if name not in PROGRAMS])
def test_every_peer_has_a_recipe_and_the_benchmark_that_times_it(name):
    said = how_to_install(name)
    assert f"peers/{name}/bin/pip install" in said
    assert f"--peers {name}=peers/{name}/bin/python" in said
    assert f"python -m benchmarks {'ik' if name in VELOCITY_PEERS else 'peers'} " in said
