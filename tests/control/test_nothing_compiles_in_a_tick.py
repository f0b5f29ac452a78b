"""Once a controller is made all that its ticks need is machine code, whatever arrays come."""

import sys

import numpy as np
import pytest
from numba.core.caching import FunctionCache
from oracles import near_home

import poise
from poise.dynamics import RobotState


def signatures():
    """What each compiled function of the library was compiled for, by its name."""
    found = {}
    for name, module in list(sys.modules.items()):
        if name.split(".")[0] != "poise":
            continue
        for value in vars(module).values():
            # Parts of compiled functions have no way in from Python, and no file.
            if isinstance(getattr(value, "_cache", None), FunctionCache):
                found[f"{name}.{value.py_func.__name__}"] = tuple(value.signatures)
    return found


CONTROLLERS = {
    "whole_body": poise.WholeBodyController,
    "reduced": poise.ReducedController,
    "osf": poise.OperationalSpaceController,
    "closed_form": lambda robot, stack: poise.DifferentialIK(robot, stack, dt=0.002),
    "hqp": lambda robot, stack: poise.DifferentialIK(robot, stack, dt=0.002, method="hqp"),
}


@pytest.mark.parametrize("name", CONTROLLERS)
def test_nothing_is_compiled_in_a_tick(get_robot, name):
    robot = get_robot("humanoid33")
    stack = poise.default_stack(robot)
    controller = CONTROLLERS[name](robot, stack)
    before = signatures()
    assert any(before.values())
    hand = stack.task(f"{robot.hands[0]} pose")
    for tick in range(12):
        state = near_home(robot, tick, spread=0.02, time=0.1 * tick)
        if tick == 3:
            stack.contacts[0].release(0.0)
        if tick == 6:
            stack.contacts[0].engage(0.1)
        if tick == 8:
            hand.set_target([10.0, 0.0, 0.0], np.eye(3))
        if tick == 9:
            state.q.flags.writeable = state.v.flags.writeable = False
        if tick == 10:
            strided = [np.repeat(x, 2)[::2] for x in (state.q, state.v)]
            state = RobotState(*strided, time=state.time)
        controller.step(state)
    after = signatures()
    assert {k: v for k, v in after.items() if v != before.get(k, ())} == {}
    assert {k: len(v) for k, v in after.items() if len(v) > 1} == {}
