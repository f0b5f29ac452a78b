"""A scenario written for one robot, on another: of another size, or without hands."""

import math
from dataclasses import fields, replace

import numpy as np
import pinocchio as pin

from poise.apps.scenarios._by_hand import DevicePlan
from poise.apps.scenarios._drive_plan import DrivePlan
from poise.apps.scenarios._metrics import METRICS
from poise.apps.scenarios._scenario import CheckPlan, Motion, PushPlan, Scenario, WalkPlan
from poise.locomotion import Gait, Stride, WayPoint
from poise.robots import Robot
from poise.sim import Block, PlantConfig
from poise.stack import Stack

_SAME = 1e-3
"""Sizes nearer to each other than this are one: heights in files are rounded."""


def size_ratio(scenario: Scenario, robot: Robot) -> float:
    """How large a robot is, by the one that the scenario's lengths are written for.

    It is the ratio of the heights of their centres of mass at home; one where the scenario says
    nothing of the kind.
    """
    if scenario.reference_com_height is None:
        return 1.0
    height = pin.centerOfMass(robot.model, robot.model.createData(), robot.q_home)[2]
    ratio = float(height) / scenario.reference_com_height
    return 1.0 if abs(ratio - 1.0) < _SAME else ratio


_HANDS = ("left_hand", "right_hand")
"""What descriptions call hands."""

_PLACES = ("left", "right", *_HANDS)
"""What of a way-point is a place, and no turn."""


def without_hands(scenario: Scenario, robot: Robot) -> Scenario:
    """The scenario less what hands do in it, where the robot has none.

    A walk on the robot's own stack goes on without them. What a scenario's own stack asks of hands
    is left: its robot must have them.
    """
    if robot.hands or scenario.stack is not None or scenario.walk is None:
        return scenario
    return replace(
        scenario,
        motions=tuple(m for m in scenario.motions if m.task not in _HANDS),
        checks=tuple(c for c in scenario.checks if c.task not in _HANDS),
    )


def sized(scenario: Scenario, ratio: float) -> Scenario:
    """The scenario with its lengths scaled; not its checks.

    Lengths are those of motions, strides, the gait, blocks and payloads, and places of devices.
    Changes of speed are scaled by the root of the ratio: a pendulum c high takes an equal share of
    its height to brake v = share sqrt(g c). Times, angles, forces and what is given by the arm's
    length stay.
    """
    if ratio == 1.0:
        return scenario
    return replace(
        scenario,
        plant=_plant(scenario.plant, ratio),
        walk=None if scenario.walk is None else _walk(scenario.walk, ratio),
        drive=None if scenario.drive is None else _drive(scenario.drive, ratio),
        devices=None if scenario.devices is None else _devices(scenario.devices, ratio),
        motions=tuple(_motion(motion, ratio) for motion in scenario.motions),
        pushes=tuple(_push(push, math.sqrt(ratio)) for push in scenario.pushes),
    )


def sized_checks(
    checks: tuple[CheckPlan, ...], stack: Stack, ratio: float
) -> tuple[CheckPlan, ...]:
    """Checks with their bounds in metres, or metres a second, scaled.

    Errors of a whole pose, which are metres and radians at once, keep theirs.
    """
    units = {task.name: task.unit for _, task in stack.tasks()}
    return tuple(
        _check(check, ratio)
        if (METRICS[check.metric].unit or units.get(check.task or "")) in ("m", "m/s")
        else check
        for check in checks
    )


def _plant(plant: PlantConfig, ratio: float) -> PlantConfig:
    return replace(
        plant,
        blocks=tuple(_block(block, ratio) for block in plant.blocks),
        payloads=tuple(
            replace(load, offset=_scaled(load.offset, ratio), radius=ratio * load.radius)
            for load in plant.payloads
        ),
    )


def _scaled(place: tuple[float, float, float], ratio: float) -> tuple[float, float, float]:
    x, y, z = place
    return ratio * x, ratio * y, ratio * z


def _block(block: Block, ratio: float) -> Block:
    (x, y), (length, width, height) = block.center, block.size
    return replace(
        block,
        center=(ratio * x, ratio * y),
        size=(ratio * length, ratio * width, ratio * height),
        top=None if block.top is None else ratio * block.top,
    )


def _walk(walk: WalkPlan, ratio: float) -> WalkPlan:
    return replace(
        walk,
        strides=tuple(_stride(stride, ratio) for stride in walk.strides),
        gait=_gait(walk.gait, ratio),
    )


def _drive(drive: DrivePlan, ratio: float) -> DrivePlan:
    speed = math.sqrt(ratio)
    velocities = (
        replace(v, velocity=(speed * v.velocity[0], speed * v.velocity[1], v.velocity[2]))
        for v in drive.velocities
    )
    gait = None if drive.gait is None else _gait(drive.gait, ratio)
    return replace(drive, velocities=tuple(velocities), gait=gait)


def _devices(devices: DevicePlan, ratio: float) -> DevicePlan:
    return replace(devices, points=tuple(_way_point(point, ratio) for point in devices.points))


def _way_point(point: WayPoint, ratio: float) -> WayPoint:
    places = {name: getattr(point, name) for name in _PLACES}
    return replace(
        point,
        **{name: _scaled(place, ratio) for name, place in places.items() if place is not None},
    )


def _stride(stride: Stride, ratio: float) -> Stride:
    return replace(stride, length=ratio * stride.length, sideways=ratio * stride.sideways)


def _gait(gait: Gait, ratio: float) -> Gait:
    return replace(
        gait,
        swing_height=ratio * gait.swing_height,
        crouch=ratio * gait.crouch,
        width=None if gait.width is None else ratio * gait.width,
    )


def _motion(motion: Motion, ratio: float) -> Motion:
    if motion.to is not None:
        return replace(motion, to=ratio * np.asarray(motion.to))
    if motion.by is not None:
        return replace(motion, by=ratio * np.asarray(motion.by))
    return motion


def _push(push: PushPlan, ratio: float) -> PushPlan:
    if push.velocity_change is None:
        return push
    return replace(push, velocity_change=_scaled(push.velocity_change, ratio))


def _check(check: CheckPlan, ratio: float) -> CheckPlan:
    # Only what differs from its default: that of the window's end, infinity, cannot be given.
    given = {f.name: getattr(check, f.name) for f in fields(check)}
    given = {f.name: given[f.name] for f in fields(check) if given[f.name] != f.default}
    given["at_least" if check.at_most is None else "at_most"] = ratio * check.bound
    return CheckPlan(**given)
