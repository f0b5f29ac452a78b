"""`StackPlan`: the stack of a scenario file, from which each run builds its own."""

from collections.abc import Callable
from typing import Any

from poise._fields import Fields
from poise.errors import ScenarioError
from poise.stack import (
    ComTask,
    Contact,
    FrameTask,
    JointLimit,
    JointTask,
    MomentumTask,
    PointContact,
    PostureTask,
    RelativeFrameTask,
    Stack,
    SurfaceContact,
    Task,
    TorqueLimit,
)

_COMMON = ("kp", "kd", "weight", "name")


class StackPlan:
    """A recipe for a `Stack`: tasks belong to one robot, so every run needs its own.

    Args:
        data: the section of the file: contacts, levels, torque_limit, joint_limit.
        where: the file and the key, for messages.

    Raises:
        ScenarioError: an unknown key, a missing key, or a value of the wrong kind.
        ConfigurationError: values that cannot be right, such as a negative gain.
    """

    def __init__(self, data: object, where: str) -> None:
        self._data, self._where = data, where
        self.build()

    def build(self) -> Stack:
        """A new stack, not yet bound to a robot."""
        keys = ("contacts", "levels", "torque_limit", "joint_limit")
        fields = Fields(self._data, self._where, keys, error=ScenarioError)
        levels = [
            [self._task(entry, f"level {i + 1}, entry {k + 1}") for k, entry in enumerate(level)]
            for i, level in enumerate(self._lists(fields, "levels"))
        ]
        contacts = [
            self._contact(entry, f"contact {i + 1}")
            for i, entry in enumerate(self._list(fields, "contacts"))
        ]
        return Stack(
            contacts,
            levels,
            torque_limit=TorqueLimit(**_numbers(fields.section("torque_limit", ("scale",)))),
            joint_limit=JointLimit(
                **_numbers(
                    fields.section(
                        "joint_limit",
                        (
                            "acceleration_max",
                            "braking",
                            "horizon",
                            "position_margin",
                            "velocity_scale",
                        ),
                    )
                )
            ),
        )

    def _task(self, entry: object, what: str) -> Task:
        return _one_of(entry, f"{self._where}, {what}", _TASKS)

    def _contact(self, entry: object, what: str) -> Contact:
        return _one_of(entry, f"{self._where}, {what}", _CONTACTS)

    def _list(self, fields: Fields, key: str) -> list[Any]:
        value = fields.raw(key) if key in fields else []
        if not isinstance(value, list):
            raise ScenarioError(
                f"{self._where}: {key} has the wrong kind", got=value, wanted="a list"
            )
        return value

    def _lists(self, fields: Fields, key: str) -> list[list[Any]]:
        levels = self._list(fields, key)
        for i, level in enumerate(levels):
            if not isinstance(level, list):
                raise ScenarioError(
                    f"{self._where}: level {i + 1} has the wrong kind", got=level, wanted="a list"
                )
        return levels


def _one_of(entry: object, where: str, makers: dict[str, Callable[[Fields], Any]]) -> Any:
    """Reads `{kind: {...}}` or the bare word `kind`."""
    if isinstance(entry, str):
        entry = {entry: {}}
    fields = Fields(entry, where, makers, error=ScenarioError)
    kinds = list(fields)
    if len(kinds) != 1:
        raise ScenarioError(f"{where} must name one kind", got=kinds, choices=makers)
    data = fields.raw(kinds[0])
    return makers[kinds[0]](
        Fields({} if data is None else data, f"{where} ({kinds[0]})", error=ScenarioError)
    )


def _gains(fields: Fields, *extra: str) -> dict[str, Any]:
    """Gains, weight and name, with the keys checked."""
    _known(fields, (*_COMMON, *extra))
    found: dict[str, Any] = {}
    for key in ("kp", "kd", "weight"):
        if key in fields:
            value = fields.raw(key)
            found[key] = (
                fields.numbers(key, len(value)) if isinstance(value, list) else fields.number(key)
            )
    if "name" in fields:
        found["name"] = fields.text("name")
    return found


def _known(fields: Fields, keys: tuple[str, ...]) -> None:
    for key in fields:
        if key not in keys:
            raise ScenarioError(f"unknown key in {fields.where}", got=key, choices=keys)


def _axes(fields: Fields, default: str) -> str:
    return fields.text("axes") if "axes" in fields else default


def _com(fields: Fields) -> Task:
    return ComTask(_axes(fields, "position"), **_gains(fields, "axes"))


def _frame(fields: Fields) -> Task:
    return FrameTask(fields.text("frame"), _axes(fields, "pose"), **_gains(fields, "frame", "axes"))


def _relative(fields: Fields) -> Task:
    return RelativeFrameTask(
        fields.text("frame"),
        fields.text("root"),
        _axes(fields, "pose"),
        **_gains(fields, "frame", "root", "axes"),
    )


def _momentum(fields: Fields) -> Task:
    _known(fields, ("axes", "kd", "weight", "name"))
    return MomentumTask(_axes(fields, "angular"), **_gains(fields, "axes"))


def _joints(fields: Fields) -> Task:
    return JointTask(fields.texts("joints"), **_gains(fields, "joints"))


def _posture(fields: Fields) -> Task:
    return PostureTask(**_gains(fields))


def _surface(fields: Fields) -> Contact:
    keys = ("friction", "length", "width", "torsion", "margin", "damping", "min_load")
    _known(fields, ("frame", "name", *keys))
    return SurfaceContact(fields.text("frame"), **_numbers(fields, keys), **_name(fields))


def _point(fields: Fields) -> Contact:
    keys = ("friction", "damping", "min_load")
    _known(fields, ("frame", "name", *keys))
    return PointContact(fields.text("frame"), **_numbers(fields, keys), **_name(fields))


def _numbers(fields: Fields, keys: tuple[str, ...] | None = None) -> dict[str, Any]:
    return {key: fields.number(key) for key in fields if keys is None or key in keys}


def _name(fields: Fields) -> dict[str, Any]:
    return {"name": fields.text("name")} if "name" in fields else {}


_TASKS: dict[str, Callable[[Fields], Task]] = {
    "com": _com,
    "frame": _frame,
    "relative_frame": _relative,
    "momentum": _momentum,
    "joints": _joints,
    "posture": _posture,
}

_CONTACTS: dict[str, Callable[[Fields], Contact]] = {"surface": _surface, "point": _point}
