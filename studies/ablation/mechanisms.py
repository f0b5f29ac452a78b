"""`MECHANISMS`: parts of the stepping code, each with the values that switch it off.

`without`: switches some of them off for a while. `counted`: counts when they act.
"""

import math
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pkgutil import resolve_name
from typing import Any
from unittest.mock import patch

from poise.locomotion import WalkSettings

_STEPPING, _WALKING = "poise.locomotion._stepping", "poise.locomotion._walking"
_TASKS, _LEVEL = f"{_STEPPING}._torque_tasks", f"{_STEPPING}._torque_level"
_FLIGHT, _CARRYING = f"{_WALKING}._flight", f"{_WALKING}._stance"

_IMMEDIATE, _FOREVER = 1e-9, 1e6
"""Time constants and time-outs of nothing: finite, for divisions and sums [s]."""

_EVERYTHING = 1e3
"""A rate that reaches the edge of any sole within a tick [m/s]."""


_LOW = 0.02
"""So near to the end of the CoM's way down counts as an act [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Mechanism:
    """A mechanism, and how it is switched off."""

    name: str  # in tables and rows
    # For each attribute, by its dotted name, the value that it has while switched off
    off: Mapping[str, object]
    watched: str  # dotted name of a function of it
    # Says from arguments and result of a call of that whether the mechanism acts
    acts: Callable[[tuple[Any, ...], Any], bool]
    # Whether `Walker` has it by itself, too, and not only the step teleoperator
    walks: bool = False


def _nothing(*_: object, **__: object) -> None:
    """Do nothing, as a method."""


def _never(*_: object, **__: object) -> bool:
    return False


def _same_state(_tare: object, state: object, *_: object) -> object:
    return state


def _usual_weight(*_: object) -> float:
    return 1.0


def _asked_height(_body: object, _feet: object, height: float, *_: object) -> float:
    return height


def _always(*_: object) -> bool:
    return True


def _near_its_end(level: Any) -> bool:
    """Test for a swing with hardly any way down left to the body."""
    devices = level._devices
    return level.mode.single and (devices.falling or devices.room_below < _LOW)


def _of_any_width(single_support_region: Callable[..., Any]) -> Callable[..., Any]:
    """The rest of the ZMP and the end of a weight shift alone, whatever the sole's width."""

    def region(*arguments: Any) -> Any:
        found = single_support_region(*arguments)
        return type(found)(
            sizes=found.sizes, margin=found.margin, arrived=found.arrived, inwards=found.inwards
        )

    return region


def _without_legs(leg_ratios: Callable[..., Any]) -> Callable[..., Any]:
    """Ratios of legs without momentum."""
    return lambda *arguments: leg_ratios(*arguments)._replace(ahead=0.0)


def _update_without_settling(rows: Any, dynamics: Any) -> None:
    """Rows of a stack with joint limits as they are, beside contacts too."""
    rows._stack.joint_limit.evaluate(dynamics)
    rows.evaluation.update(dynamics)
    for contact, cone in rows._cones:
        cone[:] = contact.cone
    rows.update_own(dynamics)


_region = _of_any_width(resolve_name(f"{_WALKING}._parts.single_support_region"))
_led, _caught = resolve_name(f"{_TASKS}._LED"), resolve_name(f"{_TASKS}._CAUGHT")

MECHANISMS = (
    Mechanism(
        name="AnkleStops",
        off={f"{_TASKS}.AnkleStops.update": _nothing},
        watched=f"{_TASKS}.AnkleStops._leave",
        acts=lambda call, _: call[2] or call[3],
    ),
    Mechanism(
        name="TrunkFeedback",
        off={f"{_TASKS}.TrunkFeedback.apply": _nothing},
        watched=f"{_TASKS}.TrunkFeedback.apply",
        acts=lambda call, _: bool(call[1][-3:].any()),
    ),
    Mechanism(
        name="LoadCellTare",
        off={"poise.estimation._load_cells.LoadCellTare.update": _same_state},
        watched="poise.estimation._load_cells.LoadCellTare.update",
        acts=lambda call, state: state is not call[1],
        walks=True,
    ),
    Mechanism(
        name="narrow sole",
        off={
            f"{_WALKING}._parts.single_support_region": _region,
            f"{_STEPPING}._biped.single_support_region": _region,
        },
        watched=f"{_TASKS}.TorqueTasks.lead",
        acts=lambda call, _: call[1].region.narrow and call[1].mode.single,
    ),
    Mechanism(
        name="thrown foot",
        off={f"{_TASKS}._foot_weight": _usual_weight},
        watched=f"{_TASKS}._foot_weight",
        acts=lambda _, weight: weight > 1.0,
    ),
    Mechanism(
        name="capture constants",
        off={
            f"{_LEVEL}._CAPTURE": WalkSettings(),
            f"{_LEVEL}._HIGHER": 1.0,
            f"{_LEVEL}._CLOSING": _FOREVER,
            f"{_LEVEL}._ROCKING": _FOREVER,
            f"{_TASKS}._LED": _led._replace(margin=_caught.margin),
            f"{_TASKS}._CAUGHT": _caught._replace(foot=(1.0,) * 6),
            f"{_TASKS}._RIGHTED": math.inf,
            f"{_TASKS}._EASED": _IMMEDIATE,
        },
        watched=f"{_TASKS}.TorqueTasks.accompany",
        acts=_always,
    ),
    Mechanism(
        name="knees",
        off={
            f"{_LEVEL}.TorqueLevel._limit_stoop": _nothing,
            f"{_STEPPING}._feet.FootDevices._hangs": _never,
        },
        watched=f"{_LEVEL}.TorqueLevel._limit_stoop",
        acts=lambda call, _: _near_its_end(call[0]),
    ),
    Mechanism(
        name="HangWatch, Flight",
        off={
            f"{_WALKING}._trouble._NOISE": 1.0,
            f"{_FLIGHT}._HELD": math.inf,
            f"{_FLIGHT}._SHORT": math.inf,
        },
        watched=f"{_WALKING}._trouble.HangWatch.update",
        acts=lambda call, _: any(call[0]._idle),
        walks=True,
    ),
    Mechanism(
        name="CarryingArea constants",
        off={
            f"{_CARRYING}._SPREAD": _EVERYTHING,
            f"{_CARRYING}._SETTLING": _IMMEDIATE,
            f"{_CARRYING}.LEVEL": 0.0,
            f"{_CARRYING}._FLAT": (0.0, 0.0),
        },
        watched=f"{_CARRYING}.CarryingArea._learn_from",
        acts=lambda call, _: call[0].edges[2:] != call[0].whole[2:],
        walks=True,
    ),
    Mechanism(
        name="BodyHeight reach",
        off={f"{_WALKING}._body.BodyHeight._reached": _asked_height},
        watched=f"{_WALKING}._body.BodyHeight._reached",
        acts=lambda call, height: height < call[2],
        walks=True,
    ),
    Mechanism(
        name="LegMomentum",
        off={
            f"{_WALKING}._parts.leg_ratios": _without_legs(
                resolve_name(f"{_WALKING}._parts.leg_ratios")
            )
        },
        watched=f"{_WALKING}._engine.SteppingEngine._keep_balance",
        acts=lambda call, _: call[0].mode.single,
        walks=True,
    ),
    Mechanism(
        name="bound_settling",
        off={"poise.stack._rows.StackRows.update": _update_without_settling},
        watched="poise.stack._rows.StackRows.update",
        acts=lambda call, _: bool(call[0].settling.velocity.any()),
        walks=True,
    ),
)
"""Mechanisms that runs switch.

- `narrow sole`: the ZMP in single support rests as far inwards as before, and nothing else is done
  for a narrow sole: no room beyond its edges, no announced step, usual step lengths, and no weight
  of a thrown foot either.
- `thrown foot`: a swing foot far from where it is sent weighs as much as any.
- `capture constants`: margin of the ZMP, clearance, bounce time and swing height of a walk, and no
  time-outs; one margin of the pressure, no bound of the trunk's way, the usual weight of feet in
  capture steps, and of the balance right after them.
- `knees`: the body goes as low as in a walk, whatever the knee of the stance leg holds, and a foot
  that does not get down meanwhile comes no nearer to its hip.
- `HangWatch, Flight`: a moment with a load counts as one without, a foot that is held goes on, and
  what a foot meets early is ground.
- `CarryingArea constants`: no memory and no average of the area, and any part of a sole is flat.
- `BodyHeight reach`: the body goes no lower for a foot out of reach.
- `LegMomentum`: the plain pendulum, as if legs were light.
"""

BY_NAME = {mechanism.name: mechanism for mechanism in MECHANISMS}
"""The same by name."""


@contextmanager
def without(names: Iterable[str]) -> Generator[None]:
    """Switch mechanisms off; behind it all of them are as before.

    What is made inside has to be used inside: some values are read when a leader is made.
    """
    with ExitStack() as switched:
        for name in names:
            for attribute, value in BY_NAME[name].off.items():
                switched.enter_context(patch(attribute, value))
        yield


@contextmanager
def counted(names: Iterable[str]) -> Generator[dict[str, int]]:
    """Count the calls in which mechanisms act."""
    counts = dict.fromkeys(names, 0)
    with ExitStack() as watched:
        for name in counts:
            mechanism = BY_NAME[name]
            watched.enter_context(patch(mechanism.watched, _counting(mechanism, counts)))
        yield counts


def _counting(mechanism: Mechanism, counts: dict[str, int]) -> Callable[..., Any]:
    original, acts, name = resolve_name(mechanism.watched), mechanism.acts, mechanism.name

    def call(*arguments: Any, **options: Any) -> Any:
        result = original(*arguments, **options)
        counts[name] += bool(acts(arguments, result))
        return result

    return call
