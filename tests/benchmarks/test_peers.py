"""Peers run where their environments are named: POISE_TSID_PYTHON and the like."""

import json
import os
import stat
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pinocchio as pin
import pytest

from benchmarks.peers.process import (
    FRAME_PREFIX,
    PEERS,
    TORQUE_PEERS,
    URDF,
    VELOCITY_PEERS,
    PeerProcess,
    how_to_install,
    write_handoff,
)
from benchmarks.result import PHASES, TickResult
from benchmarks.tick import TickBench, bench_tick, velocity_figures
from poise.errors import PoiseError


def python_of(peer):
    python = os.environ.get(f"POISE_{peer.upper()}_PYTHON")
    if python is None:
        pytest.skip(f"POISE_{peer.upper()}_PYTHON does not name an environment with {peer}")
    return Path(python)


@pytest.mark.parametrize("peer", VELOCITY_PEERS)
def test_a_peer_of_inverse_kinematics_solves_the_same_states_and_holds_the_feet(peer):
    *own, other = bench_tick(
        TickBench(
            controller="differential_ik",
            stacks=("default",),
            ticks=25,
            peers={peer: python_of(peer)},
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


@pytest.mark.parametrize("peer", TORQUE_PEERS)
def test_a_peer_solves_the_same_states_and_its_base_moves_by_newtons_law(peer):
    direct, reference, other = bench_tick(
        TickBench(
            stacks=("default",),
            methods=(),
            ticks=25,
            peers={peer: python_of(peer)},
        )
    )
    assert [r.solver for r in (direct, reference)] == ["direct", "direct"]
    assert [r.schedule for r in (direct, reference, other)] == ["tick", "batch", "batch"]
    assert other.controller == peer
    assert other.solver.startswith(peer)
    assert other.missed_ticks == 0
    assert other.residual_max is not None
    assert other.residual_max < 1e-6
    assert 0.0 < other.p50_us <= other.p99_us <= other.max_us
    assert other.ratio_to_direct > 0.0


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
    assert done.stderr.count("was not timed") == len(TORQUE_PEERS)
    for name in TORQUE_PEERS:
        assert how_to_install(name) in done.stderr


@pytest.mark.parametrize("name", PEERS)
def test_every_peer_has_a_recipe_and_the_benchmark_that_times_it(name):
    said = how_to_install(name)
    assert f"peers/{name}/bin/pip install" in said
    assert f"--peers {name}=peers/{name}/bin/python" in said
    assert f"python -m benchmarks {'ik' if name in VELOCITY_PEERS else 'peers'} " in said
