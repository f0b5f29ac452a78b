"""Scenario files with anything in them: they work or raise a PoiseError, and nothing else."""

import copy
import random
from functools import cache

import pytest
import yaml
from dry_run import forbid_ticks, loaded, prepare

from poise.apps.scenarios import (
    _scenario as reader,
    _stage as stage_module,
    shipped_scenarios,
)
from poise.apps.scenarios._scenario import SHIPPED
from poise.errors import PoiseError
from poise.sim import Plant

ODD = (
    None, True, False, 0, -1, 1, 3, 10**400, -(10**30), 1e-300, -1e-9, 0.001, 0.5, 1e9, 1e308,
    float("nan"), float("inf"), -float("inf"), "", " ", "5 kg", "x", "\0", "a\nb", "y" * 300, "é",
    "com", "left_sole", "right_hand", "position", "orientation_xz", "xyz", "osqp", "cascade",
    [], [[]], [1.0], [1.0, 2.0, 3.0], [0.0, 0.0, 0.0], [float("nan")] * 3, ["left_sole"], ["x", 1],
    [None], {}, {"x": 1}, {"com": {}}, {1: 2}, {"joints": {"left_knee": 0.5}},
)  # fmt: skip

WHOLE = """
name: whole
robot: humanoid33
duration: 2.0
seed: 3
controller: {name: whole_body, strategy: direct, time_limit: 0.05}
plant:
  actuation: torque
  control_dt: 0.002
  physics_dt: 0.001
  servo: {stiffness: 10.0, damping: 0.2}
  sensors: {encoder_resolution: 0.0001, gyro_noise: 0.002, delay: 0.002}
  friction: 0.8
  contact_time_constant: 0.005
  floor_slope: [0.0, 0.01]
  blocks:
    - {center: [0.5, 0.0], size: [0.3, 0.4, 0.02], yaw: 0.1}
  mass_scale: 1.05
  link_errors:
    - {link: torso_link, mass_scale: 1.1, com_offset: [0.01, 0.0, 0.0]}
  payloads:
    - {frame: left_hand, mass: 2.0, offset: [0.0, 0.0, 0.1], radius: 0.05}
  joint_damping: 0.1
  joint_friction: 0.1
  fall_height_ratio: 0.5
stack:
  contacts:
    - surface: {frame: left_sole, friction: 0.5, margin: 0.01, length: 0.2, width: 0.1}
    - point: {frame: right_sole, friction: 0.5, damping: 10.0, min_load: 0.01, name: right}
  levels:
    - - com: {axes: xy, kp: 60, kd: [10.0, 12.0]}
      - momentum: {axes: angular_xy, kd: 5, weight: 0.1}
    - - relative_frame: {frame: left_hand, root: torso, axes: position, kp: 80, name: hand}
      - frame: {frame: right_hand, kp: 80}
      - joints: {joints: [left_knee], kp: 50, weight: 2.0}
    - - posture
  torque_limit: {scale: 0.7}
  joint_limit: {position_margin: 0.05, velocity_scale: 0.9}
motions:
  - {task: com, at: 0.1, over: 1.0, above: [left_sole, right_sole]}
  - {task: right_hand pose, at: 0.1, over: 0.5, turn: [0.0, 0.0, 0.3]}
  - {task: right_hand pose, at: 0.3, over: 0.5, by: [0.0, 0.0, 0.3]}
  - {task: posture, at: 0.1, over: 0.5, joints: {left_elbow: -0.5}}
contacts:
  - {unload: left_sole, at: 0.2, over: 0.3}
  - {load: left_sole, at: 1.0, over: 0.3, touchdown: 10.0}
pushes:
  - {body: torso, at: 1.0, duration: 0.1, force: [10.0, 0.0, 0.0]}
checks:
  - {metric: com_error_max, axis: x, at_most: 0.01, from: 0.5, until: 1.0}
  - {metric: residual_max, level: 3, at_most: 0.5}
"""


@cache
def plant_of(robot, config):
    return Plant(robot, config)


def plant(robot, config, *, seed):
    """A plant that is built once for each configuration, and forgets its pushes."""
    made = plant_of(robot, config)
    made.reset()
    return made


@pytest.fixture(autouse=True)
def _no_ticks(monkeypatch):
    forbid_ticks(monkeypatch, times=(0.0, 0.05, 0.3, 0.3001, 0.8, 1.0))
    monkeypatch.setattr(stage_module, "load_robot", lambda name: loaded(str(name)))
    monkeypatch.setattr(stage_module, "Plant", plant)


def places(data, path=()):
    """Every place of a tree of mappings and lists."""
    items = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in items:
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from places(value, (*path, key))


def mutated(data, rng):
    """The tree with one to three places dropped, doubled, renamed or replaced by odd things."""
    data = copy.deepcopy(data)
    for _ in range(rng.choice((1, 1, 2, 3))):
        where = list(places(data))
        if not where:
            return data
        *path, key = rng.choice(where)
        parent = data
        for step in path:
            parent = parent[step]
        change = rng.randrange(6)
        if change == 0:
            del parent[key]
        elif change == 1 and isinstance(parent, dict):
            parent[rng.choice(("x", "kpp", key + "s" if isinstance(key, str) else "k"))] = (
                parent.pop(key)
            )
        elif change == 2 and isinstance(parent[key], int | float):
            parent[key] = rng.choice(
                (-parent[key], 1e3 * parent[key], str(parent[key]), [parent[key]])
            )
        elif change == 3:
            parent[key] = copy.deepcopy(
                parent[rng.choice(list(parent))] if isinstance(parent, dict) else parent[0]
            )
        else:
            parent[key] = copy.deepcopy(rng.choice(ODD))
    return data


def bases():
    shipped = [yaml.safe_load((SHIPPED / f"{n}.yaml").read_text()) for n in shipped_scenarios()]
    return shipped + [yaml.safe_load(WHOLE)] * 5


def checked(work, kept):
    """Whether a piece of work was refused; any exception but a PoiseError fails with its input."""
    try:
        work()
    except PoiseError:
        return True
    except Exception as error:
        raise AssertionError(f"raised {error!r} for:\n{kept}") from error
    return False


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("seed", range(3))
def test_mutated_files_get_to_their_first_tick_or_raise_a_poise_error(seed, monkeypatch):
    rng, count, starts = random.Random(seed), 60, bases()
    refused = 0
    for _ in range(count):
        data = mutated(rng.choice(starts), rng)
        # The trees go in without the detour over text, which takes longer than all the rest.
        monkeypatch.setattr(reader, "read_yaml", lambda *_, data=data, **__: data)
        refused += checked(lambda: prepare(""), data)
    assert count / 4 < refused < count


def test_every_number_may_be_extreme(monkeypatch):
    numbers = [1e-300, 1e-12, -1.0, 0, 1e6, 1e308, 10**400, float("nan"), float("inf"), True]
    rng, start = random.Random(300), yaml.safe_load(WHOLE)
    for *path, key in list(places(start)):
        data = copy.deepcopy(start)
        parent = data
        for step in path:
            parent = parent[step]
        if isinstance(parent[key], int | float):
            for number in rng.sample(numbers, 2):
                parent[key] = number
                monkeypatch.setattr(reader, "read_yaml", lambda *_, data=data, **__: data)
                checked(lambda: prepare(""), data)
