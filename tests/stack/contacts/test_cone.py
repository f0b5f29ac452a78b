"""The rows of a contact's cone against forces at points of its surface."""

import numpy as np
import pytest

from poise.stack import PointContact, SurfaceContact

MU, LENGTH, WIDTH, MARGIN, TORSION = 0.6, 0.24, 0.14, 0.01, 0.05


@pytest.fixture
def sole(get_robot):
    contact = SurfaceContact(
        "left_sole", friction=MU, length=LENGTH, width=WIDTH, margin=MARGIN, torsion=TORSION
    )
    contact.bind(get_robot("humanoid33"))
    return contact


def wrench_of(points, forces):
    return np.concatenate((forces.sum(0), np.cross(points, forces).sum(0)))


def random_push(rng, half_length, half_width, count=5):
    """Forces inside the pyramid at points of a rectangle in the plane z = 0."""
    points = np.zeros((count, 3))
    points[:, 0] = rng.uniform(-half_length, half_length, count)
    points[:, 1] = rng.uniform(-half_width, half_width, count)
    forces = rng.uniform(-1.0, 1.0, (count, 3))
    forces[:, 2] = rng.uniform(0.0, 100.0, count)
    forces[:, :2] *= MU * forces[:, 2:]
    return wrench_of(points, forces)


def test_there_are_ten_rows(sole):
    assert sole.cone.shape == (10, 6)


def test_pushes_inside_the_rectangle_satisfy_friction_and_centre_of_pressure(sole):
    rng = np.random.default_rng(0)
    for _ in range(2000):
        F = random_push(rng, LENGTH / 2 - MARGIN, WIDTH / 2 - MARGIN)
        assert (sole.cone[:8] @ F).max() <= 1e-9


def test_the_rows_are_tight_at_the_edges_and_the_pyramids_faces(sole):
    x, y, fz = LENGTH / 2 - MARGIN, WIDTH / 2 - MARGIN, 200.0
    for sx, sy in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        force = np.array([sx * MU * fz, sy * MU * fz, fz])
        F = wrench_of(np.array([[sx * x, sy * y, 0.0]]), force[None])
        F[5] = 0.0
        rows = np.sort(sole.cone @ F)
        assert np.abs(rows[-4:]).max() < 1e-9  # two faces and two edges hold
        assert rows[-5] < -1.0


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_centre_of_pressure_outside_breaks_a_row(sole, axis, sign):
    rng = np.random.default_rng(1)
    edge = (LENGTH, WIDTH)[axis] / 2 - MARGIN
    for _ in range(200):
        F = np.zeros(6)
        F[2] = rng.uniform(1.0, 500.0)
        at = np.zeros(3)
        at[axis] = sign * (edge + rng.uniform(1e-4, 0.1))
        F[3:] = np.cross(at, F[:3])
        assert (sole.cone @ F).max() > 0.0
        at[axis] = sign * (edge - rng.uniform(1e-4, 0.05))
        F[3:] = np.cross(at, F[:3])
        assert (sole.cone @ F).max() <= 0.0


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_slipping_forces_break_a_row(sole, axis, sign):
    F = np.array([0.0, 0.0, 100.0, 0.0, 0.0, 0.0])
    F[axis] = sign * 1.001 * MU * 100.0
    assert (sole.cone @ F).max() > 0.0
    F[axis] = sign * 0.999 * MU * 100.0
    assert (sole.cone @ F).max() <= 0.0


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_yaw_moment_is_bounded_by_torsion(sole, sign):
    F = np.array([0.0, 0.0, 100.0, 0.0, 0.0, sign * 1.001 * TORSION * 100.0])
    assert (sole.cone @ F).max() > 0.0
    F[5] = sign * 0.999 * TORSION * 100.0
    assert (sole.cone @ F).max() <= 0.0


def test_pulling_breaks_rows(sole):
    assert (sole.cone @ np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])).max() > 0.0
    assert sole.wrench_lower[2] == 0.0


def test_the_default_torsion_is_half_of_what_four_corners_hold(get_robot):
    contact = SurfaceContact("left_sole", friction=MU)
    robot = get_robot("humanoid33")
    contact.bind(robot)
    sole = robot.soles["left_sole"]
    assert sole.length == pytest.approx(0.28)
    corners = 0.5 * np.hypot(sole.length, sole.width)
    assert contact.cone[8, 2] == pytest.approx(-0.5 * MU * corners)


def test_a_sole_brings_its_own_size(get_robot):
    robot = get_robot("humanoid33")
    contact = SurfaceContact("right_sole", margin=0.0)
    contact.bind(robot)
    sole = robot.soles["right_sole"]
    assert contact.cone[4, 2] == pytest.approx(-sole.width / 2)
    assert contact.cone[6, 2] == pytest.approx(-sole.length / 2)


def test_a_point_has_the_pyramid_alone(get_robot):
    contact = PointContact("left_hand", friction=MU)
    contact.bind(get_robot("humanoid33"))
    rng = np.random.default_rng(2)
    assert contact.cone.shape == (4, 3)
    for _ in range(500):
        f = rng.normal(size=3)
        inside = abs(f[0]) <= MU * f[2] and abs(f[1]) <= MU * f[2]
        assert ((contact.cone @ f).max() <= 0.0) == inside
