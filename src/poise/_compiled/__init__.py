"""Compiled functions, and small dense linear algebra for every tick.

A call into NumPy or LAPACK takes Python the time of some thousand operations, as many as most of
these functions do. They work in place and allocate nothing.
"""

from poise._compiled._blocks import MemoryBlock, allocate, view
from poise._compiled._compiling import (
    address_of,
    call_at,
    compiled,
    compiled_for_threads,
    part,
)
from poise._compiled._first_use import (
    check_kept,
    code_folder,
    compiling_told,
    find_unkept,
    functions_of,
    names_of,
    say_if_slow,
    usable_cores,
)
from poise._compiled._linalg import (
    factor,
    factor_leading,
    make_reflection,
    reflect,
    reflect_columns,
    reflect_rows,
    solve_columns,
    solve_leading,
    solve_lower,
    solve_transposed,
)

__all__ = [
    "MemoryBlock",
    "address_of",
    "allocate",
    "call_at",
    "check_kept",
    "code_folder",
    "compiled",
    "compiled_for_threads",
    "compiling_told",
    "factor",
    "factor_leading",
    "find_unkept",
    "functions_of",
    "make_reflection",
    "names_of",
    "part",
    "reflect",
    "reflect_columns",
    "reflect_rows",
    "say_if_slow",
    "solve_columns",
    "solve_leading",
    "solve_lower",
    "solve_transposed",
    "usable_cores",
    "view",
]
