"""The way in, tried by clients that are no browser and know the protocol."""

import json
import os
import re
import socket
import time
from dataclasses import replace
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import pytest

pytest.importorskip("websockets")

from operators import answer, beat, control, wait_for
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from poise.apps.live import _seat as seats
from poise.apps.live._front import PortInUseError
from poise.apps.teleoperation import read_recording
from poise.locomotion import DeviceStatus, Mode
from poise.locomotion._stepping import _guard as clocks

HELD = [None, {"position": [0.0, -0.13, 0.4]}]
"""The right handle, well above the ground [m]."""


def handles_rest(session):
    """The handles of the feet are on the feet."""
    now = session.loop.snapshot
    return np.abs(np.subtract(now.handles, now.soles)).max() < 0.02


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


def test_the_page_needs_nothing_from_elsewhere(front):
    _, page = get(front, "/")
    named = re.findall(r'(?:src|href)="([^"]+)"', page)
    assert {"page.css", "page.js", "scene.js", "three.bundle.min.js"} <= set(named)
    for name in named:
        assert name == "data:," or get(front, f"/{name}")[0] == 200


@pytest.mark.parametrize("path", ["/nothing", "/takes/../../etc/passwd", "/view/x", "/scene"])
def test_there_is_nothing_else(front, path):
    assert get(front, path)[0] in (403, 404)


def test_recordings_are_for_who_has_the_token(front, session):
    name = session.takes.path.name
    assert get(front, f"/takes/{name}")[0] == 403
    assert get(front, f"/takes/{name}?token=wrong")[0] == 403
    assert get(front, f"/takes/..%2f..%2fetc%2fpasswd?token={front.seat.token}")[0] == 404


def test_a_foreign_host_name_is_refused(front):
    assert get(front, "/", Host="evil.example:8080")[0] == 403


@pytest.mark.parametrize("path", ["/", "/page.js", "/shapes.json"])
def test_a_page_of_another_origin_cannot_read_this_one(front, path):
    assert get(front, path, Origin="http://evil.example")[0] == 403


def test_a_page_of_another_origin_is_refused_even_with_the_token(front):
    url = f"ws://127.0.0.1:{front.port}/control?token={front.seat.token}"
    with pytest.raises(InvalidStatus) as refused:
        connect(url, proxy=None, origin="http://evil.example").close()
    assert refused.value.response.status_code == 403
    assert not front.seat.taken


def test_there_is_no_other_channel(front):
    for path in ("/", "/scene", "/takes/x"):
        with pytest.raises(InvalidStatus):
            connect(f"ws://127.0.0.1:{front.port}{path}", proxy=None).close()


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


@pytest.mark.parametrize("token", [None, "wrong", "%C3%A9"])
def test_who_has_not_sees_but_cannot_command(front, session, token):
    with control(front, token) as (watcher, hello):
        assert hello["hello"] == "watcher"
        assert ("wrong" in hello["reason"]) is (token is not None)
        status = json.loads(watcher.recv(timeout=60))
        assert status["mode"] == "D"
        for message in (
            {"do": "drive", "lift": [False, True]},
            {"do": "drive", "feet": [None, {"position": [0.0, -0.13, 0.4]}]},
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


def test_every_message_is_answered_with_what_the_feet_feel(front, session):
    with control(front, front.seat.token) as (operator, _):
        for _ in range(5):
            beat(operator)
            told = answer(operator)
            left, right = told["forces"]
            weight = 9.81 * session.loop.lead.robot.mass
            assert left[2] + right[2] == pytest.approx(weight, rel=0.1)
            assert np.abs([*left[:2], *right[:2]]).max() < 0.2 * weight


def test_who_sends_what_does_not_count_is_told_why(front, monkeypatch):
    monkeypatch.setattr(clocks, "LOST_AFTER", 60.0)
    with control(front, front.seat.token) as (operator, _):
        for sent, told in (
            (2.0, {}),
            (1.99, {"old": 0.01}),
            (1.0, {"old": 1.0}),
            (9.0, {"early": 7.0}),
        ):
            operator.send(json.dumps({"do": "drive", "time": sent}))
            found = answer(operator)
            assert found.pop("echo") == sent
            assert found.pop("forces") is not None
            assert found == pytest.approx(told, abs=1.0 if "early" in told else 1e-9)


def test_when_the_operator_leaves_the_seat_is_free(front):
    with control(front, front.seat.token):
        pass
    wait_for(lambda: not front.seat.taken, "an empty seat")
    with control(front, front.seat.token) as (_, hello):
        assert hello["hello"] == "operator"


def test_whoever_comes_takes_the_seat_of_a_frozen_operator(front, session, monkeypatch):
    monkeypatch.setattr(seats, "SILENT_FOR", 0.5)
    with control(front, front.seat.token) as (frozen, _):
        place = {"position": [0.0, float(session.loop.snapshot.soles[1][1]), 0.14]}
        beat(frozen)
        wait_for(
            lambda: beat(frozen, feet=[None, place]) or session.loop.snapshot.mode is Mode.SL,
            "the lift",
        )
        time.sleep(1.0)
        with control(front, front.seat.token) as (second, hello):
            assert hello["hello"] == "operator"
            wait_for(lambda: session.loop.snapshot.mode is Mode.D, "the foot to come down")
            beat(second)
            # It wakes up: too late.
            beat(frozen, feet=[None, place])
            while "echo" in (told := answer(frozen)):
                pass
            assert told["hello"] == "watcher"
            assert "somebody else drives" in told["reason"]
            assert "watching" in answer(frozen)["error"]
            assert front.seat.taken
            assert handles_rest(session)


def test_pushes_do_not_pile_up(front, session):
    with control(front, front.seat.token) as (operator, _):
        # A recording begins with the first sample.
        wait_for(lambda: beat(operator) or session.takes.path.exists(), "the recording")
        pushed = len(push_rows(session))
        begin = session.loop.snapshot.time
        for _ in range(2000):
            operator.send('{"do": "push", "value": "forward"}')
        beat(operator)
        answer(operator)
        took = session.loop.snapshot.time - begin
        # Of those that came in this time, and of one that waits.
        # Where a busy machine takes long over them the robot may fall, and time stands still.
        now = lambda: session.loop.snapshot  # noqa: E731
        wait_for(lambda: now().time > begin + took + 1.0 or now().fallen, "the rest")
        assert 1 <= len(push_rows(session)) - pushed <= (took + 1.0) / 0.3 + 2
        operator.send('{"do": "reset"}')
        wait_for(lambda: session.loop.snapshot.time < begin, "the reset")


def push_rows(session):
    """What is recorded of pushes."""
    # The loop hands over four times a second.
    time.sleep(1.0)
    return read_recording(session.takes.path, allow_partial=True).pushes


def test_what_writes_files_is_not_done_as_often_as_it_is_asked_for(front, session):
    with control(front, front.seat.token) as (operator, _):
        beat(operator)
        answer(operator)
        for _ in range(20):
            operator.send('{"do": "keep"}')
        answers = [answer(operator) for _ in range(20)]
        assert sum("kept" in said for said in answers) < 10
        assert any("second" in said.get("error", "") for said in answers)


def test_a_copy_that_takes_long_silences_no_operator(front, session, monkeypatch):
    monkeypatch.setattr(clocks, "LOST_AFTER", 2.0)

    def copy():
        time.sleep(4.0)
        return Path("kept-001.mcap")

    monkeypatch.setattr(session.takes, "keep", copy)
    session._last.clear()
    with control(front, front.seat.token) as (operator, _):
        operator.send('{"do": "keep"}')
        begin, said = time.monotonic(), {}
        while "kept" not in said:
            beat(operator)
            said = answer(operator)
            assert session.inputs.read() is not None
            assert time.monotonic() < begin + 60.0
            time.sleep(0.03)
        assert said["kept"] == "kept-001.mcap"
        assert time.monotonic() - begin > 3.9


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("token", [None, "", "wrong", "the token"])
def test_handles_move_nothing_without_the_seat(front, session, token):
    token = front.seat.token if token == "the token" else token
    with control(front, front.seat.token) as (operator, _), control(front, token) as (other, _):
        for _ in range(10):
            beat(operator)
            beat(other, feet=[None, None])
            beat(other, feet=HELD)
            time.sleep(0.03)
        assert "watching" in answer(other)["error"]
        assert handles_rest(session)
        assert session.loop.snapshot.mode is Mode.D


def test_who_was_refused_does_not_inherit_the_seat(front, session):
    with (
        control(front, front.seat.token) as (first, _),
        control(front, front.seat.token) as (second, _),
    ):
        first.close()
        wait_for(lambda: not front.seat.taken, "an empty seat")
        with control(front, front.seat.token) as (operator, hello):
            assert hello["hello"] == "operator"
            beat(operator)
            beat(second)
            beat(second, feet=HELD)
            assert "watching" in answer(second)["error"]
            beat(operator)
            said = wait_for(session.inputs.read, "what the operator says")
            assert said.feet == (None, None)


def test_the_operators_handle_lifts_the_foot_and_a_page_that_goes_lets_go(front, session):
    with control(front, front.seat.token) as (operator, _):
        beat(operator)
        place = {"position": [0.0, float(session.loop.snapshot.soles[1][1]), 0.14]}

        def lifted():
            beat(operator, feet=[None, place])
            now = session.loop.snapshot
            return now.mode is Mode.SL and now.soles[1][2] > 0.05

        wait_for(lifted, "the lift")
    wait_for(lambda: session.loop.snapshot.mode is Mode.D, "the foot to come down")


def test_what_is_held_at_a_reset_leads_nothing_until_it_is_let_go(front, session):
    def lifts(held):
        beat(operator, lift=[False, held])
        return session.loop.snapshot.mode in (Mode.TL, Mode.SL)

    with control(front, front.seat.token) as (operator, _):
        beat(operator)
        wait_for(lambda: lifts(True), "the lift")
        before = session.loop.snapshot.time
        session._last.clear()
        operator.send('{"do": "reset"}')
        while session.loop.snapshot.time >= before:
            lifts(True)
            time.sleep(0.01)
        wait_for(lambda: lifts(True) or session.loop.snapshot.time > 1.0, "a second")
        # The key is still down.
        assert session.loop.snapshot.mode is Mode.D
        wait_for(lambda: lifts(False) or session.loop.snapshot.time > 1.2, "letting go")
        wait_for(lambda: lifts(True), "the lift anew")


def test_a_handle_that_is_let_go_brings_the_foot_down(front, session):
    with control(front, front.seat.token) as (operator, _):
        beat(operator)
        place = {"position": [0.0, float(session.loop.snapshot.soles[1][1]), 0.14]}
        wait_for(
            lambda: beat(operator, feet=[None, place]) or session.loop.snapshot.mode is Mode.SL,
            "the lift",
        )
        wait_for(
            lambda: beat(operator) or session.loop.snapshot.mode is Mode.D, "the foot to come down"
        )


@pytest.mark.parametrize(
    "text",
    [
        "no json",
        "[]",
        "null",
        '{"do": "drive", "lift": [true], "move": [0, 0]}',
        '{"do": "drive", "lift": [true, true], "move": [NaN, 0]}',
        '{"do": "drive", "lift": [true, true], "move": [1e9, 0]}',
        '{"do": "drive", "lift": [true, true], "move": ["a", 0]}',
        '{"do": "drive", "feet": [{"position": [0, 0], "clutch": true}, null]}',
        '{"do": "drive", "feet": [{"position": [0, 0, NaN]}, null]}',
        '{"do": "drive", "feet": [{"position": [0, 0, 1e999]}, null]}',
        '{"do": "drive", "feet": [{"position": [0, 0, 0], "clutch": 1}, null]}',
        '{"do": "drive", "feet": [null]}',
        '{"do": "drive", "head": {"orientation": [0, 0, 1], "clutch": true}}',
        '{"do": "drive", "head": {"orientation": [0, 0, NaN, 1]}}',
        '{"do": "drive", "second": [2, 0]}',
        '{"do": "drive", "hand": [null, null]}',
        '{"do": "drive", "feet": [{"position": [0, 0, 0], "cluch": true}, null]}',
        '{"do": "reset", "now": true}',
        '{"do": "push", "value": "up"}',
        '{"do": "push", "value": ["left"]}',
        '{"do": "pause", "value": 1}',
        '{"do": "fly"}',
        '{"lift": [true, true]}',
        "{}",
        "[" * 20000,
        '{"do": "drive", "more": ' + "[" * 30000 + "]" * 30000 + "}",
        b"\xff",
    ],
)
def test_nonsense_of_an_operator_gets_an_answer_and_moves_nothing(front, session, text):
    with control(front, front.seat.token) as (operator, _):
        operator.send(text)
        assert answer(operator)["error"]
        assert session.loop.running
        assert session.loop.snapshot.mode is Mode.D


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize(
    "place", [None, [0.0, 0.0], "abc", [None] * 3, [0.0, 0.0, True], ["0"] * 3]
)
def test_a_handle_that_is_nowhere_is_not_followed(front, session, place):
    with control(front, front.seat.token) as (operator, _):
        beat(operator)
        beat(operator, feet=[None, {"position": place}])
        beat(operator, feet=[None] * 2 + [{"position": [0.0, 0.0, 0.1]}])
        operator.send('{"do": "drive", "feet": [null, {"position": [NaN, NaN, NaN]}]}')
        time.sleep(0.2)
        assert handles_rest(session)
        assert session.loop.running


AWAY = {"position": [0.0, 1e300, 0.0], "clutch": True}
FAST = {"position": [0.0] * 3, "clutch": True, "velocity": [0.0, -1e300, 0.0]}
NO_TURN = {"position": [0.0] * 3, "clutch": True, "orientation": [0.0, 0.0, 1e300, 1.0]}


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize(
    ("member", "value"),
    [
        ("hands", AWAY), ("feet", AWAY), ("feet", {"position": [-1e308] * 3}), ("hands", FAST),
        ("feet", FAST), ("hands", NO_TURN), ("feet", NO_TURN),
        ("head", {"orientation": [0.0, 0.0, 9.0, 1.0], "clutch": True}),
    ],
)  # fmt: skip
def test_what_is_out_of_reach_does_not_cost_the_rest_of_its_message(front, session, member, value):
    opened = {**value, "clutch": False}
    with control(front, front.seat.token) as (operator, _):
        for one, handle in ((opened, None), (value, HELD[1])):
            sent = {"feet": [None, handle], member: one}
            if member != "head":
                sent[member] = [one, handle if member == "feet" else None]
            beat(operator, **sent)
            assert answer(operator).keys() == {"echo", "forces"}
        wait_for(
            lambda: beat(operator, **sent) or session.loop.snapshot.handles[1][2] > 0.02,
            "the handle",
        )
        assert session.loop.running
        assert np.isfinite(session.loop.snapshot.handles).all()


def test_messages_beyond_all_measure_end_the_connection(front):
    with control(front, front.seat.token) as (operator, _):
        operator.send("x" * 100_000)
        with pytest.raises(ConnectionClosed):
            answer(operator)


def test_nothing_listens_but_the_front(session):
    """Nobody gets past it to a drawing behind it, or from another machine."""
    tables = [Path(f"/proc/self/net/{kind}") for kind in ("tcp", "tcp6")]
    if not tables[0].exists():
        pytest.skip("no list of sockets on this system")
    own = {os.readlink(link) for link in Path("/proc/self/fd").iterdir() if link.is_symlink()}
    rows = [row.split() for table in tables for row in table.read_text().splitlines()[1:]]
    listening = [row[1] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in own]
    assert listening == [f"0100007F:{session.front.port:04X}"]


def test_nobody_can_embed_the_page_or_load_anything_into_it(front):
    with urlopen(front.watch_url, timeout=60) as response:
        policy = response.headers["Content-Security-Policy"]
        assert response.headers["Referrer-Policy"] == "no-referrer"
    assert "default-src 'self'" in policy
    assert "frame-ancestors 'none'" in policy
    # These have no default.
    assert "base-uri 'none'" in policy
    assert "form-action 'none'" in policy


def test_a_port_in_use_is_said(run_session, front, tmp_path):
    with (
        pytest.raises(PortInUseError, match=f"port {front.port}"),
        run_session(tmp_path, port=front.port),
    ):
        pass


def test_what_lies_on_the_floor_is_drawn_where_it_is(run_session, get_robot, tmp_path):
    from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, terrain_blocks

    blocks = terrain_blocks("steps", get_robot("biped20"))
    with run_session(tmp_path, plant=replace(VELOCITY_TELEOP_PLANT, blocks=blocks)) as session:
        shapes = json.loads(get(session.front, "/shapes.json")[1])
    still = [shape for shape in shapes["geometries"] if shape["body"] == 0]
    assert [shape["shape"] for shape in still] == ["box"] * len(blocks)
    for shape, block in zip(still, blocks, strict=True):
        assert shape["position"] == pytest.approx([*block.center, 0.5 * block.size[2]])
        assert shape["size"] == pytest.approx([0.5 * side for side in block.size])


def test_every_body_is_shown_where_the_simulator_has_it(front, session):
    # A foot that was led before may still come down, and a picture is a moment old.
    moving = lambda: np.abs(session.loop.plant.data.qvel).max()  # noqa: E731
    wait_for(lambda: moving() < 0.05, "the robot to stand still")
    with control(front) as (watcher, _):
        status = json.loads(watcher.recv(timeout=60))
    data = session.loop.plant.data
    shown = np.reshape(status["bodies"], (-1, 3))
    np.testing.assert_allclose(shown, data.xpos, atol=5e-3)
    turns = np.reshape(status["turns"], (-1, 4))
    np.testing.assert_allclose(np.abs(np.sum(turns * data.xquat, axis=1)), 1.0, atol=1e-3)


def test_many_watchers_do_not_slow_the_robot_down(front, session):
    from contextlib import ExitStack

    with ExitStack() as stack:
        for _ in range(20):
            stack.enter_context(control(front))
        begin, first = time.monotonic(), session.loop.snapshot.time
        time.sleep(1.0)
        assert session.loop.snapshot.time > first
        assert time.monotonic() - begin < 10.0


def test_a_page_that_does_not_keep_up_holds_up_nobody(front):
    url = f"ws://127.0.0.1:{front.port}/control"
    # It does not even say goodbye, which nobody is to wait for.
    late = connect(url, proxy=None, max_queue=1, close_timeout=0.1)
    with late, control(front) as (watcher, _):
        time.sleep(2.0)
        begin = time.monotonic()
        newest = [json.loads(watcher.recv(timeout=60)) for _ in range(60)][-1]
        assert newest["mode"] == "D"
        assert time.monotonic() - begin < 30.0


@pytest.mark.parametrize(
    "lines", ["GET //[ HTTP/1.1\r\n", "GET / HTTP/1.1\r\nOrigin: a\r\nOrigin: b\r\n"]
)
def test_what_no_browser_asks_is_refused_without_a_traceback(front, lines, capfd, caplog):
    with socket.create_connection(("127.0.0.1", front.port), timeout=60) as caller:
        caller.sendall(f"{lines}Host: 127.0.0.1:{front.port}\r\n\r\n".encode())
        assert b" 400 " in caller.recv(4096).split(b"\r\n")[0]
    assert "Traceback" not in capfd.readouterr().err + caplog.text
