"""The page in a real browser with the robot behind it."""

import re
import time

import pytest
from operators import comes, listen_to, same_commands, wait_for

pytest.importorskip("websockets", reason="the extra teleop is not installed: no websockets")

from pages import Page

from poise.apps.teleoperation import MODES, read_recording, replay_teleop
from poise.locomotion import Mode


def test_who_has_read_the_page_alone_makes_a_step_within_a_minute_and_a_replay_is_the_same(
    browser, run_session, tmp_path, monkeypatch
):
    # Where a busy machine stops for a moment, a key that is held would have to be let go first.
    monkeypatch.setattr("poise.locomotion._stepping._guard.LOST_AFTER", 10.0)
    with run_session(tmp_path / "takes") as session:
        loop = session.loop
        wait_for(lambda: loop.snapshot or loop.error, "the first picture")
        heard = listen_to(loop)
        with Page(browser, session.front.drive_url) as page:
            page.wait("view !== null && newest.device !== 'LOST'", "the device")
            begin, first = loop.snapshot.time, loop.snapshot.soles[0][0]
            told = " ".join(page.ask("part('hint').innerText").split())
            key = re.search(r"Hold (\w), then", told)[1].lower()
            assert "arrow keys" in told
            page.page.keyboard.down(key)
            wait_for(lambda: loop.snapshot.mode is Mode.SR, "the lift")
            page.page.keyboard.down("ArrowUp")
            wait_for(lambda: loop.snapshot.soles[0][0] > first + 0.05, "the way")
            page.page.keyboard.up("ArrowUp")
            page.page.keyboard.up(key)
            wait_for(lambda: loop.snapshot.mode is Mode.D, "the landing")
            assert loop.snapshot.time - begin < 60.0
            page.wait("part('hint').hidden", "the hint to go")
            assert page.ask("past.length") > 10
            assert page.text("margin").endswith(" cm")
            assert page.text("latency").endswith(" ms")
            assert page.ask("view.stage.groups[1].position.z") > 0.0
            assert page.errors == []
        assert not loop.snapshot.fallen
        loop.stop()
    run = replay_teleop(read_recording(tmp_path / "takes" / "take-001.mcap"))
    assert set(run.log.mode.tolist()) >= {MODES.index(m) for m in (Mode.D, Mode.TR, Mode.SR)}
    assert same_commands(run, heard)


@pytest.mark.slow
def test_a_tab_that_sleeps_in_mid_step_lands_and_leads_only_after_letting_go(
    browser, run_session, tmp_path
):
    with run_session(tmp_path / "takes") as session:
        loop = session.loop
        wait_for(lambda: loop.snapshot or loop.error, "the first picture")
        with Page(browser, session.front.drive_url) as page:
            page.wait("newest.device !== 'LOST'", "the device")
            page.page.keyboard.down("e")
            wait_for(lambda: loop.snapshot.soles[1][2] > 0.04, "the lift")
            sleep = "const end = performance.now() + 3000; while (performance.now() < end);"
            page.ask(f"setTimeout(() => {{ {sleep} }}); 0")
            wait_for(lambda: loop.snapshot.device.name == "LOST", "the loss")
            wait_for(lambda: loop.snapshot.mode is Mode.D, "both feet on the ground")
            wait_for(lambda: loop.snapshot.device.name != "LOST", "its waking")
            now = loop.snapshot.time
            # The key was never let go, and says nothing any more.
            assert not comes(lambda: loop.snapshot.mode is not Mode.D, 1.0)
            assert loop.snapshot.time > now
            page.page.keyboard.up("e")
            time.sleep(0.2)
            page.page.keyboard.down("e")
            wait_for(lambda: loop.snapshot.mode is Mode.SL, "the lift anew")
        wait_for(lambda: loop.snapshot.mode is Mode.D, "the foot of a page that is gone")
        assert not loop.snapshot.fallen
