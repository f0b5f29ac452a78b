"""`MemoryBlock`: arrays and whole numbers by name, passed to a compiled function as one address.

An array as an argument takes seven numbers, and compiling that takes as long as compiling what is
done with it. A block describes its arrays in a table, and passes the address of that:

    array           address of its first number, then its shape
    another block   address of its table
    int             the number itself

So compiled functions have one signature for all owners of arrays. These are not counted: the caller
keeps the blocks alive.
"""

import inspect
import math
from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Any, ClassVar, NamedTuple, TypeVar, cast, dataclass_transform
from weakref import WeakValueDictionary

import numpy as np
from llvmlite import ir
from numba import extending
from numba.core import cgutils, types
from numba.core.imputils import (
    lower_builtin,
    lower_constant,
    lower_getattr_generic,
    lower_setattr_generic,
)
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    infer_getattr,
    infer_global,
    signature,
)
from numba.extending import models, register_model

B = TypeVar("B", bound="MemoryBlock")

_WORD = 8
"""Size of an address, a length or a number [bytes]."""

_LINE = 64
"""Size of a cache line; arrays begin at its multiples, so that vectors do not straddle [bytes]."""


class _Field(NamedTuple):
    """Entry of a block's table."""

    place: int  # of its first word
    kind: str  # "array", "block" or "int"
    dims: tuple[str, ...] = ()  # names of an array's sizes
    dtype: str = ""  # of an array's numbers
    block: "type[MemoryBlock] | None" = None  # class of a block


class _BlockMeta(type):
    """Metaclass by which Numba recognises classes of blocks."""


@dataclass_transform(kw_only_default=True)
class MemoryBlock(metaclass=_BlockMeta):
    """Base of classes whose annotations are the fields of the table.

    A field is a C-contiguous array, `Float64[np.ndarray, "m n"]` or of `Int64`, another
    `MemoryBlock`, or an `int`. Compiled functions may change the numbers of arrays, and an `int`;
    an array or a block is never replaced by another.

    Args:
        values: one for every field; an `int` is zero by default.

    Raises:
        TypeError: a class has a field with the name of an attribute of every block, a value is
            missing or unknown, or an array has another layout than its field.
    """

    stamp: ClassVar[str]  # layout of the table; machine code is made for one
    fields: ClassVar[dict[str, _Field]]  # of the table, by name
    table: np.ndarray
    address: int  # of the table, valid as long as the block is referenced

    def __init_subclass__(cls) -> None:
        cls.fields, place = {}, 0
        for name, kind in inspect.get_annotations(cls).items():
            if name in _RESERVED:
                raise TypeError(
                    f"{cls.__name__} has a field {name!r}, which is an attribute of every block; "
                    "wanted another name"
                )
            field = _field(place, kind)
            cls.fields[name] = field
            if field.kind == "int":
                setattr(cls, name, _number(place))
            place += 1 + len(field.dims)
        cls.stamp = repr(
            [
                (name, field.kind, field.dims, field.dtype, field.block and field.block.stamp)
                for name, field in cls.fields.items()
            ]
        )

    def __init__(self, **values: Any) -> None:
        words: list[int] = []
        for name, field in self.fields.items():
            value = values.pop(name) if field.kind != "int" else values.pop(name, 0)
            if field.kind == "array":
                words += _describe(value, field, name)
            else:
                words.append(value if field.kind == "int" else value.address)
            if field.kind != "int":
                setattr(self, name, value)
        if values:
            raise TypeError(f"{type(self).__name__} has no {', '.join(values)}")
        self.table = np.array(words, dtype=np.int64)
        self.address = _address(self.table)
        _LIVE[self.address] = self

    def __reduce_ex__(self, protocol: object) -> Any:
        # A copy would refer to the memory of the original.
        raise TypeError(
            f"{type(self).__name__} lies where compiled functions know it: what holds it, such as "
            "a solver or an estimator, is neither copied nor pickled; make another"
        )

    def arrays(self) -> dict[str, Any]:
        """Return its own arrays by name, without those of the blocks in it."""
        return {name: getattr(self, name) for name, f in self.fields.items() if f.kind == "array"}


_RESERVED = ("stamp", "fields", "table", "address", "arrays")
"""Attributes of every block: a field called `table` would free the table that is in use."""

_LIVE: WeakValueDictionary[int, MemoryBlock] = WeakValueDictionary()
"""Blocks by address, for compiled functions that run as plain Python."""


def allocate(kind: type[B], sizes: Mapping[str, int], **given: Any) -> B:
    """Make a block of arrays of zeros, but for `given` values."""
    shapes = dict[str, list[int]]()
    for name, field in kind.fields.items():
        if name not in given and field.kind == "array":
            shapes[name] = [sizes[dim] for dim in field.dims]
        elif name not in given and field.block is not None:
            given[name] = allocate(field.block, sizes)
    words = [math.prod(shape) for shape in shapes.values()]
    for (name, shape), room in zip(shapes.items(), _zeros(words), strict=True):
        given[name] = room.view(kind.fields[name].dtype).reshape(shape)
    return kind(**given)


def view(kind: type[B], address: int) -> B:
    """Return the block whose table lies at an address."""
    block = _LIVE[address]
    assert isinstance(block, kind)
    return block


def _field(place: int, kind: Any) -> _Field:
    """Entry that an annotation describes."""
    if kind is int:
        return _Field(place, "int")
    if isinstance(kind, _BlockMeta):
        return _Field(place, "block", block=cast("type[MemoryBlock]", kind))
    return _Field(place, "array", tuple(kind.dim_str.split()), kind.dtypes[0])


def _number(place: int) -> property:
    """Property of an `int` in the table."""

    def read(block: MemoryBlock) -> int:
        return int(block.table[place])

    def write(block: MemoryBlock, value: int) -> None:
        block.table[place] = value

    return property(read, write)


def _describe(array: Any, field: _Field, name: str) -> list[int]:
    """Words of an array in the table."""
    fits = array.ndim == len(field.dims) and array.dtype == field.dtype
    if not (fits and array.flags.c_contiguous and array.flags.aligned):
        raise TypeError(f"{name} is not a contiguous array of {field.dtype} {field.dims}")
    return [_address(array), *array.shape]


def _address(array: np.ndarray) -> int:
    return int(array.__array_interface__["data"][0])


def _zeros(words: Sequence[int]) -> list[np.ndarray]:
    """Make vectors of zeros in one piece of memory, each of which begins at a line."""
    line = _LINE // _WORD
    begins = [0, *accumulate(-(-count // line) * line for count in words)]
    room = np.zeros(begins[-1] + line)
    first = -_address(room) % _LINE // _WORD
    room = room[first:]
    return [room[begin : begin + count] for begin, count in zip(begins, words, strict=False)]


# --- blocks in Numba ----------------------------------------------------------------------------


class _BlockType(types.Type):
    """Type of a block: a pointer to its table."""

    def __init__(self, block: type[MemoryBlock]) -> None:
        self.block = block
        super().__init__(name=f"{block.__module__}.{block.__qualname__}")


class _ClassType(types.Opaque):
    """Type of a class of blocks, an argument of `view`."""

    def __init__(self, block: type[MemoryBlock]) -> None:
        self.block = block
        super().__init__(name=f"class({block.__module__}.{block.__qualname__})")


@register_model(_BlockType)
class _BlockModel(models.OpaqueModel):
    pass


@register_model(_ClassType)
class _ClassModel(models.OpaqueModel):
    pass


@extending.typeof_impl.register(_BlockMeta)
def _(block: type[MemoryBlock], _context: Any) -> _ClassType:
    return _ClassType(block)


@lower_constant(_ClassType)
def _(context: Any, _builder: Any, _kind: Any, _value: Any) -> Any:
    return context.get_dummy_value()


@cast("Any", infer_global)(view)
class _View(AbstractTemplate):
    def generic(self, args: Any, _kws: Any) -> Any:
        kind, address = args
        if isinstance(kind, _ClassType) and isinstance(address, types.Integer):
            return signature(_BlockType(kind.block), kind, types.int64)
        return None


@lower_builtin(view, _ClassType, types.int64)
def _(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
    return builder.inttoptr(args[1], cgutils.voidptr_t)


@infer_getattr
class _Attributes(AttributeTemplate):
    key = _BlockType

    def generic_resolve(self, block: Any, name: str) -> Any:
        field = block.block.fields.get(name)
        return None if field is None else _type_of(field)


def _type_of(field: _Field) -> Any:
    """Numba's type of a field."""
    if field.kind == "int":
        return types.int64
    if field.block is not None:
        return _BlockType(field.block)
    return types.Array(getattr(types, field.dtype), len(field.dims), "C")


@lower_getattr_generic(_BlockType)
def _(context: Any, builder: Any, kind: Any, block: Any, name: str) -> Any:
    field = kind.block.fields[name]
    first = builder.load(_word(builder, block, field.place))
    if field.kind == "int":
        return first
    _never_changes(builder, first)
    if field.block is not None:
        return builder.inttoptr(first, cgutils.voidptr_t)
    found = context.make_array(_type_of(field))(context, builder)
    shape = [
        _never_changes(builder, builder.load(_word(builder, block, field.place + 1 + i)))
        for i in range(len(field.dims))
    ]
    size = context.get_constant(types.intp, _WORD)
    strides = [size]
    for length in shape[:0:-1]:
        strides.insert(0, builder.mul(strides[0], length))
    context.populate_array(
        found,
        data=builder.inttoptr(first, found.data.type),
        shape=cgutils.pack_array(builder, shape),
        strides=cgutils.pack_array(builder, strides),
        itemsize=size,
        meminfo=None,
    )
    return found._getvalue()


@lower_setattr_generic(_BlockType)
def _(_context: Any, builder: Any, sig: Any, args: Any, name: str) -> None:
    field = sig.args[0].block.fields[name]
    if field.kind != "int":
        raise TypeError(f"{name} cannot be replaced")
    builder.store(args[1], _word(builder, args[0], field.place))


def _word(builder: Any, block: Any, place: int) -> Any:
    table = builder.bitcast(block, ir.IntType(64).as_pointer())
    return builder.gep(table, [ir.Constant(ir.IntType(64), place)], inbounds=True)


def _never_changes(builder: Any, load: Any) -> Any:
    """Mark a word as invariant for LLVM, so that it is loaded once."""
    load.set_metadata("invariant.load", builder.module.add_metadata([]))
    return load
