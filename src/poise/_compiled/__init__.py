"""Small dense linear algebra, compiled when first called, for what is done every tick.

Python's own time for a call into NumPy or LAPACK is that of some thousand operations, as many as
most of these functions do. They work in place and allocate nothing.

`compiled`, `compiled_for_threads` and `part` make compiled functions, a `Block` hands many arrays
to one, and `say_if_slow` shows what the first use on a machine waits for; `compiling_told` and its
neighbours are for whoever compiles ahead.
"""

from poise._compiled._ahead import (
    check_kept,
    code_folder,
    compiling_told,
    find_unkept,
    names_of,
    usable_cores,
)
from poise._compiled._blocks import Block, allocate, view
from poise._compiled._compiling import compiled, compiled_for_threads, part, say_if_slow
from poise._compiled._first_use import clear_bar, draw_bar, functions_of
from poise._compiled._householder import make_reflection, reflect, reflect_columns, reflect_rows
from poise._compiled._leading import factor_leading, solve_leading, solve_lower
from poise._compiled._triangular import factor, solve_columns, solve_transposed

__all__ = [
    "Block",
    "allocate",
    "check_kept",
    "clear_bar",
    "code_folder",
    "compiled",
    "compiled_for_threads",
    "compiling_told",
    "draw_bar",
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
