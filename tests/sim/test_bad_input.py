import dataclasses
import subprocess
import sys

import numpy as np
import pytest
from small_biped import document, torque, velocity

from poise.errors import ConfigurationError, RobotError, TargetError, UnknownNameError
from poise.robots import ModelSource
from poise.sim import Block, Plant, PlantConfig, Push, SensorConfig

NAN, INF = float("nan"), float("inf")

Servo, Payload, LinkError = PlantConfig.Servo, PlantConfig.Payload, PlantConfig.LinkError


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: PlantConfig(control_dt=0.0), "control_dt"),
        (lambda: PlantConfig(control_dt=1e-3, physics_dt=3e-4), "multiple"),
        (lambda: PlantConfig(control_dt=1e-3, physics_dt=2e-3), "multiple|shorter"),
        (lambda: PlantConfig(physics_dt=1e-3, contact_time_constant=1e-3), "contact_time"),
        (lambda: PlantConfig(friction=-0.5), "friction"),
        (lambda: PlantConfig(actuation="velocity", torque_bandwidth=9.0), "velocity actuation"),
        (lambda: PlantConfig(actuation="force"), "'force'; choices: torque, position, velocity"),
        (lambda: PlantConfig(floor_slope=(0.0, 1.2)), "floor_slope"),
        (lambda: PlantConfig(fall_height_ratio=1.5), "fall_height_ratio"),
        (lambda: PlantConfig(sensors=SensorConfig(delay=0.0015)), "delay"),
        (lambda: SensorConfig(gyro_noise=-0.1), "gyro_noise"),
        (lambda: Servo(damping=-1.0), "damping"),
        (lambda: Payload(frame="left_hand", mass=-1.0), "mass"),
        (
            lambda: Payload(frame="left_hand", mass=1.0, offset=(0.0, INF, 0.0)),
            "offset",
        ),
        (lambda: Push(body="torso", force=(NAN, 0.0, 0.0), start=0.0, duration=1.0), "force"),
        (lambda: LinkError(link="chest", com_offset=(0.0, 0.0, NAN)), "com_offset"),
        (lambda: Block(center=(0.0, 0.0), size=(1.0, 1.0, 0.0)), "size"),
        (lambda: Block(center=(0.0, 0.0), size=(1.0, 1.0, 0.1), tilt=(0.8, 0.0)), "tilt"),
        (lambda: Block(center=(0.0, 0.0), size=(1.0, 1.0, 0.1), tilt=(0.1, 0.0)), "told: false"),
    ],
)
def test_values_that_cannot_be_are_refused(make, says):
    with pytest.raises(ConfigurationError, match=says):
        make()


@pytest.mark.parametrize(
    "config",
    [
        PlantConfig(payloads=(Payload(frame="left_hnad", mass=1.0),)),
        PlantConfig(link_errors=(LinkError(link="left_hnad"),)),
    ],
)
def test_unknown_frames_in_the_configuration_are_refused_with_choices(biped, config):
    with pytest.raises(UnknownNameError, match="chest"):
        Plant(biped, config)


def test_a_push_on_an_unknown_body_is_refused_with_choices(biped):
    plant = Plant(biped)
    for body in ("tosro", "world", ""):
        with pytest.raises(UnknownNameError, match="torso"):
            plant.push(body, (1.0, 0.0, 0.0), 0.1)
    with pytest.raises(ConfigurationError):
        plant.push("torso", (NAN, 0.0, 0.0), 0.1)


def test_states_that_cannot_be_are_refused_at_reset(biped):
    plant = Plant(biped)
    bad = biped.q_home.copy()
    bad[9] = NAN
    with pytest.raises(TargetError, match="NaN"):
        plant.reset(bad)
    with pytest.raises(TargetError, match="unit"):
        plant.reset(np.zeros(biped.nq))


def test_a_command_of_another_kind_than_the_actuation_is_refused(biped):
    with pytest.raises(ConfigurationError, match="torque"):
        Plant(biped).step(velocity(np.zeros(biped.nj)))
    moving = Plant(biped, PlantConfig(actuation="velocity"))
    with pytest.raises(ConfigurationError, match="velocity"):
        moving.step(torque(np.zeros(biped.nj)))
    with pytest.raises(ConfigurationError, match="shape"):
        Plant(biped).step(torque(np.zeros(3)))
    with pytest.raises(ConfigurationError, match="position"):
        Plant(biped).step(None, position=np.zeros(biped.nj))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda t: t.replace("<robot", "<robo"), "cannot read|cannot build"),
        (lambda t: t[:-20], "cannot read"),
        (
            lambda t: t.replace('<box size="0.2 0.3 0.15"/>', '<mesh filename="no/such.stl"/>'),
            "no/such.stl",
        ),
        (
            lambda t: t.replace(
                '<box size="0.2 0.3 0.15"/>', '<mesh filename="package://body/such.stl"/>'
            ),
            "package://body/such.stl",
        ),
        (lambda t: t.replace('ixx="', 'ixx="9'), "inertia"),
    ],
)
def test_documents_that_cannot_be_simulated_are_refused(biped, change, says):
    source = ModelSource(kind="urdf", text=change(document()))
    with pytest.raises(RobotError, match=says):
        Plant(dataclasses.replace(biped, source=source))


def test_a_mesh_file_that_holds_no_mesh_is_refused(biped, tmp_path):
    (tmp_path / "bad.dae").write_text("this is no mesh")
    text = document().replace('<box size="0.2 0.3 0.15"/>', '<mesh filename="bad.dae"/>')
    source = ModelSource(kind="urdf", text=text, directory=tmp_path)
    with pytest.raises(RobotError, match=r"bad\.dae"):
        Plant(dataclasses.replace(biped, source=source)).drawn_model()


def test_without_mujoco_the_message_names_the_extra():
    code = (
        "import sys; sys.modules['mujoco'] = None\n"
        "from poise.errors import MissingExtraError\n"
        "try:\n    import poise.sim\n"
        "except MissingExtraError as error:\n    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert 'pip install "poise[sim]"' in done.stdout
