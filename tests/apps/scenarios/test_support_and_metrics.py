"""Support polygons, ZMP margins and metrics against cases worked out by hand."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.apps.report import BaseErrors, RunSignals, SoleTrack, SupportPhase, TaskTrack
from poise.apps.scenarios._metrics import METRICS
from poise.apps.scenarios._scenario import PushPlan
from poise.apps.scenarios._signals import (
    ground_heights,
    support_phases,
    zmp_margins,
)
from poise.sim import Block, PlantConfig

NAN = float("nan")


def as_set(points):
    """Up to the grid of 4 nm on which outlines are exact."""
    return {tuple(np.round(p, 8)) for p in points}


def still(robot, count):
    """Soles at y = 0.1 and -0.1, side by side."""
    poses = {}
    for name, y in zip(robot.soles, (0.1, -0.1), strict=True):
        poses[name] = (np.tile([0.0, y, 0.0], (count, 1)), np.tile(np.eye(3), (count, 1, 1)))
    return poses


def test_phases_follow_the_soles_on_the_ground(get_robot):
    robot = get_robot("humanoid33")
    left, right = robot.soles
    half = 0.5 * np.array([robot.soles[left].length, robot.soles[left].width])
    time = np.arange(1, 9) * 0.1
    planned = {
        left: np.array([1, 1, 1, 0, 0, 0, 0, 1.0]),
        right: np.array([1, 1, 1, 1, 1, 0, 0, 1.0]),
    }
    phases = support_phases(robot, time, planned, still(robot, 8))
    assert [p.label for p in phases] == [f"{left} + {right}", right, "flight", f"{left} + {right}"]
    assert [p.start for p in phases] == pytest.approx([0.1, 0.4, 0.6, 0.8])
    assert [p.end for p in phases[:-1]] == pytest.approx([0.4, 0.6, 0.8])
    both, one, none, _ = (p.vertices for p in phases)
    x, y = half
    assert as_set(both) == as_set([(x, 0.1 + y), (-x, 0.1 + y), (-x, -0.1 - y), (x, -0.1 - y)])
    assert as_set(one) == as_set([(x, y - 0.1), (-x, y - 0.1), (-x, -y - 0.1), (x, -y - 0.1)])
    assert none.shape == (0, 2)


def test_the_margin_is_the_distance_to_the_nearest_edge_and_negative_outside():
    square = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
    phases = (
        SupportPhase(start=0.0, end=0.5, vertices=square, label="a"),
        SupportPhase(start=0.5, end=0.7, vertices=np.zeros((0, 2)), label="flight"),
        SupportPhase(start=0.7, end=1.0, vertices=square + [1.0, 0.0], label="b"),
    )
    time = np.array([0.0, 0.1, 0.2, 0.3, 0.6, 0.8])
    zmp = np.array([[0, 0], [0.07, 0.02], [0.1, 0.0], [0.13, 0.05], [0, 0], [1.0, -0.11]])
    margins = zmp_margins(time, zmp.astype(np.float64), phases)
    np.testing.assert_allclose(margins[[0, 1, 2, 3, 5]], [0.1, 0.03, 0.0, -0.03, -0.01], atol=1e-12)
    assert np.isnan(margins[4])


def test_the_ground_is_the_floor_and_above_it_the_tops_of_blocks():
    points = np.array([[0.0, 0.2], [1.05, 0.0], [1.15, 0.0], [2.05, 0.03], [2.05, -0.3]])
    floor = ground_heights(PlantConfig(floor_slope=(0.1, 0.0)), points)
    np.testing.assert_allclose(floor, points[:, 1] * np.tan(0.1), atol=1e-12)
    flat = Block(center=(1.0, 0.0), size=(0.2, 0.4, 0.05))
    ramp = Block(center=(2.0, 0.0), size=(0.4, 0.2, 0.3), tilt=(0.0, 0.2), top=0.1, told=False)
    sunk = Block(center=(0.0, 0.0), size=(1.0, 1.0, 0.3), top=-0.1, told=False)
    heights = ground_heights(PlantConfig(blocks=(flat, ramp, sunk)), points)
    # A ramp that is turned about y goes down along x.
    np.testing.assert_allclose(heights, [0.0, 0.05, 0.0, 0.1 - 0.05 * np.tan(0.2), 0.0], atol=1e-12)


def signals():
    """Eleven ticks of 0.05 s; the CoM moves along x by 0.01 m a tick, the reference stays."""
    n = 11
    time = 0.05 * np.arange(1, n + 1)
    com = np.zeros((n, 3))
    com[:, 0] = 0.01 * np.arange(n)
    com[3, 2] = 0.5
    reference = np.zeros((n, 3))
    reference[-1] = NAN
    torque = np.zeros((n, 2))
    torque[4] = [-30.0, 5.0]
    residuals = np.zeros((n, 3))
    residuals[6] = [1e-9, 2e-3, NAN]
    # Turned by 0.4 rad a tick to the left, and tilted ahead by 0.3 rad once.
    turns = Rotation.from_euler("z", 0.4 * np.arange(n)[:, None])
    tilts = Rotation.from_euler("y", np.where(np.arange(n) == 5, 0.3, 0.0)[:, None])
    q = np.zeros((n, 9))
    q[:, 3:7] = (turns * tilts).as_quat()
    wrench = np.zeros((n, 6))
    wrench[:, 2] = np.linspace(0.0, 100.0, n)
    sole = SoleTrack(
        position=np.linspace([0.0, 0.0, 0.1], np.zeros(3), n),
        height=np.linspace(0.08, -0.02, n),
        wrench=wrench,
        planned=np.array([1.0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0]),
    )
    error = np.array([NAN, 0.3, *[0.1] * 8, 0.05])
    hand = TaskTrack(name="hand", level=0, unit="m", error=error)
    return RunSignals(
        robot="r", controller="c", scenario="s", joint_names=("a", "b"),
        position_min=-np.ones(2), position_max=np.ones(2),
        time=time, q=q, torque=torque, torque_max=np.array([60.0, 50.0]),
        com=com, com_reference=reference, zmp=np.zeros((n, 2)),
        zmp_reference=np.linspace([0.0, 0.0], [0.3, 0.4], n),
        zmp_margin=np.array([NAN, 0.03, 0.02, -0.01, *[0.05] * 7]), support=(),
        soles={"s": sole}, targets={}, tasks=(hand,), level_names=("a", "b", "c"),
        residuals=residuals, status=("ok",) * n, tick_us={"solve": np.ones(n)},
        tick_budget_us=1000.0,
        base_errors=BaseErrors(
            drift=np.linspace(0.0, 0.04, n), tilt=np.full(n, 0.01), speed=np.full(n, 0.02)
        ),
        clearance=np.array([NAN, 0.2, 0.03, *[0.1] * (n - 3)]),
        self_contact=np.array([0.0, 0.0, 7.0, *[1.0] * (n - 3)]), beyond=np.linspace(-0.5, 0.02, n),
        modes=(),
    )  # fmt: skip


CASES = [
    ("com_error_max", "", None, np.hypot(0.03, 0.5), 3),
    ("com_error_max", "", 0, 0.09, 9),
    ("com_error_rms", "", 0, np.sqrt(np.mean(np.arange(10.0) ** 2)) * 0.01, None),
    ("com_travel", "", 0, 0.1, None),
    ("com_travel", "", 1, 0.0, ...),
    ("com_travel", "", None, np.hypot(0.1, 0.5), ...),
    ("com_speed_end", "", None, 0.2, 10),
    ("task_error_max", "hand", None, 0.3, 1),
    ("task_error_rms", "hand", None, np.sqrt((0.3**2 + 8 * 0.1**2 + 0.05**2) / 10), ...),
    ("task_error_end", "hand", None, 0.05, 10),
    ("torque_ratio_max", "", None, 0.5, 4),
    ("torque_step_max", "", None, 0.5, 4),
    ("base_tilt_max", "", None, 0.3, ...),
    ("base_turned", "", None, 4.0, ...),
    ("sole_force_max", "s", None, 100.0, 10),
    ("sole_height_min", "s", None, -0.02, 10),
    ("residual_max", "1", None, 1e-9, ...),
    ("residual_max", "2", None, 2e-3, 6),
    ("zmp_margin_min", "", None, -0.01, 3),
    ("zmp_error_max", "", None, 0.5, 10),
    ("steps_made", "", None, 2.0, None),
    ("clearance_min", "", None, 0.03, 2),
    ("self_contact_max", "", None, 7.0, 2),
    ("beyond_blocks_end", "", None, 0.02, 10),
    ("drift_max", "", None, 0.04, ...),
    ("tilt_error_rms", "", None, 0.01, ...),
    ("velocity_error_rms", "", None, 0.02, ...),
]


@pytest.mark.parametrize(("metric", "subject", "axis", "value", "row"), CASES)
def test_a_metric_measures_what_it_says_and_names_the_worst_moment(
    metric, subject, axis, value, row
):
    run = signals()
    rows = np.ones(len(run.time), dtype=bool)
    found = METRICS[metric].measure(run, subject, axis, rows)
    assert found.value == pytest.approx(value)
    if row is not ...:
        assert found.row == row


def test_every_metric_is_measured_and_says_nan_where_there_is_nothing():
    run = signals()
    nothing = np.zeros(len(run.time), dtype=bool)
    assert {case[0] for case in CASES} == set(METRICS)
    for metric, subject, axis, *_ in CASES:
        value, row = METRICS[metric].measure(run, subject, axis, nothing)
        assert np.isnan(value)
        assert row is None


def test_a_push_is_a_force_or_a_change_of_speed_of_the_whole_robot():
    common = {"body": "torso", "at": 0.0, "duration": 0.1}
    assert PushPlan(**common, force=(1.0, 2.0, 3.0)).force_on(80.0) == (1.0, 2.0, 3.0)
    force = PushPlan(**common, velocity_change=(0.2, 0.0, -0.1)).force_on(80.0)
    assert force == pytest.approx((160.0, 0.0, -80.0))
