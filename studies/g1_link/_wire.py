"""`wire`: commands of a G1 at the robot's end of the bus, and the checksum of a message."""

import itertools
import multiprocessing
import os
import socket
import struct
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.apps.deployment import simulate_g1
from poise.hardware import (
    G1Link,
    MotorCommand,
    MotorState,
)
from poise.robots import JointOrder, Robot, load_robot
from studies.finding import Finding, Section
from studies.g1_link._bus import FIELDS
from studies.plan import Progress, StudyOptions

_COUNT, _QUICK = 1000, 100
"""Commands, and with `--quick`."""

_PATIENCE = 60.0
"""Longest wait for the processes [s]: they import a robot each."""

_MEMORY = struct.Struct("<2B2x" + "B3x5fI" * 35 + "5I")
"""Memory of a command, over which its sender computes the checksum."""

_MESSAGE = struct.Struct("<2B" + "Bx5fI" + "B3x5fI" * 34 + "5I")
"""The same as it is sent, where padding is for the next field alone."""

_MARK = float(np.float32(0.123456))
"""Position of the first motor in the message that is captured [rad]."""

_NUMBER = itertools.count()


def random_commands(count: int, joints: int) -> Iterator[MotorCommand]:
    """Return commands of numbers that no float32 has."""
    rng = np.random.default_rng(2)
    for _ in range(count):
        q, dq, tau = rng.normal(size=(3, joints))
        kp, kd = rng.uniform(1.0, 100.0, size=(2, joints))
        yield MotorCommand(q=q, dq=dq, kp=kp, kd=kd, tau=tau)


def be_robot(pipe: Connection, tag: str, count: int) -> None:
    """Publish a state until each command has come; return all as they came."""
    robot = load_robot("g1")
    end, got = simulate_g1(robot, tag=tag), list[np.ndarray]()
    state = _at_rest(robot)
    while len(got) < count and not pipe.poll():
        end.publish(state)
        command = end.read()
        if end.received > len(got):
            got.append(_numbers(command))
            pipe.send(len(got))
        time.sleep(1e-4)
    pipe.send(np.array(got))


def be_link(pipe: Connection, tag: str, count: int) -> None:
    """Send a command whenever the last one has come."""
    link = _open(tag)
    pipe.send("open")
    for command in random_commands(count, len(link.info.joints)):
        link.write(command)
        pipe.recv()
    link.close()


def send_mark(pipe: Connection, tag: str) -> None:
    """Send one command until a request to stop."""
    link = _open(tag)
    robot = load_robot("g1")
    link.write(marked(robot))
    pipe.send("open")
    pipe.recv()
    link.close()


def marked(robot: Robot) -> MotorCommand:
    """Return a command with another number for each joint."""
    order, joints = JointOrder.unitree_dds("g1").names, np.arange(float(robot.nj))
    q = np.zeros(robot.nj)
    q[robot.joint_names.index(order[0])] = _MARK
    return MotorCommand(q=q, dq=joints / 100, kp=joints, kd=joints / 10, tau=-joints)


def _open(tag: str) -> G1Link:
    modes = (5,)  # g1_29dof_rev_1_0
    motors = JointOrder.unitree_dds("g1").names
    names = load_robot("g1").joint_names
    return G1Link(names, motors, mode_machines=modes, interface="lo", tag=tag, timeout=_PATIENCE)


def _at_rest(robot: Robot) -> MotorState:
    still = np.zeros(robot.nj)
    return MotorState(
        time=0.0,
        arrived=0.0,
        q=robot.q_home[-robot.nj :],
        dq=still,
        tau=still,
        temperature=still,
        quaternion=np.array([0.0, 0.0, 0.0, 1.0]),
        gyro=np.zeros(3),
        acceleration=np.array([0.0, 0.0, 9.81]),
        wrenches=np.zeros((0, 6)),
    )


def _numbers(command: MotorCommand) -> Float64[np.ndarray, " n"]:
    return np.concatenate([getattr(command, name) for name in FIELDS])


@contextmanager
def process(main: Callable[..., None], *arguments: Any) -> Generator[Connection]:
    """Run a function in a process of its own; the context is the pipe to it."""
    spawn = multiprocessing.get_context("spawn")
    near, far = spawn.Pipe()
    made = spawn.Process(target=main, args=(far, *arguments))
    made.start()
    far.close()
    try:
        yield near
    finally:
        made.kill()
        made.join()


def new_tag() -> str:
    """Return a tag that no other run has."""
    return f"study{os.getpid()}x{next(_NUMBER)}"


def differing_commands(count: int, progress: Progress) -> int:
    """Send random commands; return how many did not arrive as the same float32 numbers."""
    tag, arrived = new_tag(), 0
    with process(be_robot, tag, count) as robot, process(be_link, tag, count) as link:
        assert link.recv() == "open"
        while arrived < count and robot.poll(_PATIENCE):
            arrived = robot.recv()
            link.send(arrived)
            progress(float(arrived), float(count))
        got = robot.recv() if robot.poll(_PATIENCE) else np.zeros((0, 0))
    sent = [_numbers(c) for c in random_commands(count, load_robot("g1").nj)]
    pairs = zip(sent, got, strict=False)
    same = (np.array_equal(a.astype(np.float32), b.astype(np.float32)) for a, b in pairs)
    return count - sum(same)


def checksum(words: list[int]) -> int:
    """Return CRC-32 of 32-bit words, the most significant bit first, by division in GF(2)."""
    remainder = 0xFFFFFFFF
    for word in words:
        remainder ^= word
        for _ in range(32):
            remainder = (remainder << 1) ^ (0x104C11DB7 if remainder & 0x80000000 else 0)
    return remainder


def payloads(packet: bytes) -> Iterator[bytes]:
    """Return the serialised data of an RTPS message: those of its submessages DATA."""
    at = packet.find(b"RTPS") + 20
    while 20 <= at <= len(packet) - 4:
        kind, _, size = struct.unpack_from("<BBH", packet, at)
        if kind == 0x15:
            (skipped,) = struct.unpack_from("<H", packet, at + 6)
            yield packet[at + 8 + skipped + 4 : at + 4 + size]
        at += 4 + size if size else len(packet)


def captured_message() -> tuple[Any, ...] | None:
    """Return the numbers of a message as on the network; None without one."""

    def wanted(payload: bytes) -> bool:
        return len(payload) == _MESSAGE.size and _MESSAGE.unpack(payload)[3] == _MARK

    tag = new_tag()
    with (
        process(be_robot, tag, 10**6),
        process(send_mark, tag) as link,
        socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(3)) as listener,
    ):
        listener.bind(("lo", 0))
        listener.settimeout(1.0)
        assert link.recv() == "open"
        end = time.monotonic() + 5.0  # 2,500 periods of the message
        while time.monotonic() < end:
            for payload in payloads(listener.recv(1 << 16)):
                if wanted(payload):
                    return _MESSAGE.unpack(payload)
    return None


def wrong_slots(numbers: tuple[Any, ...]) -> int:
    """Return the number of motors whose set-points in a message are not those of `marked`."""
    robot = load_robot("g1")
    sent, motors = marked(robot), JointOrder.unitree_dds("g1").names
    slots = np.array(numbers[2:-5]).reshape(35, 7)
    fields = np.column_stack([sent.q, sent.dq, sent.tau, sent.kp, sent.kd])
    wanted = np.zeros((35, 7))
    for name, row in zip(robot.joint_names, fields, strict=True):
        wanted[motors.index(name)] = [1.0, *row.astype(np.float32), 0.0]
    return int(np.any(slots != wanted, axis=1).sum())


def wire_section(options: StudyOptions, progress: Progress) -> Section:
    """Send random commands over the loopback interface, and capture a message."""
    prose = (
        "Random commands of all 29 joints of a G1 go from `G1Link` to the robot's end of the bus, "
        "in a process each, over DDS on the loopback interface. One message is captured from the "
        "network, and its checksum computed by polynomial division.",
    )
    if find_spec("unitree_interface") is None:
        return Section(prose=(*prose, "Left out: far-unitree-sdk is not installed."))
    count = _QUICK if options.quick else _COUNT
    differing = differing_commands(count, progress)
    findings = [
        Finding(
            name="commands that do not arrive as the same float32 numbers",
            ours=differing,
            paper=0,
            ok=differing == 0,
            note=f"of {count}",
        )
    ]
    try:
        numbers = captured_message()
    except PermissionError:
        return Section(
            prose=(*prose, "No message is captured: packet sockets are for root."),
            findings=tuple(findings),
        )
    if numbers is not None:
        *words, crc = struct.unpack("<251I", _MEMORY.pack(*numbers))
        differs, slots = int(crc != checksum(words)), wrong_slots(numbers)
    else:
        differs, slots = 1, 35
    findings += [
        Finding(
            name="captured messages with another checksum than CRC-32 by division",
            ours=differs,
            paper=0,
            ok=differs == 0,
            note="of 1" if numbers is not None else "none was captured",
        ),
        Finding(
            name="motors in it with other set-points than were sent",
            ours=slots,
            paper=0,
            ok=slots == 0,
            note="of 35",
        ),
    ]
    return Section(prose=prose, findings=tuple(findings))
