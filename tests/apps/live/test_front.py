"""The way in, tried by clients that are no browser and know the protocol."""

import json
import time
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

pytest.importorskip("viser")

from operators import answer, beat, control, drag, drawing, wait_for
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from poise.apps.live._front import PortInUseError
from poise.apps.live._scene import SECRET_HEADER
from poise.errors import PoiseError
from poise.locomotion import DeviceStatus, Mode


@pytest.fixture(scope="module")
def session(run_session, tmp_path_factory):
    with run_session(tmp_path_factory.mktemp("takes")) as session:
        wait_for(lambda: session.loop.snapshot, "the first picture")
        yield session


@pytest.fixture
def front(session):
    """With nobody in the operator's seat, and a robot that stands there."""
    wait_for(lambda: not session.front.seat.taken, "an empty seat")
    wait_for(lambda: session.loop.snapshot.device is DeviceStatus.LOST, "the guard")
    return session.front


def get(front, path, **headers):
    """Status and text of a page."""
    request = Request(f"http://127.0.0.1:{front.port}{path}", headers=headers)
    try:
        with urlopen(request, timeout=60) as response:
            return response.status, response.read().decode()
    except HTTPError as error:
        with error:
            return error.code, error.read().decode()


def test_the_page_says_how_to_step_and_holds_no_token(front):
    status, text = get(front, "/")
    assert status == 200
    assert "Make the robot step" in text
    assert front.seat.token not in text


def test_the_drawing_is_visers_own_page(front):
    status, text = get(front, "/view")
    assert status == 200
    assert "viser" in text.lower()


@pytest.mark.parametrize("path", ["/nothing", "/takes/../../etc/passwd", "/view/x"])
def test_there_is_nothing_else(front, path):
    assert get(front, path)[0] in (403, 404)


def test_recordings_are_for_who_has_the_token(front, session):
    name = session.takes.path.name
    assert get(front, f"/takes/{name}")[0] == 403
    assert get(front, f"/takes/{name}?token=wrong")[0] == 403
    assert get(front, f"/takes/..%2f..%2fetc%2fpasswd?token={front.seat.token}")[0] == 404


def test_a_foreign_host_name_is_refused(front):
    assert get(front, "/", Host="evil.example:8080")[0] == 403


@pytest.mark.parametrize("path", ["/", "/view"])
def test_a_page_of_another_origin_cannot_read_this_one(front, path):
    assert get(front, path, Origin="http://evil.example")[0] == 403


@pytest.mark.parametrize("channel", ["control", "scene"])
def test_a_page_of_another_origin_is_refused_even_with_the_token(front, channel):
    url = f"ws://127.0.0.1:{front.port}/{channel}?token={front.seat.token}"
    with pytest.raises(InvalidStatus) as refused:
        connect(url, proxy=None, origin="http://evil.example").close()
    assert refused.value.response.status_code == 403


def test_who_has_the_token_drives(front, session):
    with control(front, front.seat.token) as (operator, hello):
        assert hello["hello"] == "operator"
        before = session.loop.snapshot.time
        wait_for(
            lambda: beat(operator) or session.loop.snapshot.device is not DeviceStatus.LOST,
            "samples",
        )
        assert session.loop.snapshot.time > before
        operator.send(json.dumps({"do": "slow", "value": True}))
        wait_for(lambda: session.loop.snapshot.speed < 1.0, "slow motion")
        operator.send(json.dumps({"do": "slow", "value": False}))
        wait_for(lambda: session.loop.snapshot.speed == 1.0, "real time")


@pytest.mark.parametrize("token", [None, "wrong"])
def test_who_has_not_sees_but_cannot_command(front, session, token):
    with control(front, token) as (watcher, hello):
        assert hello["hello"] == "watcher"
        assert hello["key"] is None
        assert ("wrong" in hello["reason"]) is (token is not None)
        status = json.loads(watcher.recv(timeout=60))
        assert status["mode"] == "D"
        for message in (
            {"beat": 1.0, "lift": [False, True]},
            {"do": "pause", "value": True},
            {"do": "push", "value": "left"},
            {"do": "reset"},
        ):
            watcher.send(json.dumps(message))
            assert "watching" in answer(watcher)["error"]
        time.sleep(0.3)
        now = session.loop.snapshot
        assert now.device is DeviceStatus.LOST
        assert (now.paused, now.mode) == (False, Mode.D)


def test_a_second_operator_is_told_and_watches(front, session):
    with control(front, front.seat.token), control(front, front.seat.token) as (second, hello):
        assert hello["hello"] == "watcher"
        assert "Somebody else is driving" in hello["reason"]
        second.send(json.dumps({"do": "pause", "value": True}))
        assert "watching" in answer(second)["error"]
        assert not session.loop.snapshot.paused


def test_when_the_operator_leaves_the_seat_is_free(front):
    with control(front, front.seat.token):
        pass
    wait_for(lambda: not front.seat.taken, "an empty seat")
    with control(front, front.seat.token) as (_, hello):
        assert hello["hello"] == "operator"


@pytest.mark.parametrize("key", [None, "", "wrong", "the token"])
def test_handles_move_nothing_without_the_key(front, session, key):
    key = front.seat.token if key == "the token" else key
    with control(front, front.seat.token) as (operator, _), drawing(front, key) as scene:
        drag(scene, "DragStart")
        for _ in range(10):
            beat(operator)
            drag(scene, "Update", position=[0.0, -0.13, 0.4], wxyz=[1.0, 0.0, 0.0, 0.0])
            time.sleep(0.03)
        assert session.inputs.read().drag == (None, None)
        assert session.loop.snapshot.mode is Mode.D


def test_a_key_dies_with_its_operator(front, session):
    with control(front, front.seat.token) as (_, hello):
        key = hello["key"]
    wait_for(lambda: not front.seat.taken, "an empty seat")
    with control(front, front.seat.token) as (operator, _), drawing(front, key) as scene:
        beat(operator)
        drag(scene, "DragStart")
        drag(scene, "Update", position=[0.0, -0.13, 0.4], wxyz=[1.0, 0.0, 0.0, 0.0])
        time.sleep(0.2)
        beat(operator)
        assert session.inputs.read().drag == (None, None)


def test_the_operators_handle_lifts_the_foot_and_a_drawing_that_goes_lets_go(front, session):
    with control(front, front.seat.token) as (operator, hello):
        with drawing(front, hello["key"]) as scene:
            drag(scene, "DragStart")
            place = [0.0, float(session.loop.snapshot.soles[1][1]), 0.2]

            def lifted():
                beat(operator)
                drag(scene, "Update", position=place, wxyz=[1.0, 0.0, 0.0, 0.0])
                now = session.loop.snapshot
                return now.mode is Mode.SL and now.soles[1][2] > 0.05

            wait_for(lifted, "the lift")
        wait_for(
            lambda: beat(operator) or session.loop.snapshot.mode is Mode.D, "the foot to come down"
        )


@pytest.mark.parametrize(
    "text",
    [
        "no json",
        "[]",
        "null",
        '{"beat": 1, "lift": [true], "move": [0, 0]}',
        '{"beat": 1, "lift": [true, true], "move": [NaN, 0]}',
        '{"beat": 1, "lift": [true, true], "move": [1e9, 0]}',
        '{"beat": 1, "lift": [true, true], "move": ["a", 0]}',
        '{"do": "push", "value": "up"}',
        '{"do": "push", "value": ["left"]}',
        '{"do": "pause", "value": 1}',
        '{"do": "fly"}',
        "{}",
        "[" * 20000,
    ],
)
def test_nonsense_of_an_operator_gets_an_answer_and_moves_nothing(front, session, text):
    with control(front, front.seat.token) as (operator, _):
        operator.send(text)
        assert answer(operator)["error"]
        assert session.loop.running
        assert session.loop.snapshot.mode is Mode.D


@pytest.mark.parametrize("position", [None, [0.0, 0.0], [float("nan")] * 3, [1e9, 0.0, 0.0], "abc"])
def test_a_handle_that_is_nowhere_is_not_followed(front, session, position):
    with (
        control(front, front.seat.token) as (operator, hello),
        drawing(front, hello["key"]) as scene,
    ):
        beat(operator)
        drag(scene, "DragStart")
        drag(scene, "Update", position=position, wxyz=[1.0, 0.0, 0.0, 0.0])
        drag(scene, "Update", name="/hands/third", position=[0.0, 0.0, 0.1])
        scene.send(b"\xff no message")
        scene.send("text")
        time.sleep(0.2)
        beat(operator)
        assert session.inputs.read().drag == (None, None)
        assert session.loop.running


def test_messages_beyond_all_measure_end_the_connection(front):
    with control(front, front.seat.token) as (operator, _):
        operator.send("x" * 100_000)
        with pytest.raises(ConnectionClosed):
            answer(operator)


def test_nobody_gets_past_the_front_to_the_drawing_behind_it(session):
    url = f"ws://127.0.0.1:{session.scene.port}/"
    for headers in ({}, {SECRET_HEADER: "wrong"}):
        with connect(
            url, proxy=None, subprotocols=["viser-v1.1.1"], additional_headers=headers
        ) as intruder:
            with pytest.raises(ConnectionClosed) as closed:
                intruder.recv(timeout=60)
            assert closed.value.rcvd.code == 1008


def test_viser_gets_neither_share_requests_nor_anything_else_from_a_page(front, session):
    # viser would open a tunnel to the internet for whoever asks.
    import msgspec

    for kind in ("ShareUrlRequest", "GuiUpdateMessage", "SceneNodeClickMessage"):
        data = msgspec.msgpack.encode({"type": kind})
        with control(front, front.seat.token) as (_, hello):
            assert not front._may_pass(data, hello["key"])
        wait_for(lambda: not front.seat.taken, "an empty seat")


def test_a_port_in_use_is_said(run_session, front, tmp_path):
    with (
        pytest.raises(PortInUseError, match=f"port {front.port}"),
        run_session(tmp_path, port=front.port),
    ):
        pass


def test_what_lies_on_the_floor_is_drawn_where_it_is(live, get_robot, monkeypatch):
    from dataclasses import replace

    from poise.apps.live._scene import Scene
    from poise.apps.teleoperation import TELEOP_PLANT, terrain_blocks
    from poise.sim import Plant

    robot, drawn = get_robot("biped20"), []
    blocks = terrain_blocks("steps", robot)
    draw = Scene._draw_shape

    def note(self, name, shape):
        drawn.append((name, shape))
        draw(self, name, shape)

    monkeypatch.setattr(Scene, "_draw_shape", note)
    scene = Scene(Plant(robot, replace(TELEOP_PLANT, blocks=blocks)))
    scene.stop()
    still = [shape for name, shape in drawn if name.startswith("/robot/0/")]
    assert [shape.shape for shape in still] == ["box"] * len(blocks)
    for shape, block in zip(still, blocks, strict=True):
        assert shape.position == pytest.approx([*block.center, 0.5 * block.size[2]])
        assert shape.size == pytest.approx([0.5 * side for side in block.size])


def test_another_viser_is_refused_with_its_name(live, session, monkeypatch):
    from poise.apps.live import _scene as scene

    class OtherServer:
        def __init__(self, **_):
            pass

        def stop(self):
            pass

    monkeypatch.setattr(scene.viser, "ViserServer", OtherServer)
    with pytest.raises(PoiseError, match="version of viser"):
        scene.Scene(session.loop.plant)


def test_many_watchers_do_not_slow_the_robot_down(front, session):
    from contextlib import ExitStack

    with ExitStack() as stack:
        for _ in range(20):
            stack.enter_context(control(front))
        begin, first = time.monotonic(), session.loop.snapshot.time
        time.sleep(1.0)
        assert session.loop.snapshot.time > first
        assert time.monotonic() - begin < 10.0
