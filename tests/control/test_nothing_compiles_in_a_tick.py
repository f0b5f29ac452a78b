"""Once a controller is made all that its ticks need is machine code, whatever arrays come."""

import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.caching import FunctionCache
from unchecked import run_unchecked

import poise
from poise.dynamics import RobotState

CONTROLLERS = {
    "whole_body": poise.WholeBodyController,
    "reduced": poise.ReducedController,
    "osf": poise.OperationalSpaceController,
    "closed_form": lambda robot, stack: poise.DifferentialIK(robot, stack, dt=0.002),
    "hqp": lambda robot, stack: poise.DifferentialIK(robot, stack, dt=0.002, strategy="hqp"),
}


def apart(robot, stack):
    """In closed form, with links that are kept apart."""
    limit = poise.SelfCollisionLimit(margin=0.1)
    stack = poise.Stack(stack.contacts, stack.levels, self_collision_limit=limit)
    return poise.DifferentialIK(robot, stack, dt=0.002)


CONTROLLERS["apart"] = apart


def signatures():
    """How often each function with a way in from Python is compiled, by its name."""
    found = {}
    for name, module in list(sys.modules.items()):
        if name.split(".")[0] != "poise":
            continue
        for value in vars(module).values():
            # Parts of compiled functions have no file of their own.
            if isinstance(getattr(value, "_cache", None), FunctionCache):
                found[f"{name}.{value.py_func.__name__}"] = len(value.signatures)
    return found


def tick(name):
    """Signatures before and after ticks of every kind."""
    robot = poise.load_robot("humanoid33")
    stack = poise.default_stack(robot)
    controller = CONTROLLERS[name](robot, stack)
    before, rng = signatures(), np.random.default_rng(0)
    for i in range(12):
        q = robot.q_home.copy()
        q[7:] += 0.02 * rng.normal(size=robot.nj)
        v = 0.1 * rng.normal(size=robot.nv)
        if i == 3:
            stack.contacts[0].release(0.0)
        if i == 6:
            stack.contacts[0].engage(0.1)
        if i == 8:
            stack.task(f"{robot.hands[0]} pose").set_target([10.0, 0.0, 0.0], np.eye(3))
        if i == 9:
            q.flags.writeable = v.flags.writeable = False
        if i == 10:
            q, v = np.repeat(q, 2)[::2], np.repeat(v, 2)[::2]
        controller.step(RobotState(q, v, time=0.1 * i))
    return before, signatures()


TICK = """
import json, sys
sys.path.insert(0, sys.argv[1])
from test_nothing_compiles_in_a_tick import tick
print(json.dumps(tick(sys.argv[2])))
"""


@pytest.mark.parametrize("name", CONTROLLERS)
def test_nothing_is_compiled_in_a_tick(name):
    # In a process of its own: other tests hand over whatever arrays they like.
    before, after = run_unchecked(TICK, Path(__file__).parent, name)
    assert sum(before.values()) > 0
    assert {key: n for key, n in after.items() if n != before.get(key, 0)} == {}
    assert {key: n for key, n in after.items() if n > 1} == {}
