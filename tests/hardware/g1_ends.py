"""The two ends of a G1's topics, in processes of their own, for the tests beside."""

import time
from functools import partial
from types import SimpleNamespace

import numpy as np

from poise.hardware import G1Link, G1Robot, LastCheck, MotorCommand, MotorState, ProcessLink
from poise.hardware._g1_mode import Channel, Request, Response
from poise.hardware._g1_sdk import open_sdk, silence

MODE = 5
MOTORS = tuple(f"motor{k}" for k in range(29))
JOINTS = {29: (*MOTORS[14:], *MOTORS[:14]), 23: (*MOTORS[15:20], *MOTORS[22:27], *MOTORS[:13])}
"""Joints in another order than the motors, of robots with all motors and without six."""


def random_states(count, joints):
    """States of float32 numbers, which the messages keep."""
    rng = np.random.default_rng(1)
    for _ in range(count):
        q, dq, tau = np.float64(np.float32(rng.normal(size=(3, joints))))
        yield MotorState(
            time=0.0,
            arrived=0.0,
            q=q,
            dq=dq,
            tau=tau,
            temperature=rng.integers(20, 90, joints).astype(np.float64),
            quaternion=np.float64(np.float32(rng.normal(size=4))),
            gyro=np.float64(np.float32(rng.normal(size=3))),
            acceleration=np.float64(np.float32(rng.normal(size=3))),
            wrenches=np.zeros((0, 6)),
        )


def random_commands(count, joints):
    rng = np.random.default_rng(2)
    for _ in range(count):
        q, dq, tau = rng.normal(size=(3, joints))
        kp, kd = rng.uniform(1.0, 100.0, size=(2, joints))
        yield MotorCommand(q=q, dq=dq, kp=kp, kd=kd, tau=tau)


def numbers_of(record):
    """Array of a state or a command without its times."""
    names = [n for n in vars(record) if n not in ("time", "arrived", "wrenches")]
    return np.concatenate([getattr(record, name) for name in names])


def link_to(tag, joints=JOINTS[29], mode_machines=(MODE,), **settings):
    return partial(
        *(G1Link, joints, MOTORS),
        **{"interface": "lo", "tag": tag, "mode_machines": mode_machines} | settings,
    )


def check():
    ones = np.ones(29)
    limits = SimpleNamespace(
        joint_names=JOINTS[29],
        q_min=-3.0 * ones,
        q_max=3.0 * ones,
        v_max=ones,
        tau_max=100.0 * ones,
    )
    return LastCheck(limits, kp_max=100.0, kd_max=50.0, damping=2.0)


def answer(pipe, tag, joints, count):
    """A robot that publishes one state after another, each until the next command has come."""
    robot, got = G1Robot(JOINTS[joints], MOTORS, mode_machine=MODE, tag=tag), []
    for state in random_states(count, joints):
        while robot.received == len(got):
            robot.publish(state)
            time.sleep(0.0001)
            command = robot.read()
        got.append(numbers_of(command))
    pipe.send(got)


def ask(pipe, tag, joints, count):
    """A link that writes one command after another, each when the next state has come."""
    link, got, last = link_to(tag, JOINTS[joints])(), [], (np.inf, np.inf)
    for command in random_commands(count, joints):
        # Motors and inertial unit of a state come one after the other.
        while (state := link.read()).q[0] == last[0] or state.gyro[0] == last[1]:
            time.sleep(0.0001)
        got.append(numbers_of(state))
        last = state.q[0], state.gyro[0]
        link.write(command)
    link.close()
    pipe.send(got)


def stand(pipe, tag, mode_machine=MODE):
    """A robot at rest, which lists the commands that act on it until a request for them."""
    robot = G1Robot(JOINTS[29], MOTORS, mode_machine=mode_machine, tag=tag)
    still = np.zeros(29)
    state = MotorState(
        time=0.0,
        arrived=0.0,
        q=still,
        dq=still,
        tau=np.full(29, np.nan),
        temperature=np.full(29, np.nan),
        quaternion=np.array([0.0, 0.0, 0.0, 1.0]),
        gyro=np.zeros(3),
        acceleration=np.array([0.0, 0.0, 9.81]),
        wrenches=np.zeros((0, 6)),
    )
    lines = []
    while not pipe.poll():
        robot.publish(state)
        command = robot.read()
        lines.append((time.monotonic(), command.kp.max(), command.kd.max(), command.q.max()))
        time.sleep(0.001)
    pipe.send(np.array(lines))


def hold(pipe, tag):
    """A controller that closes its link when it is asked to, and stays."""
    link = link_to(tag)()
    link.write(check().damping)
    pipe.send(link.status)
    pipe.recv()
    link.close()
    link.write(check().damping)
    pipe.send(link.status)
    pipe.recv()


def command(pipe, tag, priority):
    """A controller, until its end."""
    link = ProcessLink(link_to(tag), check(), linger=0.5, priority=priority)
    target, still = np.full(29, 0.25), np.zeros(29)
    pipe.send(link.pid)
    while True:
        link.write(MotorCommand(q=target, dq=still, kp=still + 20.0, kd=still + 1.0, tau=still))
        time.sleep(0.002)


def walk(pipe, tag):
    """A robot that commands its motors until its motion mode is released."""
    sdk, robot = open_sdk("lo", tag)
    state, command, mode = sdk.LowState(29), sdk.MotorCommand(29), b"ai"
    state.mode_machine, command.kp = MODE, [50.0] * 29
    imu = state.imu
    imu.quat = [1.0, 0.0, 0.0, 0.0]
    robot.write_low_command(command)
    service, (_, states) = Channel(sdk, Response, Request), open_sdk("lo", tag)
    while True:
        states.publish_low_state(state)
        request = service.take()
        if request is not None and request.api == 1003:
            silence(sdk)
            mode, robot = b"", None
        if request is not None:
            text = b'{"form":"0","name":"%s"}' % mode if request.api == 1001 else b""
            service.write(Response(id=request.id, api=request.api, text=text))
        time.sleep(0.002)


def two_robots(pipe, tag):
    """A process that wants to be two robots."""
    first = G1Robot(JOINTS[29], MOTORS, mode_machine=MODE, tag=tag)
    try:
        G1Robot(JOINTS[29], MOTORS, mode_machine=MODE, tag=tag + "b")
    except Exception as error:
        pipe.send((type(error).__name__, str(error), first.received))
