"""The balance limit's rows: what soles can always do, and against formulas of their own."""

import numpy as np
import pinocchio as pin
import pytest
from oracles import dynamics_at, near_home
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError, PoiseError
from poise.stack import (
    BalanceLimit,
    ComTask,
    PointContact,
    Stack,
    StackRows,
    SurfaceContact,
    default_stack,
    find_hull,
)

SEEDS = range(4)
EDGES = 12
GRAVITY = 9.81


def rows_of(robot, state, limit=None, contacts=None, steps=None):
    """The rows at a state: A dv between two bounds; and the limit."""
    limit = limit or BalanceLimit()
    if contacts is None:
        contacts = [SurfaceContact(sole) for sole in robot.soles]
    stack = Stack(contacts, [[ComTask()]], balance_limit=limit)
    stack.bind(robot)
    for contact in contacts:
        contact.advance(0.0)
    if steps is not None:
        limit.expect_step(steps)
    rows = StackRows(robot, stack, stack.active_contacts, balance="before")
    dynamics = Dynamics(robot)
    dynamics.update(state)
    rows.update(dynamics)
    own = rows.balance_rows
    return rows, rows.J[own], rows.target[own], rows.upper[own], dynamics


def leaning(robot, seed, lean):
    """A state near home that moves over its feet, so that the component is anywhere."""
    state = near_home(robot, seed, spread=0.02, speed=0.02)
    rng = np.random.default_rng(100 + seed)
    v = state.v.copy()
    v[:2] += lean * rng.normal(size=2)
    return RobotState(state.q, v)


def centroid_drift(robot, state):
    """Rate of the centroidal momentum at zero dv, over the mass for the linear part."""
    data = robot.model.createData()
    pin.computeCentroidalMomentumTimeVariation(
        robot.model, data, state.q, state.v, np.zeros(robot.nv)
    )
    mass = pin.computeTotalMass(robot.model)
    return data.dhg.linear / mass, data.dhg.angular.copy()


def soles_corners(robot, dynamics, contacts, margin):
    corners = []
    for contact in contacts:
        place, R = dynamics.placement(robot.frame_id(contact.frame))
        a, b = contact.pressure_reach - np.minimum(margin, 0.5 * contact.pressure_reach)
        corners += [(place + R @ [s * a, t * b, 0.0])[:2] for s in (1, -1) for t in (1, -1)]
    return np.array(corners)


def levers(robot, dynamics, state, contact, point):
    """Torques of a leg's joints by 1 N upwards at a point, and their largest [m, N m]."""
    model, data = robot.model, robot.model.createData()
    J = pin.computeJointJacobians(model, data, state.q)
    leg = model.supports[model.frames[robot.frame_id(contact.frame)].parentJoint]
    columns = [model.joints[j].idx_v for j in leg if j > 1]
    arms = np.array([J[2, k] + np.cross(J[3:, k], [*point, 0.0])[2] for k in columns])
    return arms, robot.tau_max[np.array(columns) - 6]


def carried_corners(robot, dynamics, state, contacts, margin):
    """Where soles can press: a corner, or as near to it as the leg's torques allow, or shared.

    The other foot carries what it has to, at the same corner.
    """
    feet = soles_corners(robot, dynamics, contacts, margin).reshape(len(contacts), 4, 2)
    points = []
    for i, contact in enumerate(contacts):
        middle = feet[i].mean(axis=0)
        a0, most = levers(robot, dynamics, state, contact, middle)
        most = most / robot.weight
        other = feet[(i + 1) % len(feet)]
        least = contacts[(i + 1) % len(feet)].min_load if len(contacts) > 1 else 0.0
        for j, corner in enumerate(feet[i]):
            a1, _ = levers(robot, dynamics, state, contact, corner)
            ways = [
                (m * np.sign(b) - a) / (b - a)
                for a, b, m in zip(a0, a1, most, strict=True)
                if abs(b) > m
            ]
            share = min(1.0 - least, (most / np.abs(a1)).min())
            if len(contacts) == 1 or not any(way <= 0.0 for way in ways):
                alone = middle + max(0.3, min([1.0, *ways])) * (corner - middle)
                points.append((1.0 - least) * alone + least * other[j])
            if share < 1.0 - least and len(contacts) > 1:
                points.append(share * corner + (1.0 - share) * other[j])
    return np.array(points)


def component(robot, dynamics, state, contacts):
    data = robot.model.createData()
    com = pin.centerOfMass(robot.model, data, state.q, state.v).copy()
    speed = data.vcom[0][:2].copy()
    height = np.mean([dynamics.placement(robot.frame_id(c.frame))[0][2] for c in contacts])
    omega = np.sqrt(GRAVITY / (com[2] - height))
    return com[:2] + speed / omega, speed, omega


def polygon(robot, rows, J, dynamics, state, contacts):
    """Edges n x <= h from the rows: J dv = n A dv, and distances of the component."""
    used = np.isfinite(rows.balance.edge_distances)
    A = dynamics.momentum_matrix[:2] / pin.computeTotalMass(robot.model)
    normals = np.linalg.lstsq(A.T, J[:EDGES][used].T, rcond=None)[0].T
    xi = component(robot, dynamics, state, contacts)[0]
    return normals, rows.balance.edge_distances[used] + normals @ xi


@pytest.mark.parametrize("name", ["g1", "humanoid33"])
@pytest.mark.parametrize("seed", SEEDS)
def test_inside_each_edge_is_approached_no_faster_than_its_distance_allows(get_robot, name, seed):
    robot, limit = get_robot(name), BalanceLimit(decay=3.0)
    state = leaning(robot, seed, 0.02)
    contacts = [SurfaceContact(sole) for sole in robot.soles]
    rows, J, _, upper, dynamics = rows_of(robot, state, limit, contacts)
    hull = ConvexHull(carried_corners(robot, dynamics, state, contacts, limit.margin))
    xi, speed, omega = component(robot, dynamics, state, contacts)
    expected = []
    drift = centroid_drift(robot, state)[0]
    for nx, ny, offset in hull.equations:
        left = -offset - nx * xi[0] - ny * xi[1]
        assert left > 0.0
        reference = omega * (3.0 * left - nx * speed[0] - ny * speed[1])
        expected.append((left, reference - nx * drift[0] - ny * drift[1]))
    edges = zip(rows.balance.edge_distances, upper[:EDGES], strict=True)
    found = sorted((float(d), float(u)) for d, u in edges if np.isfinite(d))
    # Hulls are exact on a grid of 4 nm.
    assert np.array(found) == pytest.approx(np.array(sorted(expected)), abs=1e-6)
    # Coefficients: the CoM's acceleration along the normal.
    dv = np.random.default_rng(seed).normal(size=robot.nv)
    com = Dynamics(robot)
    com.update(state)
    a = com.momentum_matrix[:2] @ dv / pin.computeTotalMass(robot.model)
    normals = np.unique(np.round(hull.equations[:, :2] @ a, 8))
    assert np.allclose(
        np.unique(np.round((J @ dv)[:EDGES][np.isfinite(upper[:EDGES])], 8)), normals
    )


@pytest.mark.parametrize("name", ["g1", "humanoid33"])
@pytest.mark.parametrize("seed", range(12))
def test_a_centre_of_pressure_in_the_soles_always_meets_all_edges(get_robot, name, seed):
    """Also far outside, on one foot, and with a foothold ahead: c'' = omega^2 (c - p), some p."""
    robot = get_robot(name)
    rng = np.random.default_rng(seed)
    state = leaning(robot, seed, 0.6)
    contacts = [SurfaceContact(sole) for sole in list(robot.soles)[: 1 + seed % 2]]
    foothold = None
    if seed % 3 == 0:
        centre = rng.normal(scale=0.3, size=2)
        foothold = [centre + [s * 0.1, t * 0.05] for s in (1, -1) for t in (1, -1)]
    rows, J, _, upper, dynamics = rows_of(robot, state, None, contacts, foothold)
    used = np.isfinite(upper[:EDGES])
    assert used.any()
    _, _, omega = component(robot, dynamics, state, contacts)
    drift = centroid_drift(robot, state)[0][:2]
    normals, _ = polygon(robot, rows, J, dynamics, state, contacts)
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)
    # n (omega^2 (c - p)) - n drift <= upper for a p = sum of corners with weights that add up to 1.
    corners = carried_corners(robot, dynamics, state, contacts, 0.0)
    com = dynamics.com[:2]
    matrix = -omega * omega * normals @ corners.T
    bound = upper[:EDGES][used] + normals @ drift - omega * omega * normals @ com
    slack = np.append(np.zeros(len(corners)), 1.0)
    found = linprog(
        slack,
        np.column_stack((matrix, -np.ones(len(matrix)))),
        bound,
        [np.append(np.ones(len(corners)), 0.0)],
        [1.0],
    )
    assert found.fun <= 1e-7


def folded(robot, by):
    """At rest, upright, with knees bent as far: soles where they were, as the trunk comes down."""
    q = robot.q_home.copy()
    names = list(robot.joint_names)
    for side in ("left", "right"):
        for joint, part in (("hip_pitch", -0.5), ("knee", 1.0), ("ankle_pitch", -0.5)):
            index = next(i for i, n in enumerate(names) if n.startswith(f"{side}_{joint}"))
            q[7 + index] += part * by
    return RobotState(q, np.zeros(robot.nv))


@pytest.mark.parametrize("name", ["g1", "humanoid33", "biped20"])
@pytest.mark.parametrize("by", [0.0, 0.8, 1.3])
@pytest.mark.parametrize("feet", [1, 2])
def test_where_soles_can_press_the_legs_hold_the_weight(get_robot, name, by, feet):
    """By a linear program that has the vertical forces at all corners, and all torques."""
    robot, limit = get_robot(name), BalanceLimit(margin=0.0)
    state = folded(robot, by)
    contacts = [SurfaceContact(sole) for sole in list(robot.soles)[:feet]]
    rows, J, _, _, dynamics = rows_of(robot, state, limit, contacts)
    corners = soles_corners(robot, dynamics, contacts, 0.0)
    torques, most = [], []
    for i, contact in enumerate(contacts):
        columns = []
        for k, corner in enumerate(corners):
            arms, limits = levers(robot, dynamics, state, contact, corner)
            columns.append(arms * robot.weight * (k // 4 == i))
        torques.append(np.array(columns).T)
        most.append(limits)
    matrix, bound = np.vstack(torques), np.concatenate(most)

    def holds(p):
        """The least part of the torques that carries the weight at p."""
        n = len(corners)
        found = linprog(
            np.append(np.zeros(n), 1.0),
            np.column_stack((np.vstack((matrix, -matrix)), -np.tile(bound, 2))),
            np.zeros(2 * len(bound)),
            np.vstack((np.column_stack((corners.T, [0.0, 0.0])), [*np.ones(n), 0.0])),
            [*p, 1.0],
        )
        return found.fun if found.success else np.inf

    # The polygon from the rows: edges n x <= h, of which the component's distances are known.
    _, offsets = polygon(robot, rows, J, dynamics, state, contacts)
    expected = ConvexHull(carried_corners(robot, dynamics, state, contacts, 0.0))
    assert np.allclose(np.sort(offsets), np.sort(-expected.equations[:, 2]), atol=1e-6)
    cut = expected.volume < ConvexHull(corners).volume - 1e-9
    # Folded legs carry less: the robot that stands with nearly straight ones has more to stand on.
    assert cut or by < 1.3
    # A third of the sole or so is always left.
    least = 0.3 * corners + 0.7 * corners.mean(axis=0)
    vertices = expected.points[expected.vertices]
    used = [holds(p) for p in vertices if feet == 2 or np.abs(least - p).max(axis=1).min() > 1e-9]
    assert max(used, default=0.0) <= 1.0 + 1e-6
    if feet == 1 and cut and len(used) == len(vertices):
        # No more is taken away than has to be.
        assert max(used) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_at_rest_inside_rest_is_allowed(get_robot, seed):
    robot = get_robot("g1")
    state = near_home(robot, seed, spread=0.01, speed=0.0)
    _, _, lower, upper, _ = rows_of(robot, state)
    assert (upper >= 0.0).all()
    assert (lower <= 0.0).all()


@pytest.mark.parametrize("beyond", [0.001, 0.002, 0.22])
def test_from_beyond_an_edge_the_component_comes_back_as_far_as_the_soles_can_make_it(
    get_robot, beyond
):
    """At 12 /s whatever the decay inside; far ahead the ZMP has to be at the soles' front edge."""
    robot, limit = get_robot("humanoid33"), BalanceLimit(decay=3.0)
    contacts = [SurfaceContact(sole) for sole in robot.soles]
    state = RobotState(robot.q_home, np.zeros(robot.nv))
    dynamics = dynamics_at(robot, state.q, state.v)
    for contact in contacts:
        contact.bind(robot)
    inner, outer = (
        soles_corners(robot, dynamics, contacts, margin)[:, 0].max() for margin in (0.02, 0.0)
    )
    omega = component(robot, dynamics, state, contacts)[2]
    v, xi = np.zeros(robot.nv), inner + beyond
    v[0] = omega * (xi - dynamics.com[0])
    state = RobotState(robot.q_home, v)
    rows, J, _, upper, dynamics = rows_of(robot, state, limit, contacts)
    edge = int(np.argmin(rows.balance.edge_distances))
    assert rows.balance.edge_distances[edge] == pytest.approx(-beyond, abs=1e-6)
    # xi_dot = cdot + cddot / omega
    zmp = min(outer, xi + 12.0 / omega * beyond)
    expected = omega * (omega * (xi - zmp) - v[0]) - centroid_drift(robot, state)[0][0]
    assert upper[edge] == pytest.approx(expected, rel=1e-5)
    assert J[edge, 0] == pytest.approx(1.0)


def test_a_foot_that_has_to_carry_something_keeps_the_pressure_from_the_other_s_edge(get_robot):
    """Against the hull of 0.2 of the weight on one foot, and 0.8 on the other."""
    robot, limit = get_robot("humanoid33"), BalanceLimit(margin=0.0)
    state = RobotState(robot.q_home, np.zeros(robot.nv))
    contacts = [SurfaceContact(sole, min_load=0.2) for sole in robot.soles]
    rows, J, _, _, dynamics = rows_of(robot, state, limit, contacts)
    feet = soles_corners(robot, dynamics, contacts, 0.0).reshape(2, 4, 2)
    sums = [s * a + (1.0 - s) * b for s in (0.2, 0.8) for a in feet[0] for b in feet[1]]
    normals, offsets = polygon(robot, rows, J, dynamics, state, contacts)
    farthest = (normals @ np.array(sums).T).max(axis=1)
    assert (offsets <= farthest + 1e-9).all()
    # Nothing is lost sideways, where the legs' torques do not count.
    sideways = np.abs(normals[:, 1]) > 0.999
    assert sideways.sum() == 2
    assert np.allclose(offsets[sideways], farthest[sideways])


@pytest.mark.parametrize("seed", SEEDS)
def test_angular_momentum_is_bounded_by_what_the_soles_can_stop(get_robot, seed):
    robot, limit = get_robot("humanoid33"), BalanceLimit(stop_time=0.2)
    state = near_home(robot, seed, speed=1.0)
    contacts = [SurfaceContact(sole) for sole in robot.soles]
    _, J, lower, upper, dynamics = rows_of(robot, state, limit, contacts)
    corners = carried_corners(robot, dynamics, state, contacts, limit.margin)
    hull = ConvexHull(corners)
    middle = corners[hull.vertices].mean(axis=0)
    arm = (-hull.equations[:, 2] - hull.equations[:, :2] @ middle).min()
    xi, _, _ = component(robot, dynamics, state, contacts)

    def stopping(way):
        """How far it is to the edges beyond the component, where it has not left them."""
        along = hull.equations[:, :2] @ way
        left = -hull.equations[:, 2] - hull.equations[:, :2] @ xi
        least = (left[along > 0.0] / along[along > 0.0]).min()
        if least < 0.0:
            return min(0.3 * arm - 10.0 * least, 1.4 * arm)
        return np.clip(least, 0.3 * arm, arm)

    up = robot.weight * np.array([stopping((0.0, -1.0)), stopping((1.0, 0.0)), arm])
    down = robot.weight * np.array([stopping((0.0, 1.0)), stopping((-1.0, 0.0)), arm])
    L = (dynamics.momentum_matrix @ state.v)[3:]
    rate = centroid_drift(robot, state)[1]
    place = slice(EDGES, EDGES + 3)
    # Rows are scaled alike; the scale is what makes A_G of them.
    scale = np.linalg.norm(J[place]) / np.linalg.norm(dynamics.momentum_matrix[3:])
    assert np.allclose(J[place], scale * dynamics.momentum_matrix[3:])
    most = up * np.maximum(1.0 - L / (up * 0.2), 0.0)
    least = -down * np.maximum(1.0 + L / (down * 0.2), 0.0)
    assert np.allclose(upper[place] / scale + rate, most, atol=1e-6)
    assert np.allclose(lower[place] / scale + rate, least, atol=1e-6)


@pytest.mark.parametrize("name", ["g1", "humanoid33"])
@pytest.mark.parametrize("seed", SEEDS)
def test_leg_rows_are_the_second_rate_of_the_distance_of_hip_and_ankle(get_robot, name, seed):
    """Against differences along the motion with constant dv."""
    robot = get_robot(name)
    state = near_home(robot, seed, speed=0.5)
    rows, J, _, _, dynamics = rows_of(robot, state)
    place = slice(EDGES + 3, None)
    dv = np.random.default_rng(seed).normal(size=robot.nv)
    frames = [rows.balance.frame_ids[i : i + 2] for i in (0, 2)]

    def lengths(t):
        q = pin.integrate(robot.model, state.q, t * state.v + 0.5 * t * t * dv)
        there = dynamics_at(robot, q, state.v)
        return np.array(
            [np.linalg.norm(there.placement(a)[0] - there.placement(b)[0]) for a, b in frames]
        )

    step = 1e-4
    second = (lengths(step) - 2.0 * lengths(0.0) + lengths(-step)) / step**2
    drift = rows.evaluation.rows.drift[rows.balance_rows][place]
    assert np.allclose(J[place] @ dv + drift, second, atol=1e-5)
    assert dynamics is not None


@pytest.mark.parametrize("seed", SEEDS)
def test_no_bounds_cross_in_any_state(get_robot, seed):
    robot = get_robot("g1")
    _, _, lower, upper, _ = rows_of(robot, near_home(robot, seed, spread=0.4, speed=5.0))
    assert (lower <= upper).all()
    assert not np.isnan(lower).any()
    assert not np.isnan(upper).any()


def test_a_foothold_ahead_opens_the_way_to_it(get_robot):
    robot, limit = get_robot("g1"), BalanceLimit()
    state = RobotState(robot.q_home, np.zeros(robot.nv))
    foot = [SurfaceContact(next(iter(robot.soles)))]
    rows, *_ = rows_of(robot, state, limit, foot)
    # Over one foot alone the middle of both is outside.
    assert rows.balance.edge_distances.min() < 0.0
    right = dynamics_at(robot, state.q, state.v).placement(robot.frame_id("right_sole"))[0]
    corners = [right[:2] + [s * 0.08, t * 0.03] for s in (1, -1) for t in (1, -1)]
    limit.expect_step(corners)
    dynamics = Dynamics(robot)
    rows.update(dynamics)
    assert rows.balance.edge_distances.min() > 0.0
    limit.expect_step(None)
    rows.update(dynamics)
    assert rows.balance.edge_distances.min() < 0.0


def test_a_contact_counts_once_it_may_carry_half_the_weight(get_robot):
    robot = get_robot("g1")
    state = RobotState(robot.q_home, np.zeros(robot.nv))
    contacts = [SurfaceContact(sole) for sole in robot.soles]
    rows, *_, dynamics = rows_of(robot, state, None, contacts)
    contacts[1].release(1.0)
    distances = []
    for time in (0.0, 0.4, 0.6):
        contacts[1].advance(time)
        rows.update(dynamics)
        distances.append(float(rows.balance.edge_distances.min()))
    assert distances[0] == distances[1] > 0.0 > distances[2]


def test_walls_points_and_the_air_have_no_edges(get_robot):
    robot = get_robot("g1")
    turned = robot.q_home.copy()
    # The whole robot lies on its face: no contact is ground.
    turned[3:7] = [0.0, np.sin(np.pi / 4), 0.0, np.cos(np.pi / 4)]
    for q, contacts in (
        (turned, None),
        (robot.q_home, [PointContact(sole) for sole in robot.soles]),
    ):
        rows, _, _, upper, _ = rows_of(robot, RobotState(q, np.zeros(robot.nv)), None, contacts)
        assert np.isinf(rows.balance.edge_distances).all()
        assert np.isinf(upper[: EDGES + 3]).all()
    stack = default_stack(robot)
    stack.bind(robot)
    assert StackRows(robot, stack, (), balance="before").balance is None


def test_one_switch_takes_it_away_and_a_fixed_base_has_none(get_robot):
    for robot, limit in (
        (get_robot("g1"), BalanceLimit(enabled=False)),
        (get_robot("arm6"), BalanceLimit()),
    ):
        contacts = [SurfaceContact(sole) for sole in robot.soles]
        stack = Stack(contacts, [], balance_limit=limit)
        stack.bind(robot)
        assert StackRows(robot, stack, stack.contacts, balance="before").balance is None


@pytest.mark.parametrize("count", [3, 4, 8, 20])
def test_hulls_are_those_of_qhull(count):
    points = np.random.default_rng(count).normal(size=(count, 2))
    hull = np.zeros((2 * count, 2))
    corners = find_hull(points.copy(), count, hull)
    expected = points[ConvexHull(points).vertices]
    begin = int(np.argmin(np.abs(expected - hull[0]).sum(axis=1)))
    assert np.allclose(hull[:corners], np.roll(expected, -begin, axis=0))


def test_footholds_are_checked(get_robot):
    limit = BalanceLimit()
    with pytest.raises(ConfigurationError, match="serves no robot yet"):
        limit.expect_step(None)
    limit.bind(get_robot("g1"))
    with pytest.raises(PoiseError, match="corners of the next foothold"):
        limit.expect_step([[0.0, np.nan]] * 4)
    with pytest.raises(PoiseError, match="corners of the next foothold"):
        limit.expect_step([[0.0, 0.0]] * 3)


@pytest.mark.parametrize("seed", range(60))
def test_corners_in_line_but_for_the_last_digits_lose_none_of_the_outline(seed):
    """Soles side by side, turned alike, with noise from 1e-17 to 1e-6 m: by support functions."""
    rng = np.random.default_rng(seed)
    noise, angle = 10.0 ** rng.uniform(-17.0, -6.0), rng.choice([0.0, 0.5 * np.pi, rng.normal()])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    rectangle = np.array([[s * 0.1, t * 0.05] for s in (1, -1) for t in (1, -1)])
    feet = [(0.0, 0.1), (rng.choice([0.0, 0.1]), -0.1), (0.2, rng.choice([0.1, 0.3]))]
    points = np.vstack([np.array(foot) + rectangle for foot in feet[: rng.integers(1, 4)]])
    points = points @ turn.T + noise * rng.normal(size=points.shape)
    rng.shuffle(points)
    hull = np.zeros((2 * len(points), 2))
    corners = hull[: find_hull(points.copy(), len(points), hull)]
    directions = np.linspace(0.0, 2.0 * np.pi, 40)
    ways = np.column_stack((np.cos(directions), np.sin(directions)))
    assert np.allclose((corners @ ways.T).max(axis=0), (points @ ways.T).max(axis=0), atol=1e-8)
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack((edges[:, 1], -edges[:, 0]))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    # No point is beyond an edge, however short that is.
    assert (points @ normals.T <= (corners * normals).sum(axis=1) + 1e-8).all()
