"""Peers run where they are named: POISE_TSID_PYTHON, POISE_PLACO_PYTHON, POISE_LIBDWBC."""

import json
import os
import stat
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import pinocchio as pin
import pytest
from tick_results import tick_result

from benchmarks.peers.libdwbc import write_libdwbc_handoff
from benchmarks.peers.process import (
    FRAME_PREFIX,
    RUN_WORDS,
    TORQUE_PEERS,
    URDF,
    VELOCITY_PEERS,
    PeerProcess,
    how_to_install,
    peer_variable,
    write_handoff,
)
from benchmarks.tick import TickBench, bench_tick, peer_figures, velocity_figures
from poise.errors import PoiseError


@pytest.mark.parametrize(
    ("peer", "stack", "bound"),
    [
        ("tsid", "default", 1e-6),
        ("placo", "default", 1e-6),
        ("libdwbc", "table1", 1e-6),
        # Its reduced dynamics have no velocity terms.
        ("libdwbc_reduced", "table1", 1e-2),
        ("mink", "default", 1e-6),
        ("pink", "default", 1e-6),
    ],
)
def test_a_peer_solves_the_same_states_and_its_hard_rows_hold(peer, stack, bound):
    """The base's equation of motion, or feet that stay."""
    path = os.environ.get(peer_variable(peer))
    if path is None:
        pytest.skip(f"{peer_variable(peer)} does not name {peer}")
    controller = "differential_ik" if peer in VELOCITY_PEERS else "whole_body"
    plan = TickBench(
        controller=controller,
        stacks=(stack,),
        methods=("direct",),
        ticks=25,
        peers={peer: Path(path)},
    )
    *own, other = bench_tick(plan)
    assert {r.solver for r in own} == {"direct"}
    assert (other.controller, other.schedule, other.missed_ticks) == (peer, "batch", 0)
    assert other.solver.startswith(peer.partition("_")[0])
    assert other.residual_max is not None
    assert other.residual_max < bound
    assert 0.0 < other.p50_us <= other.p99_us <= other.max_us
    assert other.cpu_p10_us is not None
    assert other.ratio_to_direct > 0.0


def test_figures_of_peers_are_ratios_of_processor_time_where_both_were_timed():
    own = tick_result(schedule="batch", cpu_p10_us=60.0)
    theirs = replace(own, controller="libdwbc", cpu_p10_us=2400.0)
    reduced = replace(own, controller="reduced", cpu_p10_us=80.0)
    slower = replace(own, controller="libdwbc_reduced", cpu_p10_us=1200.0)
    full, less = peer_figures([own, reduced, theirs, slower])
    assert (full.ours, full.bound, full.ok) == (40.0, 35.0, True)
    assert (less.ours, less.bound, less.ok) == (15.0, 18.0, False)
    assert peer_figures([own, reduced, slower]) == [less]
    joints = replace(own, controller="differential_ik", solver="closed_form")
    mink = replace(own, controller="mink", solver="mink/daqp", cpu_p10_us=50.0)
    (found,) = velocity_figures([replace(joints, schedule="tick"), joints, mink])
    assert (found.bound, found.ours, found.ok) == (1.0, 1.2, False)
    assert velocity_figures([joints]) == []


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
    # A state, and three points each of CoM and both hands.
    assert {len(w) for w in ticks} == {2 + robot.nq + robot.nv + 27}
    assert [w[0] for w in words[-5:]][-1] == "end"


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
