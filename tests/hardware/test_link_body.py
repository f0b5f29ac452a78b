"""The body of a rollout behind a link: posture, ramps, hold, stop, and the wait for states."""

import numpy as np
import pytest

import poise
from poise.control import Command, CommandStatus
from poise.errors import ConfigurationError
from poise.hardware import (
    RULES,
    WARM,
    Action,
    LastCheck,
    LinkBody,
    LinkInfo,
    LinkStatus,
    MotorState,
    Rule,
    TorqueSplit,
    Trouble,
    Watchdog,
)

DT, RAMP = 0.01, 0.3


class Bus:
    """A link whose time passes by commands, to joints that take each target immediately."""

    def __init__(self, joints, q):
        self.info = LinkInfo(name="bus", rate=1.0 / DT, joints=joints)
        self.status, self.refused, self.reason = LinkStatus.OK, 0, ""
        self.time, self.q, self.written = 0.0, np.array(q), []

    def clock(self):
        return self.time

    def read(self):
        still = np.zeros(len(self.q))
        return MotorState(
            time=self.time,
            arrived=self.time,
            q=self.q,
            dq=still,
            tau=still,
            temperature=still,
            quaternion=np.array([0.0, 0.0, 0.0, 1.0]),
            gyro=np.zeros(3),
            acceleration=np.array([0.0, 0.0, 9.81]),
            wrenches=np.zeros((0, 6)),
        )

    def write(self, command):
        self.written.append(command)
        self.q = np.where(command.kp > 0.0, command.q, self.q)
        self.time += DT

    def close(self):
        self.status = LinkStatus.LOST


@pytest.fixture(scope="module")
def robot(get_robot):
    return get_robot("biped20")


def make(robot, offset=0.1, **settings):
    home = robot.q_home[-robot.nj :]
    bus = Bus(robot.joint_names, home + offset)
    check = LastCheck(robot, kp_max=200.0, kd_max=20.0)
    split = TorqueSplit(check, kp=10.0, kd=1.0, period=DT)
    known = {"kp": 100.0, "kd": 5.0, "ramp": RAMP, "stand": RAMP}
    return bus, check, LinkBody(robot, bus, check, split, **known | settings)


def torque(robot, value=5.0):
    """A command of a controller."""
    return Command(CommandStatus.OK, np.full(robot.nj, value))


def run(body, robot, until):
    """Step to a time."""
    while body.time < until - 0.5 * DT and not body.fallen:
        body.state()
        body.step(torque(robot))


def test_the_first_state_brings_the_robot_into_its_posture_without_a_jump(robot):
    bus, check, body = make(robot)
    home = np.clip(robot.q_home[-robot.nj :], check.lower, check.upper)
    state = body.state()
    assert state.time == body.time == 0.0
    moved = np.array([command.q for command in bus.written])
    assert np.abs(moved[0] - np.clip(home + 0.1, check.lower, check.upper)).max() < 1e-12
    assert np.abs(moved[-1] - home).max() < 1e-12
    assert np.abs(np.diff(moved, axis=0)).max() <= 0.1 * 15 / 8 * DT / RAMP * 1.01
    assert not any(command.tau.any() for command in bus.written)
    assert len(bus.written) == round(2 * RAMP / DT) + 1


def test_a_robot_stays_in_its_posture_until_it_is_ready(robot):
    looks = []
    bus, _, body = make(robot, ready=lambda: looks.append(1) or len(looks) > 50)
    body.state()
    assert len(looks) == 51
    assert bus.written[-1].kp.tolist() == [100.0] * robot.nj


def test_the_controller_takes_over_by_a_ramp_and_the_ramp_out_fades_to_damping(robot):
    bus, check, body = make(robot)
    body.state()
    first = len(bus.written)
    run(body, robot, WARM + RAMP + 0.1)
    taus = np.array([command.tau[0] for command in bus.written[first:]])
    kps = np.array([command.kp[0] for command in bus.written[first:]])
    warm = round(WARM / DT)
    assert not taus[:warm].any()
    assert np.all(np.diff(taus[warm:]) >= 0.0)
    assert taus[-1] == 5.0
    assert kps[0] == 100.0
    assert kps[-1] == 10.0
    assert np.abs(np.diff(taus)).max() <= 5.0 * 15 / 8 * DT / RAMP * 1.01
    body.end()
    run(body, robot, 10.0)
    assert body.fallen
    last = bus.written[-1]
    assert np.abs(last.tau).max() < 0.05
    assert last.kd == pytest.approx(check.damping.kd, rel=0.01)


class Counting:
    """A leader that counts its calls."""

    def __init__(self, robot):
        self.stack, self.led, self.paused = poise.default_stack(robot), 0, 0

    def lead(self, state):
        self.led += 1

    def pause(self, state):
        self.paused += 1


def test_a_leader_begins_after_the_ramp_and_is_paused_on_hold(robot):
    rules = [*RULES, Rule(trouble=Trouble.OPERATOR, limit=0.1, response=Action.HOLD)]
    heard = {"at": None}
    watchdog = Watchdog(robot, period=DT, rules=rules)
    _, _, body = make(robot, watchdog=watchdog, operator=lambda: heard["at"])
    leader = Counting(robot)
    held = body.follow(leader)
    assert held.signals() == {}

    def tick():
        held.lead(body.state())
        body.step(torque(robot))

    while body.time < body.begin - 0.5 * DT:
        tick()
    assert leader.led == leader.paused == 0
    for _ in range(5):
        tick()
    assert leader.led == 5
    heard["at"] = body.link.clock() - 1.0
    for _ in range(5):
        tick()
    assert body.held
    assert (leader.led, leader.paused) == (6, 4)
    heard["at"] = None
    tick()
    tick()
    assert leader.led == 7


def test_an_emergency_stop_damps_and_a_lost_link_gets_nothing(robot):
    bus, check, body = make(robot, posture=False, ramp=0.0)
    run(body, robot, 0.1)
    body.watchdog.stop()
    body.state()
    body.step(torque(robot))
    assert body.fallen
    assert body.verdict.trouble is Trouble.STOP_BUTTON
    assert bus.written[-1] is check.damping
    assert body.sent is None

    bus, _, body = make(robot, posture=False, ramp=0.0)
    run(body, robot, 0.1)
    sent = len(bus.written)
    bus.status = LinkStatus.LOST
    body.step(torque(robot))
    assert body.verdict.response is Action.STOP
    assert len(bus.written) == sent


def test_what_was_received_and_sent_is_recorded(robot):
    bus, _, body = make(robot, posture=False, ramp=0.0)
    state = body.state()
    body.step(torque(robot))
    signals = body.signals()
    assert signals["received/q"].tolist() == state.q[-robot.nj :].tolist()
    assert signals["sent/tau"] is bus.written[-1].tau
    assert signals["watchdog"].startswith("RUN")


def test_a_link_to_another_robot_is_refused(robot):
    bus = Bus(("hip", "knee"), np.zeros(2))
    check = LastCheck(robot, kp_max=200.0, kd_max=20.0)
    with pytest.raises(ConfigurationError, match="other joints"):
        LinkBody(robot, bus, check)
