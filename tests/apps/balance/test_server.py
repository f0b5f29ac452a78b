"""The balance service over ZeroMQ: messages of clients in, states out."""

import json
import time

import pytest
from balance_runs import DT

pytest.importorskip("mujoco")
pytest.importorskip("zmq", reason="the extra zmq is not installed: no pyzmq")

import zmq

from poise import Plant, rollout
from poise.apps.balance import BalanceLeader, BalanceServer
from poise.errors import ConfigurationError
from poise.sim import PlantConfig

ELBOW = "left_elbow_joint"


class Client:
    """Sockets of a client, and the service beside it."""

    def __init__(self, robot):
        self.server = BalanceServer(BalanceLeader(robot, dt=DT), port=0)
        context = zmq.Context.instance()
        self.push, self.sub = context.socket(zmq.PUSH), context.socket(zmq.SUB)
        self.push.connect(self.server.targets)
        self.sub.subscribe(b"")
        self.sub.connect(self.server.states)
        self.stamp = 0.0

    def send(self, message=None, **targets):
        """Send JSON, or bytes as they are."""
        self.stamp += 0.02
        data = json.dumps({"time": self.stamp, **targets}).encode() if message is None else message
        self.push.send(data)

    def close(self):
        self.push.close(linger=0)
        self.sub.close(linger=0)
        self.server.close()


@pytest.fixture
def client(get_robot):
    client = Client(get_robot("g1"))
    yield client
    client.close()


def ticks_until(client, done, seconds=30.0):
    """Run the service's loop until something is so."""
    leader = client.server.leader
    plant = Plant(leader.robot, PlantConfig(control_dt=DT))
    end = time.monotonic() + seconds
    for tick in rollout(plant, leader.controller(), leader):
        client.server.poll()
        client.server.publish(tick, fallen=plant.fallen)
        if done(tick):
            return
        assert time.monotonic() < end, leader.reason


def test_targets_arrive_and_the_state_has_what_the_robot_does(client):
    states = []

    def done(tick):
        if tick.index % 10 == 0:
            client.send(joints={ELBOW: 0.6})
        if client.sub.poll(0):
            states.append(client.sub.recv_json())
        return bool(states) and states[-1]["joints"][ELBOW] < 0.7

    ticks_until(client, done)
    state = states[-1]
    assert (state["command"], state["fallen"], state["lost"]) == ("ok", False, False)
    assert (state["refused"], state["reason"]) == (0, "")
    assert set(state["joints"]) == set(client.server.leader.robot.joint_names)
    assert state["speeds"][ELBOW] < 0.0
    assert state["hands"]["left_hand"][1] > 0.1 > -0.1 > state["hands"]["right_hand"][1]
    assert state["nearest"] is None or state["nearest"][2] > -0.02


@pytest.mark.parametrize(
    ("message", "fault"),
    [
        (b"\xff", "no message of targets"),
        (b"[" * 5000, "no message of targets"),
        (b'{"time": NaN}', "no message of targets"),
        (b'{"time": 1.0, "joints": {"left_elbow_joint": "far"}}', "joints"),
        (b'{"time": 1.0, "feet": []}', "feet"),
        (b'{"time": 1.0, "joints": {"elbow": 0.5}}', "no such joint"),
        (b'{"time": 1.0, "velocity": [1e300, 0, 0]}', "at most 100"),
    ],
)
def test_a_bad_message_is_counted_and_answered_by_the_state(client, message, fault):
    states = []

    def done(tick):
        if tick.index % 10 == 0:
            client.send(message)
        if client.sub.poll(0):
            states.append(client.sub.recv_json())
        return bool(states) and states[-1]["refused"] > 0

    ticks_until(client, done)
    assert fault in states[-1]["reason"]
    assert states[-1]["command"] == "ok"


def test_of_waiting_messages_the_newest_counts(client):
    for angle in (1.1, 0.9, 0.5):
        client.send(joints={ELBOW: angle})
    time.sleep(0.3)
    client.server.poll()
    leader = client.server.leader
    assert leader.news is not None
    assert leader.news.joints == {ELBOW: 0.5}


def test_a_port_that_is_taken_is_named(client):
    port = int(client.server.targets.rsplit(":", 1)[1])
    with pytest.raises(ConfigurationError, match=str(port)):
        BalanceServer(client.server.leader, port=port)


def test_the_loop_runs_a_body_to_its_end(client):
    plant = Plant(client.server.leader.robot, PlantConfig(control_dt=DT))
    began = time.monotonic()
    client.server.run(plant, duration=0.1, paced=True)
    assert plant.time == pytest.approx(0.1)
    assert time.monotonic() - began > 0.09
