"""The rows of a contact's cone against forces at points of its surface."""

import numpy as np
import pytest
from scipy.optimize import linprog

import poise
from poise.errors import ConfigurationError
from poise.stack import PointContact, SurfaceContact

MU, LENGTH, WIDTH, MARGIN, TORSION = 0.6, 0.24, 0.14, 0.01, 0.05


@pytest.fixture
def sole(get_robot):
    contact = SurfaceContact(
        "left_sole", friction=MU, length=LENGTH, width=WIDTH, margin=MARGIN, torsion=TORSION
    )
    contact.bind(get_robot("humanoid33"))
    return contact


def test_with_a_torsion_the_cone_is_friction_centre_of_pressure_and_yaw_moment(sole):
    x, y, rng, counts = LENGTH / 2 - MARGIN, WIDTH / 2 - MARGIN, np.random.default_rng(0), [0, 0]
    most = np.array([MU, MU, 1.0, y, x, TORSION])
    assert len(sole.cone) == 10
    for _ in range(2000):
        F = 1.2 * most * rng.uniform(-1.0, 1.0, 6)
        F[2] = rng.choice([-1.0, 1.0])
        inside = F[2] > 0.0 and (np.abs(F) <= most * F[2]).all()
        assert ((sole.cone @ F).max() <= 0.0) == inside
        counts[int(inside)] += 1
    assert min(counts) > 200


@pytest.mark.parametrize("width", [WIDTH, 0.05])
def test_without_torsion_the_cone_is_what_forces_at_the_corners_make(get_robot, width):
    contact = SurfaceContact("left_sole", friction=MU, length=LENGTH, width=width, margin=MARGIN)
    contact.bind(get_robot("humanoid33"))
    assert contact.cone.shape == (16, 6)
    x, y = LENGTH / 2 - MARGIN, width / 2 - MARGIN
    corners = np.array([[sx * x, sy * y, 0.0] for sx in (1, -1) for sy in (1, -1)])
    faces = [np.array([a * MU, b * MU, 1.0]) for a in (1, -1) for b in (1, -1)]
    rays = np.array([[*f, *np.cross(p, f)] for p in corners for f in faces]).T
    rng = np.random.default_rng(3)
    counts = [0, 0]
    for _ in range(400):
        F = np.append(rng.uniform(-MU, MU, 2), [1.0, *rng.uniform(-1, 1, 3) * [y, x, MU * x]])
        worst = (contact.cone @ F).max()
        if abs(worst) < 1e-9:
            continue
        made = linprog(np.zeros(rays.shape[1]), A_eq=rays, b_eq=F).status == 0
        assert made == (worst < 0.0)
        counts[made] += 1
    assert min(counts) > 20


LOWER, UPPER = (0.02, -0.05), (0.09, -0.01)


def test_a_part_of_a_surface_carries_what_a_smaller_one_there_would(get_robot):
    contact = SurfaceContact("left_sole", friction=MU, length=LENGTH, width=WIDTH, margin=MARGIN)
    contact.bind(get_robot("humanoid33"))
    contact.carry_on(LOWER, UPPER)
    size = np.subtract(UPPER, LOWER)
    small = SurfaceContact("left_sole", friction=MU, length=size[0], width=size[1], margin=0.0)
    small.bind(get_robot("humanoid33"))
    middle = np.array([*np.mean((LOWER, UPPER), axis=0), 0.0])
    rng = np.random.default_rng(4)
    for _ in range(200):
        F = rng.normal(size=6)
        about = np.concatenate((F[:3], F[3:] - np.cross(middle, F[:3])))
        np.testing.assert_allclose(contact.cone @ F, small.cone @ about, atol=1e-12)


def test_a_part_that_is_larger_than_the_surface_is_the_surface(get_robot):
    contact = SurfaceContact("left_sole", friction=MU, length=LENGTH, width=WIDTH, margin=MARGIN)
    contact.bind(get_robot("humanoid33"))
    whole = contact.cone.copy()
    contact.carry_on(LOWER, UPPER)
    assert np.abs(contact.cone - whole).max() > 0.01
    contact.carry_on((-1.0, -1.0), (1.0, 1.0))
    np.testing.assert_allclose(contact.cone, whole, atol=1e-12)


def test_an_edge_and_what_is_bound_to_no_robot_have_no_part(get_robot_without):
    contact = SurfaceContact("left_sole")
    with pytest.raises(ConfigurationError, match="no surface that could shrink"):
        contact.carry_on(LOWER, UPPER)
    contact.bind(get_robot_without(".*_ankle_roll"))
    with pytest.raises(ConfigurationError, match="no surface that could shrink"):
        contact.carry_on(LOWER, UPPER)


@pytest.mark.parametrize("kind", [poise.WholeBodyController, poise.ReducedController])
def test_the_pressure_stays_where_the_surface_carries(get_robot, kind):
    robot = get_robot("humanoid33")
    stack = poise.default_stack(robot)
    controller = kind(robot, stack)
    state = poise.RobotState(robot.q_home.copy(), np.zeros(robot.nv))
    left, _ = stack.contacts
    for lower, upper in (((0.05, -1.0), (0.06, 1.0)), ((-0.06, -1.0), (-0.05, 1.0))):
        left.carry_on(lower, upper)
        force = controller.step(state).wrenches[left.name]
        assert lower[0] - 1e-6 <= -force[4] / force[2] <= upper[0] + 1e-6


@pytest.mark.parametrize("without", [(), (".*_ankle_roll",)])
def test_another_margin_makes_the_cone_of_a_contact_that_had_it_all_along(
    get_robot_without, without
):
    robot = get_robot_without(*without)
    contact = SurfaceContact("left_sole", friction=MU, margin=MARGIN)
    new = SurfaceContact("left_sole", friction=MU, margin=0.002)
    for each in (contact, new):
        each.bind(robot)
    assert np.abs(contact.cone - new.cone).max() > 1e-3
    contact.set_margin(0.002)
    assert contact.margin == 0.002
    np.testing.assert_allclose(contact.cone, new.cone, atol=1e-12)
    np.testing.assert_allclose(contact.pressure_reach, new.pressure_reach, atol=1e-12)


def test_the_part_that_carries_outlasts_a_margin(get_robot):
    contact, new = SurfaceContact("left_sole"), SurfaceContact("left_sole", margin=MARGIN)
    for each in (contact, new):
        each.bind(get_robot("humanoid33"))
        each.carry_on((-np.inf, 0.0), (0.03, np.inf))
    contact.set_margin(MARGIN)
    np.testing.assert_allclose(contact.cone, new.cone, atol=1e-12)


@pytest.mark.parametrize("margin", [-0.001, np.nan, 1.0])
def test_a_margin_that_cannot_be_is_refused_and_changes_nothing(get_robot, margin):
    contact = SurfaceContact("left_sole")
    contact.bind(get_robot("humanoid33"))
    cone, reach = contact.cone.copy(), contact.pressure_reach.copy()
    with pytest.raises(ConfigurationError, match="margin of contact 'left_sole'"):
        contact.set_margin(margin)
    assert contact.margin == 0.005
    np.testing.assert_array_equal(contact.cone, cone)
    np.testing.assert_array_equal(contact.pressure_reach, reach)


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


def test_the_metric_is_that_of_all_of_the_surface(get_robot):
    contact = SurfaceContact("left_sole", friction=MU, length=LENGTH, width=WIDTH, margin=MARGIN)
    contact.bind(get_robot("humanoid33"))
    whole = contact.metric
    # The edge of the front half goes through the frame's origin: no bound at unit normal force.
    contact.carry_on((0.0, -1.0), (1.0, 1.0))
    assert (contact.cone[:, 2] == 0.0).any()
    np.testing.assert_array_equal(contact.metric, whole)


@pytest.mark.parametrize(
    ("lower", "upper"),
    [
        ((np.nan, -0.1), (0.1, 0.1)),
        ((0.05, 0.05), (-0.05, -0.05)),
        ((0.0,), (0.1, 0.1)),
        (None, (0.1, 0.1)),
    ],
    ids=str,
)
def test_what_is_no_part_of_a_surface_changes_nothing(get_robot, lower, upper):
    contact = SurfaceContact("left_sole", length=LENGTH, width=WIDTH)
    contact.bind(get_robot("humanoid33"))
    contact.carry_on(LOWER, UPPER)
    before = contact.cone.copy()
    with pytest.raises((ConfigurationError, TypeError), match=r"cannot carry on that|lower"):
        contact.carry_on(lower, upper)
    contact.set_margin(contact.margin)
    np.testing.assert_array_equal(contact.cone, before)
