"""What each array operation costs [FLOP], by the conventions of (Park, Jin, Kang 2022).

Each of the four arithmetic operations on two floating point numbers is one, as in the paper's
section III.F; so is a square root and any other elementary function. What only moves, compares or
changes signs is free. Products are counted in full, also where the result is symmetric or an
operand has zeros in it, because that is what the code does.

    product of (a x b) and (b x c)                       a c (2 b - 1)
    sum, difference, product of entries                  1 an entry of the result
    sum of n entries                                     n - 1
    inverse of m x m                                     m^3 / 3        as Table 1 has it
    Cholesky factor of m x m                             m^3 / 3        leading term
    inverse of a triangle of m x m                       m^3 / 3        leading term
    inverse of m x m from its Cholesky factor            2 m^3 / 3      leading term
    substitution with a triangle of m x m                m^2 a right-hand side
    solution with a general m x m                        2 m^3 / 3 + 2 m^2 a right-hand side
    QR factors of m x n (m >= n), as reflectors          2 n^2 (m - n / 3)
    k reflectors of length m on c columns                4 m k c - 2 k^2 c
    eigenvalues and vectors of a symmetric m x m         9 m^3          Golub and Van Loan
    singular values of m x n (m >= n)                    4 m n^2 - 4 n^3 / 3

An explicit inverse really takes about m^3 from a symmetric matrix and 2 m^3 from another; it is
counted as the paper counts it, in favour of code that uses one.
"""

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
from scipy import linalg
from scipy.linalg import lapack

Cost = Callable[[tuple[Any, ...], Any], Fraction | int]
"""Cost of a call, from its positional arguments and its result, all of them plain arrays."""

_linalg: Any = linalg
_lapack: Any = lapack

ENTRYWISE = {
    np.add, np.subtract, np.multiply, np.divide, np.sqrt, np.square, np.reciprocal, np.power,
    np.float_power, np.sin, np.cos, np.tan, np.arcsin, np.arccos, np.arctan, np.arctan2, np.exp,
    np.log, np.hypot,
}  # fmt: skip
"""Universal functions that cost one an entry of the result."""

FREE_ENTRYWISE = {
    np.negative, np.positive, np.absolute, np.fabs, np.sign, np.copysign, np.maximum, np.minimum,
    np.greater, np.greater_equal, np.less, np.less_equal, np.equal, np.not_equal, np.isfinite,
    np.isnan, np.isinf, np.logical_and, np.logical_or, np.logical_not, np.floor, np.ceil,
    np.conjugate,
}  # fmt: skip
"""Universal functions that compare, choose or change signs."""

FREE = {
    np.transpose, np.reshape, np.ravel, np.squeeze, np.expand_dims, np.concatenate, np.stack,
    np.vstack, np.hstack, np.copy, np.zeros_like, np.ones_like, np.empty_like, np.full_like,
    np.diag, np.diagonal, np.where, np.broadcast_to, np.shape, np.ndim, np.size, np.max, np.min,
    np.argmax, np.argmin, np.argsort, np.sort, np.all, np.any, np.clip, np.swapaxes, np.tril,
    np.triu, np.atleast_2d, np.flatnonzero, np.count_nonzero,
}  # fmt: skip
"""Functions that move or compare entries."""


def matrix_product(arguments: tuple[Any, ...], result: Any) -> int:
    """Product of matrices or vectors, also of stacks of them: 2 b - 1 an entry of the result."""
    return _dot_length(np.shape(arguments[0])[-1:]) * np.size(result)


def total(arguments: tuple[Any, ...], result: Any) -> int:
    """Sum of entries, as a whole or along an axis."""
    return np.size(arguments[0]) - np.size(result)


def _norm(arguments: tuple[Any, ...], result: Any) -> Fraction | int:
    a, order = arguments[0], arguments[1] if len(arguments) > 1 else None
    if order == 2 and np.ndim(a) == 2:
        return _svd(arguments, result)
    # Squares, their sums, and a root each.
    return 2 * np.size(a)


def _vdot(arguments: tuple[Any, ...], _result: Any) -> int:
    return _dot_length((np.size(arguments[0]),))


def _dot_length(shape: tuple[int, ...]) -> int:
    return max(2 * shape[0] - 1, 0) if shape else 1


def _third(arguments: tuple[Any, ...], _result: Any) -> Fraction:
    return Fraction(len(arguments[0]) ** 3, 3)


def _two_thirds(arguments: tuple[Any, ...], result: Any) -> Fraction:
    return 2 * _third(arguments, result)


def _columns(array: Any) -> int:
    return 1 if np.ndim(array) == 1 else np.shape(array)[1]


def _substitution(arguments: tuple[Any, ...], _result: Any) -> int:
    return len(arguments[0]) ** 2 * _columns(arguments[1])


def _two_substitutions(arguments: tuple[Any, ...], result: Any) -> int:
    return 2 * _substitution(arguments, result)


def _cho_solve(arguments: tuple[Any, ...], result: Any) -> int:
    return _two_substitutions((arguments[0][0], arguments[1]), result)


def _solve(arguments: tuple[Any, ...], result: Any) -> Fraction:
    return _two_thirds(arguments, result) + _two_substitutions(arguments, result)


def _cholesky_solve(arguments: tuple[Any, ...], result: Any) -> Fraction:
    return _third(arguments, result) + _two_substitutions(arguments, result)


def _qr(arguments: tuple[Any, ...], _result: Any) -> Fraction:
    large, small = sorted(np.shape(arguments[0]), reverse=True)
    return 2 * small**2 * (large - Fraction(small, 3))


def _reflectors(arguments: tuple[Any, ...], _result: Any) -> int:
    side, _, factor, _, c = arguments[:5]
    m, k = np.shape(factor)
    others = np.shape(c)[1 if side == "L" else 0]
    return 4 * m * k * others - 2 * k**2 * others


def _eigh(arguments: tuple[Any, ...], _result: Any) -> int:
    return 9 * len(arguments[0]) ** 3


def _svd(arguments: tuple[Any, ...], _result: Any) -> Fraction:
    large, small = sorted(np.shape(arguments[0]), reverse=True)
    return 4 * large * small**2 - Fraction(4 * small**3, 3)


NUMPY: dict[Any, Cost] = {
    np.dot: matrix_product,
    np.inner: matrix_product,
    np.vdot: _vdot,
    np.outer: lambda _arguments, result: np.size(result),
    np.sum: total,
    np.trace: lambda arguments, _result: min(np.shape(arguments[0])) - 1,
    np.cross: lambda _arguments, result: 3 * np.size(result),
    np.linalg.norm: _norm,
    np.linalg.inv: _third,
    np.linalg.cholesky: _third,
    np.linalg.solve: _solve,
    np.linalg.eigh: _eigh,
}
"""Functions of NumPy that cost something."""

SCIPY: dict[Any, Cost] = {
    _linalg.inv: _third,
    _linalg.cholesky: _third,
    _linalg.cho_factor: _third,
    _linalg.cho_solve: _cho_solve,
    _linalg.solve_triangular: _substitution,
    _linalg.solve: _solve,
    _linalg.eigh: _eigh,
}
"""Functions of `scipy.linalg`."""

LAPACK: dict[str, Cost] = {
    "dpotrf": _third,
    "dpotri": _two_thirds,
    "dtrtri": _third,
    "dpotrs": _two_substitutions,
    "dtrtrs": _substitution,
    "dposv": _cholesky_solve,
    "dgeqrf": _qr,
    "dormqr": _reflectors,
}
"""Routines of `scipy.linalg.lapack`, by name."""
