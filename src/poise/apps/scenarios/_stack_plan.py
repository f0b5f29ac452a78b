"""`StackPlan`: the stack of a scenario file, from which each run builds its own."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, make_dataclass
from inspect import Parameter, signature
from typing import Annotated, Any, ClassVar, get_type_hints

from pydantic import AfterValidator, BeforeValidator, GetPydanticSchema

from poise._checks import Numbers
from poise._schema import Bounds, Number, Text, Truth, Wanting, checked
from poise.errors import ConfigurationError
from poise.stack import (
    SMOOTH_RATE,
    SOFTENING,
    BalanceLimit,
    ComTask,
    FrameTask,
    JointLimit,
    JointTask,
    MomentumTask,
    PointContact,
    PostureTask,
    RelativeFrameTask,
    SelfCollisionLimit,
    Stack,
    SurfaceContact,
    TorqueLimit,
)

_TASKS: Mapping[str, Callable[..., Any]] = {
    "com": ComTask,
    "frame": FrameTask,
    "relative_frame": RelativeFrameTask,
    "momentum": MomentumTask,
    "joints": JointTask,
    "posture": PostureTask,
}
_CONTACTS: Mapping[str, Callable[..., Any]] = {"surface": SurfaceContact, "point": PointContact}

_Gain = Annotated[Number | list[Number], Wanting("a number, or a list of numbers")]
_Names = Annotated[list[Text], Wanting("a list of texts")]
_IN_FILES: Mapping[Any, Any] = {
    str: Text,
    str | None: Text,
    bool: Truth,
    float: Number,
    float | None: Number,
    Numbers: _Gain,
    Numbers | None: _Gain,
    Sequence[str] | None: _Names,
}
"""Annotation in a file of an argument, by the argument's own."""


class Recipe:
    """Arguments of a class: tasks belong to one robot's run, so that each makes its own."""

    maker: ClassVar[Callable[..., Any]]

    def make(self) -> Any:
        """Make an object of the class."""
        return type(self).maker(**vars(self))


def _arguments(maker: Callable[..., Any]) -> Any:
    """Make a dataclass of the arguments of a class that files may give."""
    hints = get_type_hints(maker.__init__)
    rows = [
        (name, _IN_FILES[hints[name]], field() if p.default is Parameter.empty else p.default)
        for name, p in signature(maker).parameters.items()
        if hints[name] in _IN_FILES
    ]
    # Made once on trial, so that an error of the class has its line of the file.
    members = {"maker": staticmethod(maker), "__post_init__": lambda self: self.make() and None}
    kind = make_dataclass(
        maker.__name__, rows, bases=(Recipe,), namespace=members, frozen=True, kw_only=True
    )
    return checked()(kind)


def _in_files(annotation: Any) -> GetPydanticSchema:
    return GetPydanticSchema(lambda _, handler: handler.generate_schema(annotation))


def _one_of(makers: Mapping[str, Callable[..., Any]]) -> GetPydanticSchema:
    """Read `{kind: {arguments}}`, or `kind` alone for no arguments."""
    defaults = BeforeValidator(lambda given: {} if given is None else given)
    rows = [(kind, Annotated[_arguments(made), defaults], None) for kind, made in makers.items()]

    def only(self: Any) -> None:
        given = [kind for kind in makers if getattr(self, kind) is not None]
        if len(given) != 1:
            raise ConfigurationError("there must be one kind", got=given, choices=makers)

    kinds = make_dataclass("Kinds", rows, namespace={"__post_init__": only}, frozen=True)
    return _in_files(
        Annotated[
            checked()(kinds),
            BeforeValidator(lambda entry: {entry: {}} if isinstance(entry, str) else entry),
            AfterValidator(lambda found: next(made for made in vars(found).values() if made)),
        ]
    )


_TORQUE_LIMIT, _JOINT_LIMIT, _BALANCE_LIMIT, _SELF_COLLISION_LIMIT = map(
    _arguments, (TorqueLimit, JointLimit, BalanceLimit, SelfCollisionLimit)
)


@checked()
@dataclass(frozen=True, kw_only=True)
class StackPlan:
    """A recipe for a `Stack`, with one for each of its parts."""

    contacts: tuple[Annotated[Recipe, _one_of(_CONTACTS)], ...] = ()
    # Tasks of each level, most important level first
    levels: tuple[tuple[Annotated[Recipe, _one_of(_TASKS)], ...], ...] = ()
    torque_limit: Annotated[Recipe, _in_files(_TORQUE_LIMIT)] = field(
        default_factory=lambda: _TORQUE_LIMIT(rate=SMOOTH_RATE)
    )
    joint_limit: Annotated[Recipe, _in_files(_JOINT_LIMIT)] = field(default_factory=_JOINT_LIMIT)
    balance_limit: Annotated[Recipe, _in_files(_BALANCE_LIMIT)] = field(
        default_factory=_BALANCE_LIMIT
    )
    self_collision_limit: Annotated[Recipe, _in_files(_SELF_COLLISION_LIMIT)] = field(
        default_factory=lambda: _SELF_COLLISION_LIMIT(enabled=False)
    )
    softening: Annotated[float, Bounds(least=0.0, unit="m, rad")] = SOFTENING

    def __post_init__(self) -> None:
        self.build()

    def build(self) -> Stack:
        """Make a new stack, not yet bound to a robot."""
        return Stack(
            [contact.make() for contact in self.contacts],
            [[task.make() for task in level] for level in self.levels],
            torque_limit=self.torque_limit.make(),
            joint_limit=self.joint_limit.make(),
            balance_limit=self.balance_limit.make(),
            self_collision_limit=self.self_collision_limit.make(),
            softening=self.softening,
        )
