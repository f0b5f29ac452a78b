"""`Block`: arrays and whole numbers by name, of which a compiled function gets one address.

Handing an array to a compiled function takes seven numbers, and compiling that takes as long as
compiling what is done with it. A block's arrays are described in a table, and all that is handed on
is where the table lies:

    array           address of its first number, then its shape
    another block   address of its table
    int             the number itself

So compiled functions have one signature, whoever owns the arrays, and nobody counts their owners:
whoever calls one keeps the blocks alive.
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

B = TypeVar("B", bound="Block")

_WORD = 8
"""Bytes of an address, of a length, of a number."""

_LINE = 64
"""Bytes at whose multiples arrays begin, so that vectors of their numbers do not straddle lines."""


class _Field(NamedTuple):
    """What stands in a block's table under a name.

    Attributes:
        place: its first word.
        kind: "array", "block" or "int".
        dims: names of an array's sizes.
        dtype: of an array's numbers.
        block: what kind of block.
    """

    place: int
    kind: str
    dims: tuple[str, ...] = ()
    dtype: str = ""
    block: "type[Block] | None" = None


class _BlockMeta(type):
    """Tells Numba a class of blocks from other classes."""


@dataclass_transform(kw_only_default=True)
class Block(metaclass=_BlockMeta):
    """Base of classes whose annotations say what lies under which name.

    A field is a C-contiguous array, `Float64[np.ndarray, "m n"]` or of `Int64`, another `Block`,
    or an `int`. Compiled functions may change the numbers of arrays, and an `int`; nobody may put
    another array or block in the place of one.

    Args:
        values: one for every field, but an `int` may be left out and is zero then.

    Attributes:
        fields: what stands in the table, by name.
        table: of this block.
        address: of the table; `view` makes the block of it, as long as somebody holds the block.
    """

    stamp: ClassVar[str]
    """Says how the table is laid out; machine code that was made for another is of no use."""

    fields: ClassVar[dict[str, _Field]]
    table: np.ndarray
    address: int

    def __init_subclass__(cls) -> None:
        cls.fields, place = {}, 0
        for name, kind in inspect.get_annotations(cls).items():
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
        # A copy would go on to the addresses of the original, which may be gone by then.
        raise TypeError(
            f"{type(self).__name__} lies where compiled functions know it: what holds it, such as "
            "a solver or an estimator, is neither copied nor pickled; make another"
        )

    def arrays(self) -> dict[str, Any]:
        """Its own arrays by name, without those of the blocks in it."""
        return {name: getattr(self, name) for name, f in self.fields.items() if f.kind == "array"}


_LIVE: WeakValueDictionary[int, Block] = WeakValueDictionary()
"""Blocks by their address, for compiled functions that run as plain Python."""


def allocate(kind: type[B], sizes: Mapping[str, int], **given: Any) -> B:
    """Makes a block of arrays of zeros."""
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
    """The block whose table lies at an address; how a compiled function gets it from Python."""
    block = _LIVE[address]
    assert isinstance(block, kind)
    return block


def _field(place: int, kind: Any) -> _Field:
    """What an annotation says."""
    if kind is int:
        return _Field(place, "int")
    if isinstance(kind, _BlockMeta):
        return _Field(place, "block", block=cast("type[Block]", kind))
    return _Field(place, "array", tuple(kind.dim_str.split()), kind.dtypes[0])


def _number(place: int) -> property:
    """An `int` in the table, seen from Python."""

    def read(block: Block) -> int:
        return int(block.table[place])

    def write(block: Block, value: int) -> None:
        block.table[place] = value

    return property(read, write)


def _describe(array: Any, field: _Field, name: str) -> list[int]:
    """An array's words in the table."""
    fits = array.ndim == len(field.dims) and array.dtype == field.dtype
    if not (fits and array.flags.c_contiguous and array.flags.aligned):
        raise TypeError(f"{name} is not a contiguous array of {field.dtype} {field.dims}")
    return [_address(array), *array.shape]


def _address(array: np.ndarray) -> int:
    return int(array.__array_interface__["data"][0])


def _zeros(words: Sequence[int]) -> list[np.ndarray]:
    """Vectors of so many words, each of which begins at a line, in one piece of memory."""
    line = _LINE // _WORD
    begins = [0, *accumulate(-(-count // line) * line for count in words)]
    room = np.zeros(begins[-1] + line)
    first = -_address(room) % _LINE // _WORD
    room = room[first:]
    return [room[begin : begin + count] for begin, count in zip(begins, words, strict=False)]


# --- what Numba has to know ---------------------------------------------------------------------


class _BlockType(types.Type):
    """A block in compiled code: a pointer to its table."""

    def __init__(self, block: type[Block]) -> None:
        self.block = block
        super().__init__(name=f"{block.__module__}.{block.__qualname__}")


class _ClassType(types.Opaque):
    """A class of blocks, as `view` takes it."""

    def __init__(self, block: type[Block]) -> None:
        self.block = block
        super().__init__(name=f"class({block.__module__}.{block.__qualname__})")


@register_model(_BlockType)
class _BlockModel(models.OpaqueModel):
    pass


@register_model(_ClassType)
class _ClassModel(models.OpaqueModel):
    pass


@extending.typeof_impl.register(_BlockMeta)
def _(block: type[Block], _context: Any) -> _ClassType:
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
    """What Numba calls what stands under a name."""
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
    """Lets LLVM read a word once, whatever is written in between."""
    load.set_metadata("invariant.load", builder.module.add_metadata([]))
    return load
