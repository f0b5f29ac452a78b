"""Compiled functions, and small dense linear algebra for every tick.

A call into NumPy or LAPACK takes Python the time of some thousand operations, as many as most of
these functions do. They work in place and allocate nothing.
"""

from poise._compiled._blocks import (
    MemoryBlock as MemoryBlock,
    allocate as allocate,
    view as view,
)
from poise._compiled._compiling import (
    address_of as address_of,
    call_at as call_at,
    compiled as compiled,
    compiled_for_threads as compiled_for_threads,
    part as part,
)
from poise._compiled._first_use import (
    check_kept as check_kept,
    code_folder as code_folder,
    count_kept as count_kept,
    find_unkept as find_unkept,
    functions_of as functions_of,
    names_of as names_of,
    report_compiled as report_compiled,
    say_if_slow as say_if_slow,
    usable_cores as usable_cores,
)
from poise._compiled._linalg import (
    factor as factor,
    factor_leading as factor_leading,
    make_reflection as make_reflection,
    reflect as reflect,
    reflect_columns as reflect_columns,
    reflect_rows as reflect_rows,
    solve_columns as solve_columns,
    solve_leading as solve_leading,
    solve_lower as solve_lower,
    solve_transposed as solve_transposed,
)
