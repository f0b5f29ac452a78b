"""An operator leads a robot behind a link: begin, emergency stop, and what such a robot refuses."""

import json
import time

import numpy as np
import pytest

from poise.apps.deployment import LinkedPlant
from poise.apps.live import LiveSession
from poise.hardware import LastCheck, LinkBody, PlantLink, TorqueSplit, Trouble
from poise.sim import Plant, PlantConfig, read_log


class Paced(PlantLink):
    """A simulated robot whose periods last as long as they say."""

    def write(self, command):
        super().write(command)
        time.sleep(0.001)


@pytest.fixture(scope="module")
def session(get_robot, tmp_path_factory):
    robot = get_robot("humanoid20")
    plant = Plant(robot, PlantConfig(control_dt=0.002))
    check = LastCheck(robot, kp_max=robot.tau_max, kd_max=robot.tau_max / robot.v_max)
    split = TorqueSplit(check, kp=0.0, kd=0.0)

    def connect(config):
        body = LinkBody(robot, Paced(plant), check, split, ramp=0.0, stand=0.0)
        return LinkedPlant(body, config)

    folder = tmp_path_factory.mktemp("linked")
    with LiveSession(robot, folder, by="velocity", connect=connect) as made:
        yield made


def wait_for(condition, seconds=20.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_robot_behind_a_link_is_led_until_its_operator_stops_it(session):
    wait_for(lambda: session.loop.snapshot is not None and session.loop.plant.time > 0.5)
    status = session.status()
    assert status["linked"]
    assert status["stopped"] == ""
    for order in ({"do": "push", "value": "left"}, {"do": "pause", "value": True}, {"do": "reset"}):
        answer = session.order(json.dumps(order))
        assert answer == {"error": "Not on a robot behind a link."}
    session.order(json.dumps({"do": "stop"}))
    wait_for(lambda: session.loop.plant.fallen)
    assert session.loop.plant.body.verdict.trouble is Trouble.STOP_BUTTON
    wait_for(lambda: session.status()["stopped"].startswith("emergency stop"))
    session.loop.stop()
    record = read_log(session.takes.path)
    assert record.complete
    assert np.isfinite(record["received/q"]).all()
