"""A scenario made ready and its references played, without a tick of the plant."""

from dataclasses import replace
from functools import cache

from poise.apps.scenarios import _run as run_module, _stage as stage_module, parse_scenario
from poise.dynamics import RobotState
from poise.robots import load_robot


class FirstTickError(Exception):
    """Everything before the first tick went well."""


@cache
def loaded(name):
    return load_robot(name)


def forbid_ticks(monkeypatch, times=()):
    """Make a run stop where its first tick would be, after its references at some share of it."""

    def no_rollout(plant, controller, leader, observers, *, estimator, duration):
        state = plant.state()
        for share in times:
            leader.lead(replace_time(state, share * duration))
        raise FirstTickError

    def no_step(*_):
        raise AssertionError("the plant was told to move")

    monkeypatch.setattr(run_module, "rollout", no_rollout)
    monkeypatch.setattr(stage_module.Plant, "step", no_step)


def replace_time(state: RobotState, time: float) -> RobotState:
    return replace(state, time=time)


def prepare(text):
    """Parse a scenario and make it ready; `forbid_ticks` must have been called."""
    try:
        run_module.run_scenario(parse_scenario(text, "fuzz.yaml"))
    except FirstTickError:
        return
    raise AssertionError("the run went on")
