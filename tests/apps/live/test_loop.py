"""The robot against the clock: orders, recordings, and what is left when it ends."""

import time
from dataclasses import replace

import numpy as np
import pytest
from msgspec.structs import replace as replace_sample
from operators import drive, listen_to, same_commands, wait_for
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
    RecordingError,
    read_recording,
    replay_teleop,
    run_teleop,
    terrain_blocks,
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


def test_a_step_and_its_recording_gives_the_same_commands_again(start, tmp_path):
    loop = start(plant=VELOCITY_TELEOP_PLANT.with_noise(), seed=5)
    wait_for(lambda: loop.snapshot.time > 0.5, "some time")
    loop.order(Reset())
    wait_for(lambda: loop.snapshot.time < 0.5, "the reset")
    heard = listen_to(loop)
    first = loop.plant.time
    lift = OperatorSample(lift=(False, True))
    drive(loop, lift, lambda s: s.mode is Mode.SL and s.soles[1][2] > 0.05, "the lift")
    loop.order(PushOrder("left"))
    drive(loop, OperatorSample(), lambda s: s.mode is Mode.D, "double support")
    loop.stop()
    name = loop.takes.files[-1]
    assert first < 1.0
    assert same_commands(replay_teleop(tmp_path / "takes" / name), heard)
    assert len(read_recording(tmp_path / "takes" / name).pushes) == 1


def test_a_step_that_came_to_nothing_says_why_until_the_next_one(start):
    loop = start()
    assert loop.snapshot.mode_text == Mode.D.value
    drive(loop, OperatorSample(lift=(False, True)), lambda s: s.mode is Mode.TL, "the shift")
    assert loop.snapshot.mode_text == Mode.TL.value
    drive(loop, OperatorSample(), lambda s: s.mode is Mode.D, "double support")
    assert loop.snapshot.mode_text == StepEnd.LOWERED.value
    assert loop.snapshot.landings == 0
    drive(loop, OperatorSample(lift=(False, True)), lambda s: s.mode is Mode.SL, "the lift")
    drive(loop, OperatorSample(), lambda s: s.mode is Mode.D, "double support")
    assert loop.snapshot.mode_text == Mode.D.value


@pytest.mark.parametrize("name", ["biped20", slow("g1")])
def test_each_foot_makes_a_step_forward(start, name):
    loop = start(name=name)
    for foot, standing in ((1, Mode.SL), (0, Mode.SR)):
        lift = (foot == 0, foot == 1)
        first = loop.snapshot.soles[foot][0]
        drive(loop, OperatorSample(lift=lift), lambda s, m=standing: s.mode is m, "the lift")
        forward = OperatorSample(lift=lift, move=(1.0, 0.0))
        goal = first + 0.08
        drive(loop, forward, lambda s, f=foot, x=goal: s.soles[f][0] > x, "the way")
        drive(loop, OperatorSample(), lambda s: s.mode is Mode.D, "double support")
        assert loop.snapshot.soles[foot][2] == pytest.approx(0.0, abs=5e-3)
        assert loop.snapshot.landings == 2 - foot
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

    drive(loop, led(0.0, clutch=False), lambda s: s.device is DeviceStatus.OK, "a sample")
    drive(loop, led(0.0), lambda s: s.hands_do[0] is HandStatus.LED, "the grip")
    drive(loop, led(0.15), lambda s: s.hands[0][2] > home[2] + 0.13, "the way")
    held = led(0.0, clutch=False)
    drive(loop, held, lambda s: s.hands_do[0] is HandStatus.HELD, "the hold")
    assert loop.snapshot.hands[0][2] > home[2] + 0.13
    assert loop.snapshot.hands_do[1] is HandStatus.REST
    rest = replace_sample(held, rest=True)
    drive(loop, rest, lambda s: s.hands[0][2] < home[2] + 0.02, "the rest")
    assert not loop.snapshot.fallen


def test_a_live_run_on_stairs_is_recorded_with_them(start, get_robot, tmp_path):
    plant = replace(VELOCITY_TELEOP_PLANT, blocks=terrain_blocks("steps", get_robot("biped20")))
    loop = start(plant=plant)
    drive(loop, OperatorSample(), lambda s: s.time > 0.2, "some time")
    loop.stop()
    run = replay_teleop(tmp_path / "takes" / "take-001.mcap")
    assert run.plant.config == plant


def test_a_browser_that_closes_in_mid_step_brings_the_foot_down(start):
    loop = start()
    lift = OperatorSample(lift=(True, False))
    drive(loop, lift, lambda s: s.mode is Mode.SR and s.soles[0][2] > 0.05, "the lift")
    loop.lead.inputs.clear()
    wait_for(lambda: loop.snapshot.device is DeviceStatus.LOST, "the loss to show")
    wait_for(lambda: loop.snapshot.mode is Mode.D, "both feet on the ground")
    assert not loop.snapshot.fallen


def test_pause_stops_time_and_slow_motion_slows_it(start):
    loop = start()
    loop.order(Pause(True))
    wait_for(lambda: loop.snapshot.paused, "the pause")
    before = loop.snapshot.time
    time.sleep(0.3)
    assert loop.snapshot.time == before
    loop.order(Slow(True))
    loop.order(Pause(False))
    wait_for(lambda: loop.snapshot.time > before, "time to go on")
    begin, first = time.monotonic(), loop.snapshot.time
    time.sleep(1.0)
    passed = (loop.snapshot.time - first) / (time.monotonic() - begin)
    assert 0.0 < passed < 0.3


def test_reset_begins_anew_and_with_a_new_recording(start):
    loop = start()
    drive(loop, OperatorSample(), lambda s: s.time > 0.2, "some time")
    loop.order(Reset())
    wait_for(lambda: loop.snapshot.take == "take-002.mcap", "the second take")
    drive(loop, OperatorSample(), lambda s: s.time > 0.1, "some time")
    loop.stop()
    assert loop.takes.files == ["take-001.mcap", "take-002.mcap"]


def test_an_error_in_the_loop_is_kept_and_so_is_the_recording(start, tmp_path):
    loop = start()
    drive(loop, OperatorSample(), lambda s: s.time > 0.2, "some time")

    def fail(command):
        raise RuntimeError("the plant broke")

    loop.plant.step = fail
    wait_for(lambda: not loop.running, "the end")
    assert str(loop.error) == "the plant broke"
    assert len(read_recording(tmp_path / "takes" / "take-001.mcap").samples) > 10


def test_a_run_in_which_nobody_drove_leaves_no_file(start):
    loop = start()
    loop.stop()
    assert loop.takes.files == []


def test_what_a_killed_run_has_left_can_be_read(start, tmp_path):
    loop = start()
    drive(loop, OperatorSample(), lambda s: s.time > 0.8, "some time")
    # As the disk has it if the process were gone now.
    left = tmp_path / "left.mcap"
    left.write_bytes((tmp_path / "takes" / "take-001.mcap").read_bytes())
    with pytest.raises(RecordingError, match="not finished"):
        read_recording(left)
    samples = read_recording(left, allow_partial=True).samples
    assert samples[-1][0] > 50


def test_a_copy_is_kept_while_the_run_goes_on(start, tmp_path):
    loop = start()
    drive(loop, OperatorSample(), lambda s: s.time > 1.0, "some time")
    path = loop.takes.keep()
    assert path.name == "kept-001.mcap"
    kept = read_recording(path)
    assert len(kept.samples) > 10
    assert kept.duration >= 0.3
    now = loop.snapshot.time
    drive(loop, OperatorSample(), lambda s: s.time > now, "the run to go on")


def test_a_recording_drives_in_place_of_a_person(start, tmp_path):
    loop = start()
    lift = OperatorSample(lift=(False, True))
    drive(loop, lift, lambda s: s.mode is Mode.SL, "the lift")
    drive(loop, OperatorSample(), lambda s: s.mode is Mode.D, "double support")
    loop.stop()
    again = start(recording=read_recording(tmp_path / "takes" / "take-001.mcap"))
    wait_for(lambda: again.snapshot.mode is Mode.SL, "the step")
    wait_for(lambda: again.snapshot.mode is Mode.D, "its end")


def recorded(robot, path, plant=VELOCITY_TELEOP_PLANT, **changes):
    """A short run of commands to stay, recorded."""
    still = ScriptedDevice([], *StepTeleoperator(robot, actuation="velocity").estimator.anchors)
    run_teleop(robot, still, plant, duration=0.05, recording=path, **changes)
    return read_recording(path)


def test_a_recording_is_played_with_the_parameters_that_it_was_made_with(
    start, get_robot, tmp_path
):
    robot = get_robot("biped20")
    parameters = replace(
        StepTeleoperator(robot, actuation="velocity").parameters, hand_scale=1.7, lower_speed=0.2
    )
    made = recorded(robot, tmp_path / "made.mcap", parameters=parameters, rotator=False)
    loop = start(recording=made)
    assert loop.lead.leader.parameters == parameters
    wait_for(lambda: loop.snapshot.time > 0.1, "some time")
    loop.stop()
    again = read_recording(tmp_path / "takes" / "take-001.mcap").setup
    assert (again.parameters.hand_scale, again.rotator) == (1.7, False)


def test_a_recording_that_begins_elsewhere_than_at_home_drives_from_there(
    start, get_robot, tmp_path
):
    robot = get_robot("biped20")
    lower = standing_posture(robot, feet_apart=0.4, com_height=0.72)
    made = recorded(robot, tmp_path / "made.mcap", q_start=lower, rotator=False)
    loop = start(recording=made)
    assert loop.lead.leader.parameters == teleop_parameters(robot, "velocity")
    wait_for(lambda: loop.snapshot.device is DeviceStatus.OK, "both feet to be led")


def test_a_robot_without_feet_is_refused(get_robot):
    plant = PlantConfig(
        actuation="velocity", control_dt=0.005, servo=PlantConfig.Servo(stiffness=70.0, damping=3.5)
    )
    with pytest.raises(ConfigurationError, match="cannot walk on two feet"):
        FootLead(get_robot("arm6"), OperatorInputs(), plant)


def test_the_real_time_factor_is_of_the_clock(start):
    loop = start()
    wait_for(lambda: loop.snapshot.time > 0.5, "some time")
    assert 0.0 < loop.snapshot.real_time_factor < 1.5


def test_the_margin_in_double_support_is_that_of_both_feet(start, get_robot):
    loop = start()
    soles = list(get_robot("biped20").soles.values())
    polygon = loop.snapshot.polygon
    assert np.ptp(polygon[:, 0]) == pytest.approx(soles[0].length, abs=1e-3)
    feet = loop.snapshot.soles
    apart = feet[0][1] - feet[1][1]
    assert np.ptp(polygon[:, 1]) == pytest.approx(apart + soles[0].width, abs=1e-3)


def test_a_plant_with_another_tick_is_refused(get_robot):
    robot = get_robot("biped20")
    with pytest.raises(ConfigurationError, match="different control periods"):
        FootLead(robot, OperatorInputs(), PlantConfig())


def test_a_recording_is_played_with_its_own_noise(get_robot, tmp_path):
    robot, path = get_robot("biped20"), tmp_path / "noisy.mcap"
    plant = VELOCITY_TELEOP_PLANT.with_noise()
    run = run_teleop(
        robot,
        lambda c: ScriptedDevice([], *c.estimator.anchors),
        plant,
        duration=0.1,
        seed=7,
        recording=path,
    )
    lead = FootLead(robot, OperatorInputs(), plant, recording=read_recording(path), seed=0)
    loop = LiveLoop(lead, Takes(tmp_path / "takes"))
    heard = listen_to(loop)
    for _ in range(20):
        loop._tick()
    loop.stop()
    np.testing.assert_array_equal(heard, run.log.command)


def test_where_hands_are_dragged_along_is_where_the_torso_faces(start):
    """By the page, which tells how far a handle has moved as the torso faces."""
    loop = start(name="g1", plant=TORQUE_TELEOP_PLANT)
    turned = OperatorSample(body=BodyCommand(torso=(0.0, 0.0, 0.4)))
    drive(loop, turned, lambda s: s.heading > 0.3, "the torso that turns")
    site = loop.plant.data.site(loop.lead.robot.torso).xmat.reshape(3, 3)
    assert loop.snapshot.heading == pytest.approx(np.arctan2(site[1, 0], site[0, 0]), abs=0.1)
