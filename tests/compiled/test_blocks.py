"""Blocks: arrays by name, handed to compiled functions as one address."""

import numpy as np
import pytest
from jaxtyping import Float64, Int64

from poise._compiled import MemoryBlock, allocate, compiled, part, view


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


def test_compiled_functions_read_and_write_what_python_sees():
    outer = allocate(Outer, {"m": 4, "n": 3})
    outer.A[:], outer.x[:] = np.arange(12.0).reshape(4, 3), [1.0, 2.0, -2.0]
    outer.A[2] = 0.0
    assert find_largest(outer.address) == 9.0 + 20.0 - 22.0
    assert outer.inner.count == 3
    np.testing.assert_array_equal(outer.inner.places, [0, 1, 3, 0])


def test_a_block_takes_arrays_that_are_there_already():
    x = np.ones(3)
    outer = allocate(Outer, {"m": 1, "n": 3}, x=x, inner=Inner(count=7, places=np.zeros(1, int)))
    outer.A[:] = 2.0
    assert outer.inner.count == 7
    x[0] = 5.0
    assert find_largest(outer.address) == 14.0
    assert outer.inner.count == 1


@pytest.mark.parametrize(
    "wrong", [np.zeros((2, 3)).T, np.zeros((3, 2), dtype=np.float32), np.zeros(6)]
)
def test_what_does_not_fit_is_refused(wrong):
    with pytest.raises(TypeError, match="A is not a contiguous array"):
        allocate(Outer, {"m": 3, "n": 2}, A=wrong)


def test_a_name_that_a_block_has_not_is_refused():
    with pytest.raises(TypeError, match="Inner has no size"):
        allocate(Inner, {"m": 3}, size=3)


@pytest.mark.parametrize("name", ["table", "address", "fields", "stamp", "arrays"])
@pytest.mark.parametrize("kind", [int, Inner, Float64[np.ndarray, " n"]])
def test_a_field_with_the_name_of_an_attribute_of_blocks_is_refused(name, kind):
    with pytest.raises(TypeError, match=f"Wrong has a field '{name}'.*wanted another name"):
        type(MemoryBlock)("Wrong", (MemoryBlock,), {"__annotations__": {name: kind}})


def test_arrays_begin_on_lines_of_the_cache():
    for array in allocate(Outer, {"m": 5, "n": 7}).arrays().values():
        assert array.__array_interface__["data"][0] % 64 == 0


def test_a_layout_has_a_stamp_of_its_own_and_of_what_it_holds():
    class Other(MemoryBlock):
        count: int
        places: Float64[np.ndarray, " m"]

    class Holder(MemoryBlock):
        inner: Other

    class Same(MemoryBlock):
        inner: Inner

    assert len({Inner.stamp, Other.stamp, Outer.stamp, Holder.stamp, Same.stamp}) == 5


def test_the_plain_function_gives_the_same():
    outer = allocate(Outer, {"m": 3, "n": 2})
    outer.A[:], outer.x[:] = [[1.0, 2.0], [3.0, 4.0], [-1.0, 0.0]], [1.0, -1.0]
    assert view(Outer, outer.address) is outer
    fast = find_largest(outer.address)
    assert fast == max(product.py_func(outer, row) for row in range(3)) == -1.0
