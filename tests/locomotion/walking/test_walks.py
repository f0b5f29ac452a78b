"""Short walks in MuJoCo, in processes of their own, where nothing checks shapes."""

import pytest
from slow import slow
from unchecked import run_unchecked

pytest.importorskip("mujoco")

SCRIPT = """
import json, math, sys
import numpy as np
import poise
from poise.locomotion import Gait, Walker, Stride, plan_footsteps, walking_stack

robot = poise.load_robot(sys.argv[1])
push = [float(x) for x in sys.argv[2:4]]
stack = walking_stack(robot)
gait = Gait(step_time=0.8, crouch=0.02, shift_time=0.8, settle_time=1.0)
plan = plan_footsteps(robot, [Stride(steps=4, length=0.15, turn=0.03)], gait)
walker = Walker(robot, stack, plan=plan)
controller = poise.WholeBodyController(robot, stack)
plant = poise.sim.Plant(robot, poise.sim.PlantConfig(control_dt=0.002))
plant.push("torso", (push[0] * robot.mass / 0.1, push[1] * robot.mass / 0.1, 0.0), 0.1, 2.0)
footholds = [*plan.start, *(step.goal for step in plan.steps)]
com, feet, moved, missed = [], [], [], 0
while plant.time < plan.duration + 0.1 and not plant.fallen:
    state = plant.state()
    walker.lead(state)
    command = controller.step(state)
    plant.step(command)
    missed += not command.status.ok
    com.append(float(np.linalg.norm(stack.task("com").error)))
    moved += [
        min(math.dist(foot.position, place.position) for place in footholds)
        for foot in walker._engine.parts.stance.feet
    ]
    feet += [
        float(np.linalg.norm(stack.task(name).error))
        for name in ("left_foot", "right_foot")
        if stack.task(name) not in controller.suspended
    ]
print(json.dumps({
    "fallen": plant.fallen, "status": walker.status.value, "steps": walker.steps_made,
    "com": max(com), "end": com[-1], "foot": max(feet), "missed": missed, "moved": max(moved),
    "x": float(plant.com[0]),
}))
"""


def walked(robot, push=(0.0, 0.0)):
    return run_unchecked(SCRIPT, robot, *push)


@pytest.mark.parametrize("robot", [slow("humanoid33"), "g1"])
def test_a_robot_walks_its_plan(get_robot, robot):
    get_robot(robot)
    walk = walked(robot)
    assert not walk["fallen"]
    assert (walk["status"], walk["steps"], walk["missed"]) == ("standing", 5, 0)
    assert walk["com"] < 0.01
    assert walk["foot"] < 0.015
    assert walk["x"] > 0.5


@pytest.mark.slow
def test_a_push_moves_a_foothold_and_the_walk_goes_on():
    walk = walked("humanoid33", (0.0, 0.3))
    assert not walk["fallen"]
    assert (walk["status"], walk["steps"]) == ("standing", 5)
    assert walk["moved"] > 0.03
    assert walk["com"] < 0.08
    assert walk["end"] < 0.01
