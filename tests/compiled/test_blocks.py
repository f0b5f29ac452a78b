"""Blocks: arrays by name, passed to compiled functions as one address."""

import numpy as np
import pytest
from jaxtyping import Float64, Int64

from poise._compiled import MemoryBlock, address_of, allocate, call_at, compiled, part, view


class Inner(MemoryBlock):
    count: int
    places: Int64[np.ndarray, " m"]


class Outer(MemoryBlock):
    inner: Inner
    A: Float64[np.ndarray, "m n"]
    x: Float64[np.ndarray, " n"]


@part
def product(outer: Outer, row: int) -> float:
    total = 0.0
    for j in range(len(outer.x)):
        total += outer.A[row, j] * outer.x[j]
    return total


@compiled
def find_largest(address: int) -> float:
    outer = view(Outer, address)
    inner, largest = outer.inner, -np.inf
    inner.count = 0
    for i in range(len(outer.A)):
        value = product(outer, i)
        if value > largest:
            largest = value
            inner.places[inner.count] = i
            inner.count += 1
    return largest


@compiled
def add_largest(function: int, block: int, to: float) -> float:
    return to + call_at(function, find_largest, block)


def test_compiled_functions_read_and_write_what_python_sees():
    x = np.array([1.0, 2.0, -2.0])
    outer = allocate(Outer, {"m": 4, "n": 3}, x=x)
    outer.A[:] = np.arange(12.0).reshape(4, 3)
    outer.A[2] = 0.0
    assert find_largest(outer.address) == 9.0 + 20.0 - 22.0
    assert outer.inner.count == 3
    np.testing.assert_array_equal(outer.inner.places, [0, 1, 3, 0])
    x[2] = 0.0
    assert add_largest(address_of(find_largest), outer.address, 2.0) == 31.0
    assert view(Outer, outer.address) is outer
    assert max(product.py_func(outer, row) for row in range(4)) == 29.0
    assert find_largest.py_func.__name__ == "find_largest"
    for array in outer.arrays().values():
        assert array is x or array.__array_interface__["data"][0] % 64 == 0


@pytest.mark.parametrize(
    "wrong", [np.zeros((2, 3)).T, np.zeros((3, 2), dtype=np.float32), np.zeros(6)]
)
def test_arrays_of_another_layout_and_unknown_names_are_refused(wrong):
    with pytest.raises(TypeError, match="A is not a contiguous array"):
        allocate(Outer, {"m": 3, "n": 2}, A=wrong)
    with pytest.raises(TypeError, match="Inner has no size"):
        allocate(Inner, {"m": 3}, size=3)


@pytest.mark.parametrize("name", ["table", "address", "fields", "stamp", "arrays"])
def test_a_field_with_the_name_of_an_attribute_of_blocks_is_refused(name):
    with pytest.raises(TypeError, match=f"Wrong has a field '{name}'.*wanted another name"):
        type(MemoryBlock)("Wrong", (MemoryBlock,), {"__annotations__": {name: int}})


def test_a_layout_has_a_stamp_of_its_own_and_of_its_blocks():
    class Other(MemoryBlock):
        count: int
        places: Float64[np.ndarray, " m"]

    class Holder(MemoryBlock):
        inner: Other

    class Same(MemoryBlock):
        inner: Inner

    assert len({Inner.stamp, Other.stamp, Outer.stamp, Holder.stamp, Same.stamp}) == 5
