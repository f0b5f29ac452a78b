"""Recorded samples lead another robot, another controller and other runs."""

import numpy as np
import pytest
from slow import slow

pytest.importorskip("mcap")
pytest.importorskip("mujoco")

from poise.apps.teleoperation import (
    TORQUE_TELEOP_PLANT,
    VELOCITY_TELEOP_PLANT,
    RecordedPush,
    RecordingError,
    read_recording,
    run_teleop,
    write_recording,
)
from poise.locomotion import (
    DeviceStatus,
    Mode,
    OperatorSample,
    ScriptedDevice,
    StepTeleoperator,
    TrackedPose,
    WayPoint,
)

AHEAD, UP = 0.15, 0.1
STEP = [
    WayPoint(at=at, right=(x, 0.0, z))
    for at, x, z in (
        (0.3, 0.0, 0.0), (0.5, 0.0, 0.03), (0.9, 0.0, 0.03), (1.5, 0.0, UP), (2.1, AHEAD, UP),
        (2.9, AHEAD, -0.03), (3.5, AHEAD, -0.03), (3.7, AHEAD, 0.0),
    )
]  # fmt: skip
PLANTS = {"torque": TORQUE_TELEOP_PLANT, "velocity": VELOCITY_TELEOP_PLANT}
HEIGHTS = {"biped20": 0.765, "g1": 0.673, "humanoid33": 0.877}
"""Of the CoM at home [m]."""


def lead(robot, device, actuation, duration=4.0, **more):
    return run_teleop(robot, device, PLANTS[actuation], duration=duration, **more)


@pytest.fixture(scope="module")
def recording(get_robot, tmp_path_factory):
    """A step of biped20 at velocity level, with a push."""
    path = tmp_path_factory.mktemp("recorded") / "step.mcap"
    lead(
        get_robot("biped20"),
        lambda t: ScriptedDevice(STEP, *t.estimator.anchors),
        "velocity",
        recording=path,
        pushes=[RecordedPush(10, (20.0, 0.0, 0.0), 0.1)],
    )
    return read_recording(path)


@pytest.mark.parametrize(
    ("name", "actuation"),
    [
        ("g1", "torque"),
        slow("humanoid33", "velocity"),
        slow("humanoid33", "torque"),
        slow("g1", "velocity"),
        ("biped20", "torque"),
    ],
)
def test_a_recorded_step_is_made_in_the_size_of_another_robot(
    get_robot, recording, name, actuation
):
    run = lead(get_robot(name), recording.device, actuation)
    size = HEIGHTS[name] / HEIGHTS["biped20"]
    soles = run.log.soles[:, 1] - run.log.soles[0, 1]
    assert not run.fell
    assert run.log.when(Mode.SL).any()
    assert run.teleoperator.mode is Mode.D
    assert {tuple(DeviceStatus)[i] for i in np.unique(run.log.device)} == {DeviceStatus.OK}
    assert soles[-1, 0] == pytest.approx(size * AHEAD, abs=0.01)
    assert soles[:, 2].max() == pytest.approx(size * UP, abs=0.025)
    # Nobody pushed this robot.
    assert run.teleoperator.device.pushes == []


def test_a_recording_without_samples_drives_nothing(get_robot, tmp_path):
    path = tmp_path / "none.mcap"
    write_recording(path, [], robot="biped20", dt=0.005)
    with pytest.raises(RecordingError, match=r"none\.mcap has no samples of an operator"):
        lead(get_robot("biped20"), read_recording(path).device, "velocity")


def test_samples_alone_keep_their_lengths(get_robot, tmp_path):
    """Without the settings of the run nobody knows how large its robot was."""
    path = tmp_path / "bare.mcap"
    feet = TrackedPose((1.0, 0.5, 0.0)), TrackedPose((1.0, 0.1, 0.0))
    further = TrackedPose((1.1, 0.5, 0.2)), None
    samples = [OperatorSample(0.0, feet), OperatorSample(0.1, further)]
    write_recording(path, enumerate(samples), robot="biped20", dt=0.004)
    teleoperator = StepTeleoperator(get_robot("humanoid33"))
    device = read_recording(path).device(teleoperator)
    sent = [device.sample(0.0) for _ in range(3)]
    assert sent[1] is None
    for foot in (0, 1):
        np.testing.assert_allclose(
            sent[0].place(foot), teleoperator.estimator.sole(foot), atol=1e-9
        )
    assert sent[2].feet[1] is None
    # No device has taken hold in between: this one is still over its foot.
    x, y, _ = teleoperator.estimator.sole(0)
    np.testing.assert_allclose(sent[2].place(0), (x, y, 0.2), atol=1e-9)
