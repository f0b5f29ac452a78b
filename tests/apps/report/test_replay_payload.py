import base64
import json

import numpy as np
from synthetic_run import walking_record

from poise.apps.report import Geometry, Replay
from poise.apps.report._replay import replay_json


def array(text, kind):
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def payload_of(record, replay=None):
    return json.loads(replay_json(record, replay or record.replay))


def test_poses_come_back_as_they_went_in():
    record = walking_record()
    data, replay = payload_of(record), record.replay
    np.testing.assert_allclose(array(data["time"], "<f4"), replay.time, atol=1e-6)
    position = array(data["position"], "<f4").reshape(replay.position.shape)
    np.testing.assert_allclose(position, replay.position, atol=1e-6)
    turned = array(data["quaternion"], "<i2").reshape(replay.quaternion.shape) / 32767
    np.testing.assert_allclose(turned, replay.quaternion, atol=2e-5)


def test_a_mesh_comes_back_to_a_fraction_of_a_millimetre_and_is_stored_once():
    rng = np.random.default_rng(0)
    vertices = rng.uniform(-0.3, 0.5, size=(500, 3))
    faces = rng.integers(0, 500, size=(900, 3))
    mesh = Geometry(body=0, shape="mesh", vertices=vertices, faces=faces)
    replay = Replay(
        time=np.zeros(1),
        position=np.zeros((1, 1, 3)),
        quaternion=np.array([[[0.0, 0.0, 0.0, 1.0]]]),
        geometries=(mesh, mesh),
    )
    data = payload_of(walking_record(duration=1.0), replay)
    assert len(data["meshes"]) == 1
    assert [g["mesh"] for g in data["geometries"]] == [0, 0]
    packed = data["meshes"][0]
    points = array(packed["vertices"], "<u2").reshape(-1, 3) * packed["step"] + packed["low"]
    np.testing.assert_allclose(points, vertices, atol=2e-5)
    np.testing.assert_array_equal(array(packed["faces"], "<u2").reshape(-1, 3), faces)


def test_no_text_can_close_the_script():
    from poise.apps.report import Event

    record = walking_record(duration=1.0, events=(Event(time=0.5, label="</script><b>"),))
    text = replay_json(record, record.replay)
    assert "<" not in text
    assert json.loads(text)["events"][0]["label"] == "</script><b>"
