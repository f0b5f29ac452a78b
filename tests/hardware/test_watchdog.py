"""Each trouble of the table, by its number, and the response to it."""

import os
import signal
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import links
import numpy as np
import pytest

import poise
from poise.errors import ConfigurationError
from poise.hardware import RULES, Action, LinkInfo, LinkStatus, Rule, Trouble, Watchdog

T = 0.002
OK = poise.Command(poise.CommandStatus.OK, np.zeros(3))


def pitched(angle):
    return np.array([0.0, np.sin(0.5 * angle), 0.0, np.cos(0.5 * angle)])


class Robot(SimpleNamespace):
    """A link whose clock and measurements a test sets."""

    def __init__(self):
        super().__init__(now=0.0, status=LinkStatus.OK, refused=0, reason="", age=0.0)
        self.info, self.fields = LinkInfo(name="none", rate=500.0, joints=links.JOINTS), {}

    def clock(self):
        return self.now

    def read(self):
        stamp = self.now - self.age
        return links.state(**{"time": stamp, "arrived": stamp} | self.fields)

    def write(self, command): ...
    def close(self): ...


class Loop:
    """A control loop with a watchdog."""

    def __init__(self, **settings):
        self.link, self.watchdog = Robot(), Watchdog(links.LIMITS, **settings)

    def tick(self, count=1, *, command=OK, after=T, **more):
        for _ in range(count):
            self.link.now += after
            verdict = self.watchdog.evaluate(self.link, self.link.read(), command, **more)
        return verdict


@pytest.fixture
def loop():
    made = Loop()
    assert made.tick(100).response is Action.RUN
    return made


def test_every_trouble_stands_in_the_table():
    assert {rule.trouble for rule in RULES} == set(Trouble)


def test_the_page_has_every_trouble():
    page = Path(__file__).parents[2] / "docs" / "hardware.md"
    text = page.read_text(encoding="utf-8")
    assert [t.value for t in Trouble if t.value not in text] == []


@pytest.mark.parametrize(
    ("fields", "trouble", "response"),
    [
        ({"q": np.array([np.nan, 1.0, 0.0])}, Trouble.BAD_STATE, Action.DAMP),
        ({"gyro": np.array([0.0, 0.0, np.inf])}, Trouble.BAD_STATE, Action.DAMP),
        (
            {"quaternion": np.array([0.0, np.sin(0.6), 0.0, np.cos(0.6)])},
            Trouble.FALL,
            Action.DAMP,
        ),
        ({"q": np.array([0.999, 1.0, 0.0])}, Trouble.JOINT_STOP, Action.HOLD),
        ({"q": np.array([0.0, 0.001, 0.0])}, Trouble.JOINT_STOP, Action.HOLD),
        ({"temperature": np.array([np.nan, 81.0, 20.0])}, Trouble.HEAT, Action.DAMP),
    ],
)
def test_troubles_of_the_state(loop, fields, trouble, response):
    loop.link.fields = fields
    verdict = loop.tick()
    assert (verdict.trouble, verdict.response) == (trouble, response)
    assert verdict.reason.startswith(f"{trouble.value}: ")


def test_what_is_not_measured_is_no_trouble(loop):
    nothing = np.full(3, np.nan)
    loop.link.fields = {"temperature": nothing, "tau": nothing}
    assert loop.tick(10).response is Action.RUN


def test_yaw_and_a_bow_are_no_fall(loop):
    for turn in (np.array([0.0, 0.0, 1.0, 0.0]), pitched(0.8)):
        loop.link.fields = {"quaternion": turn}
        assert loop.tick().response is Action.RUN


def test_late_states(loop):
    loop.link.age = 0.009
    assert loop.tick().trouble is Trouble.GAP  # by a stamp that went back
    assert loop.tick(3).response is Action.RUN
    loop.link.age = 0.011
    assert loop.tick().trouble is Trouble.LATE_STATE


def test_a_slow_link_has_longer_periods():
    slow = Loop(period=0.01)
    slow.link.info = LinkInfo(name="slow", rate=100.0, joints=links.JOINTS)
    slow.link.age = 0.012
    assert slow.tick(20, after=0.01).response is Action.RUN
    slow.link.age = 0.06
    assert slow.tick(20, after=0.01).trouble is Trouble.LATE_STATE


def test_gaps_hold_for_one_tick(loop):
    loop.link.age = 0.006
    loop.tick(4)
    loop.link.age = 0.0
    assert loop.tick().trouble is Trouble.GAP
    assert loop.tick().response is Action.RUN


def test_one_late_tick_is_none_and_two_are_trouble(loop):
    wide = Loop(rules=[r for r in RULES if r.trouble is not Trouble.GAP])
    wide.tick(10)
    assert wide.tick(after=0.0045).response is Action.RUN
    assert wide.tick(10).response is Action.RUN
    wide.tick(after=0.0045)
    assert wide.tick(after=0.0045).trouble is Trouble.LATE_TICK


def test_a_solver_without_answer(loop):
    failed = poise.Command(poise.CommandStatus.SOLVER_FAILED, np.zeros(3))
    assert loop.tick(24, command=failed).response is Action.RUN
    assert loop.tick(command=OK).response is Action.RUN
    assert loop.tick(26, command=failed).trouble is Trouble.NO_ANSWER


def test_a_fall_that_the_controller_reports(loop):
    fallen = poise.Command(poise.CommandStatus.FALLEN, np.zeros(3))
    assert loop.tick(command=fallen).trouble is Trouble.FALL


def test_a_refused_command(loop):
    loop.link.refused += 1
    assert loop.tick().trouble is Trouble.REFUSED


def test_an_operator_who_comes_back(loop):
    sample = loop.link.now
    assert loop.tick(240, operator=sample).response is Action.RUN
    assert loop.tick(20, operator=sample).trouble is Trouble.OPERATOR
    assert loop.tick(operator=loop.link.now).response is Action.RUN


@pytest.mark.parametrize(
    ("kind", "trouble"), [(signal.SIGINT, Trouble.INTERRUPT), (signal.SIGTERM, Trouble.KILL)]
)
def test_signals(loop, kind, trouble):
    before = signal.getsignal(kind)
    with loop.watchdog.signals():
        assert loop.tick().response is Action.RUN
        os.kill(os.getpid(), kind)
        assert loop.tick().trouble is trouble
    assert signal.getsignal(kind) is before


def test_a_lost_link_stops_even_what_is_damped(loop):
    loop.link.fields = {"temperature": np.full(3, 90.0)}
    assert loop.tick().response is Action.DAMP
    loop.link.fields = {}
    assert loop.tick().trouble is Trouble.HEAT, "it stays"
    loop.link.status = LinkStatus.LOST
    assert loop.tick().response is Action.STOP
    loop.link.status = LinkStatus.OK
    loop.watchdog.reset()
    assert loop.tick().response is Action.RUN


def test_the_table_is_data():
    warm = Rule(trouble=Trouble.HEAT, limit=60.0, response=Action.HOLD)
    loop = Loop(rules=[*RULES, warm])
    loop.link.fields = {"temperature": np.full(3, 70.0)}
    assert loop.tick().response is Action.HOLD
    loop.link.fields = {"temperature": np.full(3, 85.0)}
    assert loop.tick().response is Action.DAMP


def test_settings_that_cannot_be_are_refused():
    with pytest.raises(ConfigurationError, match="period"):
        Watchdog(links.LIMITS, period=0.0)
    with pytest.raises(ConfigurationError, match="limit"):
        replace(RULES[0], limit=float("nan"))
