import numpy as np

from benchmarks.recording import Loop, Path


def test_velocity_and_acceleration_of_a_loop_are_derivatives_of_its_position():
    loop = Loop(
        centre=np.array([0.1, 0.2, 0.3]),
        displacement=np.array([0.0, 0.1, -0.2]),
        shift=(0.1, 0.7),
        amplitude=np.array([0.05, 0.02, 0.03]),
        phase=np.array([0.0, 1.0, 2.0]),
        frequency=0.7,
        swell=(0.2, 0.4),
    )
    dt = 1e-6
    for time in np.linspace(0.0, 1.5, 40).tolist():
        before, now, after = (loop.at(t) for t in (time - dt, time, time + dt))
        np.testing.assert_allclose(now[1], (after[0] - before[0]) / (2 * dt), atol=1e-7)
        np.testing.assert_allclose(now[2], (after[1] - before[1]) / (2 * dt), atol=1e-4)
    np.testing.assert_allclose(loop.at(0.0)[0], loop.centre)


def test_a_path_keeps_points_in_order():
    points = [tuple(np.full(3, 10.0 * i + k) for k in range(3)) for i in range(4)]
    path = Path.of(points)
    np.testing.assert_array_equal(path.velocity[:, 0], [1.0, 11.0, 21.0, 31.0])
