"""A link to a G1 and a simulated robot's end of the same topics, over the loopback interface."""

import itertools
import multiprocessing
import os
import signal
import socket
import struct
import sys
import time
from contextlib import contextmanager
from importlib.util import find_spec

import g1_ends
import numpy as np
import pytest

from poise.errors import ConfigurationError, MissingExtraError, RobotError, UnknownNameError
from poise.hardware import MODE_MACHINES, G1Link, G1Robot, LinkStatus, MotorCommand, ProcessLink

SPAWN = multiprocessing.get_context("spawn")
LOWCMD = struct.Struct("<2B2x" + "B3x5fI" * 35 + "5I")
"""Memory of a command, over which its sender computes the checksum."""
LOWCMD_CDR = struct.Struct("<2B" + "Bx5fI" + "B3x5fI" * 34 + "5I")
"""The same as it is sent, where padding is for the next field alone."""

NUMBER = itertools.count()


@pytest.fixture
def tag():
    """A name that separates this test's participants from those of other tests."""
    if find_spec("unitree_interface") is None:
        pytest.skip("needs far-unitree-sdk")
    return f"test{os.getpid()}x{next(NUMBER)}"


@contextmanager
def process(main, *arguments):
    """A process, and the pipe to it."""
    near, far = SPAWN.Pipe()
    made = SPAWN.Process(target=main, args=(far, *arguments), daemon=False)
    made.start()
    far.close()
    try:
        yield near, made
    finally:
        made.kill()
        made.join()


def real_time():
    """A priority above whatever else a busy machine does; None where that is not permitted."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except (AttributeError, OSError):
        return None
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return 80


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def lines_of(pipe):
    pipe.send("end")
    return pipe.recv()


@pytest.mark.parametrize(("joints", "count"), [(29, 1000), (23, 200)])
def test_commands_and_states_arrive_as_they_were_sent(tag, joints, count):
    with (
        process(g1_ends.answer, tag, joints, count) as (robot, _),
        process(g1_ends.ask, tag, joints, count) as (link, _),
    ):
        states, commands = link.recv(), robot.recv()
    for sent, got in (
        (g1_ends.random_commands(count, joints), commands),
        (g1_ends.random_states(count, joints), states),
    ):
        expected = np.array([g1_ends.numbers_of(record) for record in sent])
        np.testing.assert_array_equal(np.float32(got), np.float32(expected))


def test_a_link_without_its_robot_says_how_peers_find_each_other(tag):
    with pytest.raises(RobotError, match=r"no state of a G1.*0\.3 s on lo.*unicast"):
        ProcessLink(g1_ends.link_to(tag, timeout=0.3), g1_ends.check())


def test_a_link_refuses_a_robot_in_a_motion_mode_of_its_own_until_it_is_released(tag):
    with process(g1_ends.walk, tag):
        with pytest.raises(RobotError, match=r"motion mode.*got 'ai'"):
            ProcessLink(g1_ends.link_to(tag), g1_ends.check())
        link = ProcessLink(g1_ends.link_to(tag, release=True), g1_ends.check(), linger=0.0)
        assert link.status is not LinkStatus.LOST
        link.close()


def test_a_link_refuses_another_robot(tag):
    with process(g1_ends.stand, tag, 4):  # noqa: SIM117
        with pytest.raises(RobotError, match=r"4 \(g1_23dof_rev.*wanted 5 \(g1_29dof_rev"):
            ProcessLink(g1_ends.link_to(tag), g1_ends.check())


def test_a_link_refuses_to_be_a_second_controller_until_the_first_has_closed(tag):
    with process(g1_ends.stand, tag), process(g1_ends.hold, tag) as (first, _):
        assert first.recv() is LinkStatus.OK
        with pytest.raises(RobotError, match=r"another process commands.*kd up to 2"):
            ProcessLink(g1_ends.link_to(tag), g1_ends.check())
        first.send("close")
        assert first.recv() is LinkStatus.LOST
        second = ProcessLink(g1_ends.link_to(tag), g1_ends.check(), linger=0.0)
        assert second.status is not LinkStatus.LOST
        second.close()


def test_a_process_has_one_network_interface_and_tag(tag):
    with process(g1_ends.two_robots, tag) as (pipe, _):
        name, message, _ = pipe.recv()
    assert name == "RobotError"
    assert "one interface and tag in a process" in message


def make(**settings):
    known = {"interface": "lo", "mode_machines": (g1_ends.MODE,)}
    return G1Link(g1_ends.JOINTS[29], g1_ends.MOTORS, **known | settings)


def test_settings_that_cannot_be_are_refused_before_dds_starts(monkeypatch):
    with pytest.raises(ConfigurationError, match="longest wait"):
        make(timeout=0.0)
    with pytest.raises(UnknownNameError, match="'tail'"):
        G1Link(("motor1", "tail"), g1_ends.MOTORS, interface="lo", mode_machines=(5,))
    with pytest.raises(ConfigurationError, match="number of motors; got 27; wanted 29"):
        G1Link((), g1_ends.MOTORS[:27], interface="lo", mode_machines=(5,))
    with pytest.raises(ConfigurationError, match="mode_machine of a G1; got 7"):
        G1Robot((), g1_ends.MOTORS, mode_machine=7)
    monkeypatch.setitem(sys.modules, "unitree_interface", None)
    with pytest.raises(MissingExtraError, match=r"3\.12.*far-unitree-sdk.*poise\[g1\]"):
        make()


def test_an_sdk_that_is_not_known_is_refused(monkeypatch):
    pytest.importorskip("unitree_interface")
    with pytest.raises(UnknownNameError, match="eth77.*choices:.* lo"):
        make(interface="eth77")
    monkeypatch.setattr("importlib.metadata.version", lambda name: "0.1.9")
    with pytest.raises(ConfigurationError, match=r"far-unitree-sdk.*0\.1\.9.*0\.1\.8"):
        make()


def test_without_its_controller_a_robot_is_damped_within_20_ms(tag):
    with (
        process(g1_ends.stand, tag) as (robot, _),
        process(g1_ends.command, tag, real_time()) as (pipe, controller),
    ):
        link = pipe.recv()
        time.sleep(0.3)
        end = time.monotonic()
        os.kill(controller.pid, signal.SIGKILL)
        time.sleep(0.4)
        assert alive(link)  # It lingers.
        lines = lines_of(robot)
        while alive(link) and time.monotonic() < end + 5.0:
            time.sleep(0.01)
        assert not alive(link)
    before = lines[(lines[:, 0] > end - 0.1) & (lines[:, 0] < end)]
    assert np.all(before[:, 1:] == [20.0, 1.0, 0.25])
    # Without a priority another process may delay the link's.
    after = lines[lines[:, 0] > end + (0.02 if real_time() else 0.3)]
    assert len(after) > 50
    assert np.all(after[:, 1:] == [0.0, 2.0, 0.0])


def checksum(words):
    """CRC-32 of 32-bit words, the most significant bit first, by division in GF(2)."""
    remainder = 0xFFFFFFFF
    for word in words:
        remainder ^= word
        for _ in range(32):
            remainder = (remainder << 1) ^ (0x104C11DB7 if remainder & 0x80000000 else 0)
    return remainder


def payloads(packet):
    """Serialised data of an RTPS message: those of its submessages DATA."""
    at = packet.find(b"RTPS") + 20
    while 20 <= at <= len(packet) - 4:
        kind, _, size = struct.unpack_from("<BBH", packet, at)
        if kind == 0x15:
            (skipped,) = struct.unpack_from("<H", packet, at + 6)
            yield packet[at + 8 + skipped + 4 : at + 4 + size]
        at += 4 + size if size else len(packet)


def capture(matches, tick, seconds=5.0):
    """The first payload on the loopback interface that matches, with a call for each message."""
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(3)) as listener:
        listener.bind(("lo", 0))
        listener.settimeout(seconds)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            tick()
            for payload in payloads(listener.recv(1 << 16)):
                if matches(payload):
                    return payload
    return None


@pytest.mark.skipif(
    not hasattr(socket, "AF_PACKET") or os.geteuid() != 0, reason="packet sockets are for root"
)
def test_a_message_has_the_checksum_and_modes_that_a_g1_wants(tag):
    mark = float(np.float32(0.1 + os.getpid() * 1e-7))

    def is_ours(payload):
        return len(payload) == LOWCMD_CDR.size and LOWCMD_CDR.unpack(payload)[3] == mark

    with process(g1_ends.stand, tag):
        link = ProcessLink(g1_ends.link_to(tag), g1_ends.check(), linger=0.0)
        joints, q = np.arange(29.0), np.zeros(29)
        q[g1_ends.JOINTS[29].index("motor0")], q[0] = mark, 1e300  # joint 0 has no stiffness
        sent = MotorCommand(q=q, dq=joints / 100, kp=joints, kd=joints / 10, tau=-joints)
        payload = capture(is_ours, lambda: link.write(sent))
        link.close()
    assert payload is not None
    numbers = LOWCMD_CDR.unpack(payload)
    memory = LOWCMD.pack(*numbers)
    assert len(memory) == 1004
    *words, crc = struct.unpack("<251I", memory)
    assert crc == checksum(words)
    assert numbers[:2] == (0, g1_ends.MODE)  # mode_pr, mode_machine
    slots = np.array(numbers[2:-5]).reshape(35, 7)
    q = np.clip(q, None, np.finfo(np.float32).max)
    fields = np.column_stack([q, sent.dq, sent.tau, sent.kp, sent.kd])
    for name, row in zip(g1_ends.JOINTS[29], fields, strict=True):
        slot = slots[g1_ends.MOTORS.index(name)]
        assert slot.tolist() == [1.0, *np.float32(row), 0.0]
    assert not slots[29:].any()
    assert not any(numbers[-5:-1])


def test_each_robot_has_a_number_of_its_own():
    assert len(set(MODE_MACHINES.values())) == len(MODE_MACHINES)
    assert MODE_MACHINES["g1_29dof_rev_1_0"] == g1_ends.MODE
