"""Dataclasses whose fields Pydantic checks by annotations, for callers and for files alike.

`_explain` words its errors: got, wanted, choices, and the line of the file.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from functools import cache, wraps
from inspect import signature
from types import MappingProxyType
from typing import Annotated, Any, TypeVar, get_type_hints

import numpy as np
import pydantic
from jaxtyping import Float64
from pydantic import GetCoreSchemaHandler, Strict, StringConstraints, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ArgsKwargs, CoreSchema, PydanticCustomError, SchemaValidator, core_schema

from poise.errors import ConfigurationError, PoiseError

LARGEST = 1e9
"""No number is larger, whatever its unit: no robot needs it, and its powers overflow."""

NOT_IN_FILES = {"in_files": False}
"""Metadata of a dataclass's field that is no key of a file."""

T = TypeVar("T")

_CONFIG = pydantic.ConfigDict(extra="forbid", arbitrary_types_allowed=True, populate_by_name=True)

_WANTED = {
    "bool_type": "true or false",
    "dataclass_type": "keys with values",
    "dict_type": "keys with values",
    "list_type": "a list",
    "string_too_short": "a text",
    "string_type": "a text",
    "tuple_type": "a list",
}
"""Right values by the type of Pydantic's error; others have its own message."""


_REMOVED = "has a key that was removed"


@dataclass(frozen=True)
class Wanting:
    """Description of a right value in place of Pydantic's message."""

    wanted: str

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        schema = handler(source)
        return core_schema.custom_error_schema(schema, "wanted", custom_error_message=self.wanted)


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Range of a finite number, whose lower end is `-most` unless another one is given."""

    positive: bool = False
    least: float | None = None
    below: float | None = None
    most: float = LARGEST
    whole: bool = False
    unit: str = ""

    @property
    def _lower(self) -> float:
        return -self.most if self.least is None else self.least

    @property
    def wanted(self) -> str:
        """The range in words."""
        kind = f"{'positive ' if self.positive else ''}{'whole ' if self.whole else ''}number"
        lower = "" if self.positive else f" of at least {self._lower:g},"
        upper = f" up to {self.most:g}" if self.below is None else f" below {self.below:g}"
        return f"a {kind}{lower}{upper}" + (f" [{self.unit}]" if self.unit else "")

    def __get_pydantic_core_schema__(self, _: Any, __: GetCoreSchemaHandler) -> CoreSchema:
        number = core_schema.float_schema(
            strict=True,
            allow_inf_nan=False,
            gt=0.0 if self.positive else None,
            ge=None if self.positive else self._lower,
            lt=self.below,
            le=self.most,
            multiple_of=1.0 if self.whole else None,
        )
        schema = core_schema.no_info_before_validator_function(_as_plain, number)
        if self.whole:
            schema = core_schema.no_info_after_validator_function(int, schema)
        return core_schema.custom_error_schema(schema, "wanted", custom_error_message=self.wanted)


@dataclass(frozen=True)
class Vector:
    """So many numbers, as a tuple, or as an array where that is annotated."""

    count: int
    each: Bounds = Bounds()

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        numbers = [self.each.__get_pydantic_core_schema__(source, handler)] * self.count
        schema = core_schema.no_info_before_validator_function(
            self._counted, core_schema.tuple_positional_schema(numbers)
        )
        if getattr(source, "__origin__", None) is tuple:
            return schema
        return core_schema.no_info_after_validator_function(np.array, schema)

    def _counted(self, value: object) -> object:
        items = _as_plain(value)
        if not isinstance(items, list | tuple) or len(items) != self.count:
            raise PydanticCustomError("wanted", "{count} numbers", {"count": self.count})
        return items


def _as_plain(value: object) -> object:
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value


Text = Annotated[str, StringConstraints(strict=True, strip_whitespace=True, min_length=1)]
"""A text that is not empty, without the space around it."""

AnyText = Annotated[str, StringConstraints(strict=True, strip_whitespace=True)]
"""A text that may be empty: a description, or a name that its look-up refuses with the choices."""

Truth = Annotated[bool, Strict()]
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
    """Make a dataclass check and convert its fields before its `__post_init__` whenever made.

    Args:
        error: raised for what cannot be.
        removed: fields of former versions, each with its replacement.
    """
    gone = removed or {}

    def decorate(kind: type[T]) -> type[T]:
        kind.__pydantic_config__ = _CONFIG  # pyright: ignore[reportAttributeAccessIssue]
        kind.__get_pydantic_core_schema__ = classmethod(  # pyright: ignore[reportAttributeAccessIssue]
            lambda kind, source, handler: keyed(_keys(kind), handler(source), gone)
        )
        parameters = signature(kind)

        @wraps(kind.__init__)
        def init(self: T, *args: object, **values: object) -> None:
            for name in gone.keys() & values.keys():
                raise error(f"{kind.__name__} {_REMOVED}", got=name, wanted=gone[name])
            given = ArgsKwargs((), parameters.bind(*args, **values).arguments)
            _validate(kind, given, kind.__name__, error, self)

        kind.__init__ = init
        return kind

    return decorate


def read(kind: Any, data: Mapping[Any, Any], where: str, *, error: type[PoiseError]) -> Any:
    """Make a checked dataclass from the content of a file, whose keys are its fields."""
    return _validate(kind, data, where, error)


def _validate(
    kind: Any, given: Any, where: str, error: type[PoiseError], instance: Any = None
) -> Any:
    try:
        return _validator(kind).validate_python(given, self_instance=instance)
    except ValidationError as problem:
        raise _explain(problem, given, where, error) from None


@cache
def _validator(kind: Any) -> SchemaValidator:
    return SchemaValidator(pydantic.TypeAdapter(kind).core_schema)


def _keys(kind: Any) -> list[str]:
    """Keys of a dataclass in a file."""
    hints = get_type_hints(kind, include_extras=True)
    keys: list[str] = []
    for field in fields(kind):
        if field.metadata.get("in_files", True):
            marks = getattr(hints[field.name], "__metadata__", ())
            aliases = [m.alias for m in marks if isinstance(m, FieldInfo) and m.alias]
            keys.append((aliases or [field.name])[0])
    return keys


def keyed(
    keys: Iterable[str], schema: CoreSchema, removed: Mapping[str, str] = MappingProxyType({})
) -> CoreSchema:
    """Schema of a mapping that has no other keys; errors of Poise in it get their place."""

    def check(data: object, handler: Callable[[object], object]) -> object:
        for key in data if isinstance(data, dict) else ():
            if key in removed:
                raise PydanticCustomError("key", _REMOVED, {"got": key, "wanted": removed[key]})
            if key not in keys:
                said = {"got": key, "choices": tuple(keys)}
                raise PydanticCustomError("key", "has an unknown key", said)
        return locate(data, handler)

    return core_schema.no_info_wrap_validator_function(check, schema)


def locate(data: object, handler: Callable[[object], object]) -> object:
    """Pass errors of Poise to Pydantic, which has their place in the file."""
    try:
        return handler(data)
    except PoiseError as problem:
        raise PydanticCustomError("poise", "{problem}", {"problem": problem}) from None


def _explain(
    problem: ValidationError, data: Any, where: str, error: type[PoiseError]
) -> PoiseError:
    """Word the first of Pydantic's errors."""
    first = problem.errors(include_url=False)[0]
    kind, value, said = first["type"], first["input"], first.get("ctx", {})
    loc = [part for part in first["loc"] if part != "[key]"]
    lacking = [loc.pop()] if kind == "missing" else []
    line = _line(data, [*loc, said.get("got")])
    path = "".join(map(_step, loc)).removeprefix(".")
    file = f"{where}:{line}" if line else where
    subject = f"{file}: {path}" if path else file
    if kind == "poise":
        own: PoiseError = said["problem"]
        return own.located(subject) if path or isinstance(data, dict) else own
    if kind == "key":
        return error(f"{subject} {first['msg']}", **said)
    if lacking:
        return error(f"{subject} lacks the key {lacking[0]!r}", got=sorted(value))
    if kind == "literal_error":
        choices = re.findall(r"'([^']*)'", said["expected"])
        return error(f"{file}: unknown {path}", got=value, choices=choices)
    wanted = _WANTED.get(kind, first["msg"])
    number = isinstance(value, int | float) and not isinstance(value, bool)
    what = "is out of range" if number and "number" in wanted else "has the wrong kind"
    return error(f"{subject} {what}", got=value, wanted=wanted)


def _step(part: str | int) -> str:
    return f".{part}" if isinstance(part, str) and part.isidentifier() else f"[{part!r}]"


def _line(data: Any, loc: Iterable[Any]) -> int:
    """Line of the deepest place on a path that has one; zero where none has."""
    line = 0
    for part in loc:
        lines = getattr(data, "lines", {})
        try:
            data, line = data[part], lines[part]
        except (KeyError, IndexError, TypeError):
            break
    return line
