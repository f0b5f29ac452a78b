"""Small dense linear algebra, compiled when first called, for what is done every tick.

Python's own time for a call into NumPy or LAPACK is that of some thousand operations, as many as
most of these functions do. They work in place and allocate nothing.

`compiled` and `part` make compiled functions, a `Block` hands many arrays to one, and `say_if_slow`
shows what the first use on a machine waits for.
"""

from poise._compiled._blocks import Block, allocate, view
from poise._compiled._compiling import compiled, part, say_if_slow
from poise._compiled._first_use import functions_of
from poise._compiled._householder import make_reflection, reflect, reflect_columns, reflect_rows
from poise._compiled._triangular import factor, solve_columns, solve_transposed

__all__ = [
    "Block",
    "allocate",
    "compiled",
    "factor",
    "functions_of",
    "make_reflection",
    "part",
    "reflect",
    "reflect_columns",
    "reflect_rows",
    "say_if_slow",
    "solve_columns",
    "solve_transposed",
    "view",
]
