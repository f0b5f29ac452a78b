"""The robot against the clock: orders, recordings, and what is left when it ends."""

import time
from dataclasses import replace

import numpy as np
import pytest
from msgspec.structs import replace as replace_sample
from operators import listen_to, same_commands, wait_for
from slow import slow

pytest.importorskip("websockets")
pytest.importorskip("mujoco")

from poise.apps.live._inputs import OperatorInputs
from poise.apps.live._leads import FootLead
from poise.apps.live._log import Takes
from poise.apps.live._loop import LiveLoop, Pause, PushOrder, Reset, Slow
from poise.apps.teleoperation import (
    TORQUE_TELEOP_PLANT,
    VELOCITY_TELEOP_PLANT,
    read_recording,
    replay_teleop,
    run_teleop,
)
from poise.errors import ConfigurationError
from poise.locomotion import (
    BodyCommand,
    DeviceStatus,
    HandStatus,
    Mode,
    OperatorSample,
    ScriptedDevice,
    StepEnd,
    StepTeleoperator,
    TrackedPose,
    teleop_parameters,
)
from poise.robots import standing_posture
from poise.sim import PlantConfig

REST = OperatorSample()
LIFT = OperatorSample(lift=(False, True))


def test_a_step_and_its_recording_gives_the_same_commands_again(start, tmp_path):
    loop = start(plant=VELOCITY_TELEOP_PLANT.with_noise(), seed=5)
    loop.until(lambda s: s.time > 0.5, "some time", REST)
    loop.order(Reset())
    loop.until(lambda s: s.time < 0.5, "the reset")
    heard = listen_to(loop)
    loop.until(lambda s: s.mode is Mode.SL and s.soles[1][2] > 0.05, "the lift", LIFT)
    loop.order(PushOrder("left"))
    loop.until(lambda s: s.mode is Mode.D, "double support", REST)
    loop.stop()
    assert loop.takes.files == ["take-001.mcap", "take-002.mcap"]
    path = tmp_path / "takes" / "take-002.mcap"
    run = replay_teleop(path)
    assert same_commands(run, heard)
    assert len(read_recording(path).pushes) == 1
    # It drives in place of a person, too.
    again = start(plant=VELOCITY_TELEOP_PLANT.with_noise(), recording=read_recording(path))
    heard, skipped = listen_to(again), round(again.plant.time / again.plant.control_dt)
    again.until(lambda s: s.mode is Mode.SL, "the step")
    again.until(lambda s: s.mode is Mode.D, "its end")
    rest = run.log.command[skipped:]
    assert np.array_equal(heard[: len(rest)], rest[: len(heard)])


def test_a_step_that_came_to_nothing_says_why_until_the_next_one(start):
    loop = start()
    assert loop.snapshot.mode_text == Mode.D.value
    loop.until(lambda s: s.mode is Mode.TL, "the shift", LIFT)
    assert loop.snapshot.mode_text == Mode.TL.value
    loop.until(lambda s: s.mode is Mode.D, "double support", REST)
    assert loop.snapshot.mode_text == StepEnd.LOWERED.value
    assert loop.snapshot.landings == 0
    loop.until(lambda s: s.mode is Mode.SL, "the lift", LIFT)
    loop.until(lambda s: s.mode is Mode.D, "double support", REST)
    assert loop.snapshot.mode_text == Mode.D.value


@pytest.mark.parametrize("name", ["biped20", slow("g1")])
def test_each_foot_makes_a_step_forward_and_silence_brings_one_down(start, name):
    loop = start(name=name)
    for foot, standing in ((1, Mode.SL), (0, Mode.SR)):
        lift = OperatorSample(lift=(foot == 0, foot == 1))
        goal = loop.snapshot.soles[foot][0] + 0.08
        loop.until(lambda s, m=standing: s.mode is m, "the lift", lift)
        forward = replace_sample(lift, move=(1.0, 0.0))
        loop.until(lambda s, f=foot, x=goal: s.soles[f][0] > x, "the way", forward)
        loop.until(lambda s: s.mode is Mode.D, "double support", REST)
        assert loop.snapshot.soles[foot][2] == pytest.approx(0.0, abs=5e-3)
        assert loop.snapshot.landings == 2 - foot
    loop.until(lambda s: s.soles[1][2] > 0.05, "the lift", LIFT)
    loop.until(lambda s: s.device is DeviceStatus.LOST, "the loss to show")
    loop.until(lambda s: s.mode is Mode.D, "both feet on the ground")
    assert not loop.snapshot.fallen


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize(
    "plant", [TORQUE_TELEOP_PLANT, VELOCITY_TELEOP_PLANT], ids=["torque", "velocity"]
)
@pytest.mark.parametrize("name", ["biped20", "g1"])
def test_a_hand_is_led_let_go_and_goes_back_to_rest(start, name, plant):
    loop = start(name=name, plant=plant)
    home = loop.snapshot.hands[0].copy()

    def led(z, clutch=True):
        return OperatorSample(hands=(TrackedPose((0.0, 0.0, z), clutch=clutch), None))

    loop.until(lambda s: s.device is DeviceStatus.OK, "a sample", led(0.0, clutch=False))
    loop.until(lambda s: s.hands_do[0] is HandStatus.LED, "the grip", led(0.0))
    loop.until(lambda s: s.hands[0][2] > home[2] + 0.13, "the way", led(0.15))
    held = led(0.0, clutch=False)
    loop.until(lambda s: s.hands_do[0] is HandStatus.HELD, "the hold", held)
    assert loop.snapshot.hands[0][2] > home[2] + 0.13
    assert loop.snapshot.hands_do[1] is HandStatus.REST
    rest = replace_sample(held, rest=True)
    loop.until(lambda s: s.hands[0][2] < home[2] + 0.02, "the rest", rest)
    assert not loop.snapshot.fallen


def test_pause_stops_time_and_slow_motion_slows_it(get_robot, tmp_path):
    lead = FootLead(get_robot("biped20"), OperatorInputs(), VELOCITY_TELEOP_PLANT)
    loop = LiveLoop(lead, Takes(tmp_path / "takes"))
    loop.start()
    wait_for(lambda: loop.snapshot, "the first picture")
    loop.order(Pause(True))
    wait_for(lambda: loop.snapshot.paused, "the pause")
    before = loop.plant.time
    time.sleep(0.1)
    assert loop.plant.time == before
    loop.order(Slow(True))
    loop.order(Pause(False))
    wait_for(lambda: loop.plant.time > before, "time to go on")
    begin, first = time.monotonic(), loop.plant.time
    wait_for(lambda: loop.plant.time > first + 0.1, "a tenth of a second")
    last, now = loop.plant.time, time.monotonic()
    # Where it was late, it does not catch up by more than a tenth of a second.
    assert (last - first) <= 0.25 * (now - begin + 0.1) + 2 * loop.plant.control_dt
    assert 0.0 <= loop.snapshot.real_time_factor < 1.5

    def fail(command):
        raise RuntimeError("the plant broke")

    # An error ends it, and is kept.
    loop.plant.step = fail
    wait_for(lambda: not loop.running, "the end")
    assert str(loop.error) == "the plant broke"
    loop.stop()
    # Nobody drove.
    assert loop.takes.files == []


def recorded(robot, path, plant=VELOCITY_TELEOP_PLANT, **changes):
    """A short run of commands to stay, recorded."""
    still = ScriptedDevice([], *StepTeleoperator(robot, actuation="velocity").estimator.anchors)
    return run_teleop(robot, still, plant, duration=0.1, recording=path, **changes)


def test_a_recording_is_played_with_the_parameters_and_the_noise_that_it_was_made_with(
    start, get_robot, tmp_path
):
    robot, path = get_robot("biped20"), tmp_path / "made.mcap"
    parameters = replace(teleop_parameters(robot, "velocity"), hand_scale=1.7, lower_speed=0.2)
    plant = VELOCITY_TELEOP_PLANT.with_noise()
    made = recorded(robot, path, plant, parameters=parameters, rotator=False, seed=7)
    loop = LiveLoop(
        FootLead(robot, OperatorInputs(), plant, recording=read_recording(path)), Takes(tmp_path)
    )
    assert loop.lead.leader.parameters == parameters
    heard = listen_to(loop)
    for turn in range(20):
        loop.turn(float(turn))
    loop.stop()
    np.testing.assert_array_equal(heard, made.log.command)
    # One that begins elsewhere than at home drives from there.
    lower = standing_posture(robot, feet_apart=0.4, com_height=0.72)
    recorded(robot, tmp_path / "low.mcap", q_start=lower, rotator=False)
    loop = start(recording=read_recording(tmp_path / "low.mcap"))
    assert loop.lead.leader.parameters == teleop_parameters(robot, "velocity")
    loop.until(lambda s: s.device is DeviceStatus.OK, "both feet to be led")


@pytest.mark.parametrize(
    ("name", "plant", "words"),
    [
        ("arm6", VELOCITY_TELEOP_PLANT, "cannot walk on two feet"),
        ("biped20", PlantConfig(), "different control periods"),
    ],
)
def test_a_robot_without_feet_and_a_plant_with_another_tick_are_refused(
    get_robot, name, plant, words
):
    with pytest.raises(ConfigurationError, match=words):
        FootLead(get_robot(name), OperatorInputs(), plant)


def test_the_margin_in_double_support_is_that_of_both_feet(start, get_robot):
    loop = start()
    soles = list(get_robot("biped20").soles.values())
    polygon, feet = loop.snapshot.polygon, loop.snapshot.soles
    assert np.ptp(polygon[:, 0]) == pytest.approx(soles[0].length, abs=1e-3)
    apart = feet[0][1] - feet[1][1]
    assert np.ptp(polygon[:, 1]) == pytest.approx(apart + soles[0].width, abs=1e-3)


def test_where_hands_are_dragged_along_is_where_the_torso_faces(start):
    """By the page, which tells how far a handle has moved as the torso faces."""
    loop = start(name="g1", plant=TORQUE_TELEOP_PLANT)
    turned = OperatorSample(body=BodyCommand(torso=(0.0, 0.0, 0.4)))
    loop.until(lambda s: s.heading > 0.3, "the torso that turns", turned)
    site = loop.plant.data.site(loop.lead.robot.torso).xmat.reshape(3, 3)
    assert loop.snapshot.heading == pytest.approx(np.arctan2(site[1, 0], site[0, 0]), abs=0.1)
