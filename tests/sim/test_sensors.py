import numpy as np
import pinocchio as pin
import pytest
from small_biped import torque

from poise.sim import Plant, PlantConfig, SensorConfig
from poise.sim._sensors import Sensors


def run(robot, sensors, seed=0, ticks=200, look_every=1):
    plant = Plant(robot, PlantConfig(actuation="position", sensors=sensors), seed=seed)
    measured, true = [plant.state()], [plant.true_state()]
    for k in range(ticks):
        plant.step(None)
        if k % look_every == 0:
            measured.append(plant.state())
            true.append(plant.true_state())
    return measured, true


def test_encoders_round_to_their_resolution_and_touch_nothing_else(biped):
    step = 2 * np.pi / 4096
    measured, true = run(biped, SensorConfig(encoder_resolution=step))
    q = np.array([s.q for s in measured])
    counts = q[:, 7:] / step
    np.testing.assert_allclose(counts, np.round(counts), rtol=0, atol=1e-9)
    error = q[:, 7:] - np.array([s.q[7:] for s in true])
    assert np.abs(error).max() <= step / 2 * (1 + 1e-9)
    assert np.abs(error).max() > step / 4
    np.testing.assert_array_equal(q[:, :7], [s.q[:7] for s in true])
    np.testing.assert_array_equal([s.v for s in measured], [s.v for s in true])


def test_a_delay_is_exactly_as_long_as_configured(biped):
    measured, true = run(biped, SensorConfig(delay=0.007), ticks=60)
    for k in range(7, len(true)):
        np.testing.assert_array_equal(measured[k].q, true[k - 7].q)
        np.testing.assert_array_equal(measured[k].v, true[k - 7].v)
        assert measured[k].time == true[k - 7].time
    for k in range(7):
        np.testing.assert_array_equal(measured[k].q, true[0].q)


@pytest.mark.parametrize(
    ("field", "pick"),
    [
        ("joint_position_noise", lambda s: s.q[7:]),
        ("joint_velocity_noise", lambda s: s.v[6:]),
        ("gyro_noise", lambda s: s.v[3:6]),
        ("moment_noise", lambda s: s.contacts["right_sole"][3:]),
    ],
)
def test_noise_has_the_configured_deviation_and_no_bias(biped, field, pick):
    sigma = 0.01
    measured, true = run(biped, SensorConfig(**{field: sigma}), ticks=800)
    error = np.array([pick(m) - pick(t) for m, t in zip(measured, true, strict=True)]).ravel()
    assert error.std() == pytest.approx(sigma, rel=0.1)
    assert abs(error.mean()) < 4 * sigma / np.sqrt(error.size)


def test_orientation_noise_turns_the_base_by_the_configured_angle(biped):
    sigma = 0.02
    measured, true = run(biped, SensorConfig(base_orientation_noise=sigma), ticks=800)
    turns = []
    for m, t in zip(measured, true, strict=True):
        assert np.linalg.norm(m.q[3:7]) == pytest.approx(1.0, abs=1e-12)
        true_R_measured = pin.Quaternion(t.q[3:7]).inverse() * pin.Quaternion(m.q[3:7])
        turns.append(pin.log3(true_R_measured.toRotationMatrix()))
    assert np.std(turns) == pytest.approx(sigma, rel=0.1)


@pytest.mark.parametrize(
    ("field", "pick"),
    [
        ("joint_position_bias", lambda s: s.q[7:]),
        ("force_bias", lambda s: np.r_[s.contacts["left_sole"][:3], s.contacts["right_sole"][:3]]),
        ("moment_bias", lambda s: np.r_[s.contacts["left_sole"][3:], s.contacts["right_sole"][3:]]),
    ],
)
def test_a_bias_is_constant_and_each_run_has_its_own(biped, field, pick):
    sigma, config = 0.01, SensorConfig(**{field: 0.01})
    measured, true = run(biped, config, ticks=20)
    errors = np.array([pick(m) - pick(t) for m, t in zip(measured, true, strict=True)])
    np.testing.assert_allclose(errors, errors[[0] * len(errors)], atol=1e-10)
    np.testing.assert_array_equal(measured[-1].v, true[-1].v)
    drawn = [
        pick(Sensors(config, base_dofs=6, delay_ticks=0, seed=seed).reset(true[0])) - pick(true[0])
        for seed in range(200)
    ]
    assert np.std(drawn) == pytest.approx(sigma, rel=0.15)
    assert abs(np.mean(drawn)) < 4.0 * sigma / np.sqrt(np.size(drawn))
    # No two joints, soles or axes have the same.
    assert np.abs(np.corrcoef(np.transpose(drawn)) - np.eye(len(drawn[0]))).max() < 0.5


def noisy():
    return SensorConfig(
        encoder_resolution=1e-4,
        joint_velocity_noise=0.05,
        gyro_noise=0.02,
        base_orientation_noise=0.01,
        joint_position_bias=0.005,
        force_noise=5.0,
        force_bias=3.0,
        delay=0.002,
    )


def test_the_same_seed_gives_the_same_run_bit_by_bit(biped):
    def closed_loop(seed):
        plant = Plant(biped, PlantConfig(sensors=noisy()), seed=seed)
        plant.push("torso", (30.0, 10.0, 0.0), 0.05, start=0.05)
        trace = []
        while plant.time < 0.2:
            state = plant.state()
            tau = 300.0 * (biped.q_home[7:] - state.q[7:]) - 10.0 * state.v[6:]
            plant.step(torque(tau))
            trace.append(np.r_[plant.true_state().q, state.v, state.contacts["left_sole"]])
        return np.array(trace)

    first = closed_loop(5)
    np.testing.assert_array_equal(first, closed_loop(5))
    assert not np.array_equal(first, closed_loop(6))


def test_the_noise_does_not_depend_on_how_often_somebody_looks(biped):
    often, _ = run(biped, noisy(), ticks=100)
    seldom, _ = run(biped, noisy(), ticks=100, look_every=10)
    np.testing.assert_array_equal(often[91].q, seldom[10].q)
    np.testing.assert_array_equal(often[91].v, seldom[10].v)
