"""`StackPlan`: the stack of a scenario file, from which each run builds its own."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from inspect import Parameter, signature
from typing import Annotated, Any, get_type_hints

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from poise._checks import Numbers
from poise._schema import (
    Bounds,
    Number,
    Text,
    Truth,
    Wanting,
    checked,
    keyed,
)
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
_IN_FILES: Mapping[Any, Any] = {
    str: Text,
    str | None: Text,
    bool: Truth,
    float: Number,
    float | None: Number,
    Numbers: _Gain,
    Numbers | None: _Gain,
    Sequence[str] | None: list[Text],
}
"""What stands in a file for an argument, by the argument's annotation."""


@dataclass(frozen=True)
class Recipe:
    """A class and the arguments to make one with: tasks belong to one robot's run.

    Attributes:
        maker: the class.
        arguments: by name.
    """

    maker: Callable[..., Any]
    arguments: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def make(self) -> Any:
        """A new one."""
        return self.maker(**self.arguments)


@dataclass(frozen=True)
class _ArgumentsOf:
    """In a file a mapping, whose keys are the arguments of a class."""

    maker: Callable[..., Any]

    def __get_pydantic_core_schema__(self, _: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        hints = get_type_hints(self.maker.__init__)
        kinds = {
            name: core_schema.typed_dict_field(
                handler.generate_schema(_IN_FILES[hints[name]]),
                required=p.default is Parameter.empty,
            )
            for name, p in signature(self.maker).parameters.items()
            if hints[name] in _IN_FILES
        }
        arguments = core_schema.typed_dict_schema(kinds)
        made = core_schema.no_info_after_validator_function(self._recipe, arguments)
        return keyed(kinds, made)

    def _recipe(self, arguments: dict[str, Any]) -> Recipe:
        recipe = Recipe(self.maker, arguments)
        # Made once on trial, so that what a class refuses is said with its line of the file.
        recipe.make()
        return recipe


@dataclass(frozen=True)
class _OneOf:
    """In a file `{kind: {arguments}}`, or the bare word `kind`."""

    makers: Mapping[str, Callable[..., Any]]

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        kinds = {
            name: core_schema.typed_dict_field(
                core_schema.no_info_before_validator_function(
                    lambda given: {} if given is None else given,
                    _ArgumentsOf(maker).__get_pydantic_core_schema__(source, handler),
                ),
                required=False,
            )
            for name, maker in self.makers.items()
        }
        return core_schema.no_info_before_validator_function(
            lambda entry: {entry: {}} if isinstance(entry, str) else entry,
            keyed(
                kinds,
                core_schema.no_info_after_validator_function(
                    self._only, core_schema.typed_dict_schema(kinds)
                ),
            ),
        )

    def _only(self, found: dict[str, Recipe]) -> Recipe:
        if len(found) != 1:
            what = "there must be one kind"
            raise ConfigurationError(what, got=list(found), choices=self.makers)
        return next(iter(found.values()))


@checked()
@dataclass(frozen=True, kw_only=True)
class StackPlan:
    """A recipe for a `Stack`.

    Attributes:
        contacts: the contacts.
        levels: the tasks of each level, most important level first.
        torque_limit: bounds of the torques.
        joint_limit: limits of the joints' positions, velocities and accelerations.
        balance_limit: what keeps tasks from toppling the robot.
        self_collision_limit: what keeps the robot's links off each other.
        softening: s of the weights of the softening terms [m, rad].
    """

    contacts: tuple[Annotated[Recipe, _OneOf(_CONTACTS)], ...] = ()
    levels: tuple[tuple[Annotated[Recipe, _OneOf(_TASKS)], ...], ...] = ()
    torque_limit: Annotated[Recipe, _ArgumentsOf(TorqueLimit)] = Recipe(
        TorqueLimit, {"rate": SMOOTH_RATE}
    )
    joint_limit: Annotated[Recipe, _ArgumentsOf(JointLimit)] = Recipe(JointLimit)
    balance_limit: Annotated[Recipe, _ArgumentsOf(BalanceLimit)] = Recipe(BalanceLimit)
    self_collision_limit: Annotated[Recipe, _ArgumentsOf(SelfCollisionLimit)] = Recipe(
        SelfCollisionLimit, {"enabled": False}
    )
    softening: Annotated[float, Bounds(least=0.0, unit="m, rad")] = SOFTENING

    def __post_init__(self) -> None:
        self.build()

    def build(self) -> Stack:
        """A new stack, not yet bound to a robot."""
        return Stack(
            [contact.make() for contact in self.contacts],
            [[task.make() for task in level] for level in self.levels],
            torque_limit=self.torque_limit.make(),
            joint_limit=self.joint_limit.make(),
            balance_limit=self.balance_limit.make(),
            self_collision_limit=self.self_collision_limit.make(),
            softening=self.softening,
        )
