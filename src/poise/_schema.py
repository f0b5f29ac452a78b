"""Schemas: a dataclass says once what its fields may be, for callers and for files alike.

`checked` makes a dataclass check its fields when it is made; `read` makes one from the content of a
file. Pydantic looks at kinds, bounds and nesting, after each field's annotation; what is wrong is
said in the words of `poise.errors`, with the line of the file.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, dataclass, fields
from functools import cache, partial, wraps
from inspect import signature
from typing import Annotated, Any, TypeVar, get_type_hints

import numpy as np
from jaxtyping import Float64
from pydantic import (
    ConfigDict,
    GetCoreSchemaHandler,
    Strict,
    StringConstraints,
    TypeAdapter,
    ValidationError,
)
from pydantic.fields import FieldInfo
from pydantic_core import (
    ArgsKwargs,
    CoreSchema,
    PydanticCustomError,
    SchemaValidator,
    core_schema,
)

from poise.errors import ConfigurationError, PoiseError

LARGEST = 1e9
"""No number is larger, whatever its unit: no robot needs it, and its powers overflow."""

NOT_IN_FILES = {"in_files": False}
"""Metadata of a dataclass's field that is no key of a file."""

T = TypeVar("T")

_WANTED = {
    "dataclass_type": "keys with values",
    "dict_type": "keys with values",
    "tuple_type": "a list",
}
"""What Pydantic's own errors want, in our words."""


_CONFIG = ConfigDict(extra="forbid", arbitrary_types_allowed=True, populate_by_name=True)


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """What a number has to be; finite in any case, and no truth value.

    Attributes:
        positive: whether it is above zero.
        least: it is this or larger; `-most` where it need not be positive either.
        below: it is smaller than this.
        most: it is no larger than this.
        whole: whether it is a whole number.
        unit: for messages.
    """

    positive: bool = False
    least: float | None = None
    below: float | None = None
    most: float = LARGEST
    whole: bool = False
    unit: str = ""

    @property
    def wanted(self) -> str:
        """What is wanted, in words."""
        kind = "whole number" if self.whole else "number"
        upper = f"below {self.below:g}" if self.below is not None else f"up to {self.most:g}"
        if self.positive:
            said = f"a positive {kind} {upper}"
        elif self.least is not None:
            said = f"a {kind} of at least {self.least:g}, {upper}"
        else:
            said = f"a {kind} from {-self.most:g} to {self.most:g}"
        return f"{said} [{self.unit}]" if self.unit else said

    def __get_pydantic_core_schema__(self, _: Any, __: GetCoreSchemaHandler) -> CoreSchema:
        least = -self.most if self.least is None else self.least
        schema = core_schema.no_info_before_validator_function(
            _as_plain,
            core_schema.float_schema(
                strict=True,
                allow_inf_nan=False,
                gt=0.0 if self.positive else None,
                ge=None if self.positive else least,
                lt=self.below,
                le=self.most,
                multiple_of=1.0 if self.whole else None,
            ),
        )
        if self.whole:
            schema = core_schema.no_info_after_validator_function(int, schema)
        return _wanting(self.wanted, schema)


@dataclass(frozen=True)
class Wanting:
    """Says in our words what a value has to be, whatever Pydantic has found.

    Attributes:
        wanted: what, as in "a list of texts".
    """

    wanted: str

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return _wanting(self.wanted, handler(source))


@dataclass(frozen=True)
class Vector:
    """A list of so many numbers, which becomes a tuple, or an array where that is annotated.

    Attributes:
        count: how many.
        each: what each has to be.
    """

    count: int
    each: Bounds = Bounds()

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        number = self.each.__get_pydantic_core_schema__(source, handler)
        schema = core_schema.no_info_before_validator_function(
            self._counted, core_schema.tuple_positional_schema([number] * self.count)
        )
        if getattr(source, "__origin__", None) is tuple:
            return schema
        return core_schema.no_info_after_validator_function(np.array, schema)

    def _counted(self, value: object) -> object:
        items = value.tolist() if isinstance(value, np.ndarray) else value
        if not isinstance(items, list | tuple) or len(items) != self.count:
            raise PydanticCustomError("wanted", "{count} numbers", {"count": self.count})
        return items


Text = Annotated[
    str,
    StringConstraints(strict=True, strip_whitespace=True, min_length=1),
    Wanting("a text"),
]
"""A text that is not empty, without the space around it."""

AnyText = Annotated[str, StringConstraints(strict=True, strip_whitespace=True), Wanting("a text")]
"""A text that may be empty: a description, or a name that its look-up refuses with the choices."""

Truth = Annotated[bool, Strict(), Wanting("true or false")]
Number = Annotated[float, Bounds()]
Positive = Annotated[float, Bounds(positive=True)]
NotNegative = Annotated[float, Bounds(least=0.0)]
Ratio = Annotated[float, Bounds(positive=True, below=1.0)]
Seconds = Annotated[float, Bounds(least=0.0, unit="s")]
Duration = Annotated[float, Bounds(positive=True, unit="s")]
Count = Annotated[int, Bounds(least=1.0, whole=True)]
Triple = Annotated[tuple[float, float, float], Vector(3)]
Point = Annotated[Float64[np.ndarray, "3"], Vector(3)]


def checked(
    error: type[PoiseError] = ConfigurationError, *, removed: Mapping[str, str] | None = None
) -> Callable[[type[T]], type[T]]:
    """Makes a dataclass check its fields by their annotations whenever one is made.

    Lists become the tuples that are annotated, whole numbers floats. Its `__post_init__` comes
    afterwards and may rely on the fields.
    """
    removed = removed or {}

    def decorate(kind: type[T]) -> type[T]:
        kind.__pydantic_config__ = _CONFIG  # pyright: ignore[reportAttributeAccessIssue]
        kind.__removed__ = removed  # pyright: ignore[reportAttributeAccessIssue]
        kind.__get_pydantic_core_schema__ = classmethod(_dataclass_schema)  # pyright: ignore[reportAttributeAccessIssue]
        if "__post_init__" in vars(kind):
            kind.__post_init__ = locatable(kind.__post_init__)  # pyright: ignore[reportAttributeAccessIssue]

        parameters = signature(kind)

        @wraps(kind.__init__)
        def init(self: T, *args: object, **values: object) -> None:
            given: object = values
            if not removed.keys() & values.keys():
                given = ArgsKwargs((), parameters.bind(*args, **values).arguments)
            try:
                _validator(kind).validate_python(given, self_instance=self)
            except ValidationError as problem:
                raise _explain(problem, None, kind.__name__, error) from None

        kind.__init__ = init
        return kind

    return decorate


def read(kind: Any, data: Mapping[Any, Any], where: str, *, error: type[PoiseError]) -> Any:
    """Makes a checked dataclass from the content of a file; its fields are the keys."""
    try:
        return _validator(kind).validate_python(data)
    except ValidationError as problem:
        raise _explain(problem, data, where, error) from None


@cache
def _validator(kind: Any) -> SchemaValidator:
    return SchemaValidator(TypeAdapter(kind).core_schema)


def _wanting(wanted: str, schema: CoreSchema) -> CoreSchema:
    return core_schema.custom_error_schema(schema, "wanted", custom_error_message=wanted)


def _as_plain(value: object) -> object:
    return value.item() if isinstance(value, np.generic) else value


def locatable(function: Callable[..., T]) -> Callable[..., T]:
    """A function whose errors Pydantic hands on with the place where they came up."""

    @wraps(function)
    def call(*args: Any, **values: Any) -> T:
        try:
            return function(*args, **values)
        except PoiseError as problem:
            raise PydanticCustomError("poise", "{problem}", {"problem": problem}) from None

    return call


def _dataclass_schema(kind: Any, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
    return core_schema.no_info_before_validator_function(
        partial(_check_keys, _keys(kind), kind.__removed__), handler(source)
    )


def mapping_schema(keys: Mapping[str, tuple[CoreSchema, bool]]) -> CoreSchema:
    """The schema of a mapping in a file."""
    needed = {key: required for key, (_, required) in keys.items()}
    return core_schema.no_info_before_validator_function(
        partial(_check_keys, needed, {}),
        core_schema.typed_dict_schema(
            {
                key: core_schema.typed_dict_field(schema, required=required)
                for key, (schema, required) in keys.items()
            }
        ),
    )


def _keys(kind: Any) -> dict[str, bool]:
    """The keys of a dataclass in a file, and whether each is needed."""
    hints = get_type_hints(kind, include_extras=True)
    keys: dict[str, bool] = {}
    for field in fields(kind):
        if field.metadata.get("in_files", True):
            marks = getattr(hints[field.name], "__metadata__", ())
            names = [m.alias for m in marks if isinstance(m, FieldInfo) and m.alias]
            needed = field.default is MISSING and field.default_factory is MISSING
            keys[names[0] if names else field.name] = needed
    return keys


def _check_keys(keys: Mapping[str, bool], removed: Mapping[str, str], data: object) -> object:
    """Looks for removed, unknown and missing keys in the content of a file."""
    if isinstance(data, dict):
        for key in data:
            if not isinstance(key, str):
                raise key_error("a key of {subject} is not text", got=key, wanted="a name")
            if key in removed:
                what = "{subject} has a key that was removed"
                raise key_error(what, key=key, got=key, wanted=removed[key])
            if key not in keys:
                raise key_error("{subject} has an unknown key", key=key, got=key, choices=keys)
        for key, needed in keys.items():
            if needed and key not in data:
                raise key_error(f"{{subject}} lacks the key {key!r}", got=sorted(data))
    return data


def key_error(what: str, *, key: str | None = None, **said: Any) -> PydanticCustomError:
    """An error of a mapping's keys, for Pydantic to hand on with its place."""
    return PydanticCustomError("keys", "keys", {"what": what, "key": key, "said": said})


def _explain(
    problem: ValidationError, data: object, where: str, error: type[PoiseError]
) -> PoiseError:
    """The first problem that Pydantic has found, in our words and with the line of the file."""
    first = problem.errors(include_url=False)[0]
    kind, value, context = first["type"], first["input"], first.get("ctx", {})
    loc = tuple(part for part in first["loc"] if part != "[key]")
    line = _line(data, (*loc, context["key"]) if context.get("key") else loc)
    path = "".join(map(_step, loc)).removeprefix(".")
    file = f"{where}:{line}" if line else where
    subject = f"{file}: {path}" if path else file
    if kind == "poise":
        own: PoiseError = context["problem"]
        return own if data is None and not path else own.located(subject)
    if kind == "keys":
        return error(context["what"].format(subject=subject), **context["said"])
    if kind == "literal_error":
        choices = re.findall(r"'([^']*)'", context["expected"])
        return error(f"{file}: unknown {path}", got=value, choices=choices)
    wanted = first["msg"] if kind == "wanted" else _WANTED.get(kind, first["msg"])
    if len(loc) < len(first["loc"]):
        return error(f"a key of {subject} is not text", got=value, wanted=wanted)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    what = "is out of range" if number and "number" in wanted else "has the wrong kind"
    return error(f"{subject} {what}", got=value, wanted=wanted)


def _step(part: str | int) -> str:
    return f".{part}" if isinstance(part, str) and part.isidentifier() else f"[{part!r}]"


def _line(data: Any, loc: Iterable[Any]) -> int:
    """The line of the deepest place on a path that has one; zero where none has."""
    line = 0
    for part in loc:
        lines = getattr(data, "lines", {})
        try:
            data, line = data[part], lines[part]
        except (KeyError, IndexError, TypeError):
            break
    return line
