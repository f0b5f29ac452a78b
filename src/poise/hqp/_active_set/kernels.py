"""Compiled sums, copies and Householder reflections I - tau v v^T of rows.

Many rows go four at a time: their sums do not wait for each other, and a total is read and written
a quarter as often.
"""

from math import sqrt
from typing import Any

from poise._compiled import part
from poise.hqp._active_set.workspace import Indices, Matrix, Vector


@part
def copy(to: Vector, x: Vector) -> None:
    """To <- x; NumPy's assignment would compile the message of an error that cannot happen."""
    for i in range(len(to)):
        to[i] = x[i]


@part
def add_multiple(to: Vector, factor: Any, x: Vector) -> None:
    """To <- to + factor x."""
    for i in range(len(to)):
        to[i] += factor * x[i]


@part
def dot(x: Vector, y: Vector) -> float:
    """x^T y, over the length of x."""
    total = 0.0
    for i in range(len(x)):
        total += x[i] * y[i]
    return total


@part
def minus_dot(total: Any, x: Vector, y: Vector) -> float:
    """Total - x^T y, over the length of x."""
    for i in range(len(x)):
        total -= x[i] * y[i]
    return total


@part
def norm_of(x: Vector) -> float:
    """The Euclidean norm of a vector."""
    return sqrt(dot(x, x))


@part
def multiply(A: Matrix, x: Vector, out: Vector) -> None:
    """Out <- A x."""
    m, i = len(A), 0
    while i + 4 <= m:
        r_0, r_1, r_2, r_3 = A[i], A[i + 1], A[i + 2], A[i + 3]
        s_0 = s_1 = s_2 = s_3 = 0.0
        for j in range(len(x)):
            s_0 += r_0[j] * x[j]
            s_1 += r_1[j] * x[j]
            s_2 += r_2[j] * x[j]
            s_3 += r_3[j] * x[j]
        out[i], out[i + 1], out[i + 2], out[i + 3] = s_0, s_1, s_2, s_3
        i += 4
    while i < m:
        out[i] = dot(x, A[i])
        i += 1


@part
def find_norms(A: Matrix, out: Vector) -> None:
    """Find the Euclidean norms of rows."""
    m, i = len(A), 0
    while i + 4 <= m:
        r_0, r_1, r_2, r_3 = A[i], A[i + 1], A[i + 2], A[i + 3]
        s_0 = s_1 = s_2 = s_3 = 0.0
        for j in range(len(r_0)):
            s_0 += r_0[j] * r_0[j]
            s_1 += r_1[j] * r_1[j]
            s_2 += r_2[j] * r_2[j]
            s_3 += r_3[j] * r_3[j]
        out[i], out[i + 1], out[i + 2], out[i + 3] = sqrt(s_0), sqrt(s_1), sqrt(s_2), sqrt(s_3)
        i += 4
    while i < m:
        out[i] = norm_of(A[i])
        i += 1


@part
def make_reflection(x: Vector, v: Vector) -> float:
    """Find the reflection of x onto (-+|x|, 0, ..., 0), away from its first number."""
    first, norm = x[0], norm_of(x)
    end = -norm if first >= 0.0 else norm
    # Scaled so that v begins with one and no square overflows or underflows.
    scale = 1.0 / (first - end)
    for i in range(len(x)):
        v[i], x[i] = x[i] * scale, 0.0
    v[0], x[0] = 1.0, end
    return (end - first) / end


@part
def reflect(x: Vector, v: Vector, tau: float) -> None:
    """X <- (I - tau v v^T) x."""
    add_multiple(x[: len(v)], -tau * dot(v, x), v)


@part
def reflect_rows(X: Matrix, begin: int, end: int, column: int, v: Vector, tau: float) -> None:
    """Reflect rows from a column on."""
    n, i = len(v), begin
    while i + 4 <= end:
        # Numba takes a single row for contiguous, unlike a block of X.
        x_0, x_1, x_2, x_3 = X[i, column:], X[i + 1, column:], X[i + 2, column:], X[i + 3, column:]
        s_0 = s_1 = s_2 = s_3 = 0.0
        for j in range(n):
            s_0 += v[j] * x_0[j]
            s_1 += v[j] * x_1[j]
            s_2 += v[j] * x_2[j]
            s_3 += v[j] * x_3[j]
        s_0 *= tau
        s_1 *= tau
        s_2 *= tau
        s_3 *= tau
        for j in range(n):
            x_0[j] -= s_0 * v[j]
            x_1[j] -= s_1 * v[j]
            x_2[j] -= s_2 * v[j]
            x_3[j] -= s_3 * v[j]
        i += 4
    while i < end:
        reflect(X[i, column:], v, tau)
        i += 1


@part
def reflect_rows_by_all(
    X: Matrix, begin: int, end: int, V: Matrix, tau: Vector, start: int, stop: int, way: int
) -> None:
    """Reflect rows by some of the vectors in V, in order or, with way -1, in reverse order."""
    k, count, first = 0, stop - start, start if way > 0 else stop - 1
    while k + 4 <= count:
        i = first + way * k
        _reflect_rows_by_four(X, begin, end, V, tau, i, way, min(i, i + 3 * way))
        k += 4
    while k < count:
        i = first + way * k
        reflect_rows(X, begin, end, i, V[i, i:], tau[i])
        k += 1


@part
def _reflect_rows_by_four(
    X: Matrix, begin: int, end: int, V: Matrix, tau: Vector, first: int, way: int, column: int
) -> None:
    """Apply four reflections in one pass over each row."""
    a, b, c, d = first, first + way, first + 2 * way, first + 3 * way
    v_a, v_b, v_c, v_d = V[a, column:], V[b, column:], V[c, column:], V[d, column:]
    t_a, t_b, t_c, t_d = tau[a], tau[b], tau[c], tau[d]
    ab = ac = ad = bc = bd = cd = 0.0
    for j in range(len(v_a)):
        ab += v_a[j] * v_b[j]
        ac += v_a[j] * v_c[j]
        ad += v_a[j] * v_d[j]
        bc += v_b[j] * v_c[j]
        bd += v_b[j] * v_d[j]
        cd += v_c[j] * v_d[j]
    for i in range(begin, end):
        x = X[i, column:]
        s_a = s_b = s_c = s_d = 0.0
        for j in range(len(v_a)):
            s_a += v_a[j] * x[j]
            s_b += v_b[j] * x[j]
            s_c += v_c[j] * x[j]
            s_d += v_d[j] * x[j]
        # Each acts on what those before it left.
        s_a *= t_a
        s_b = t_b * (s_b - s_a * ab)
        s_c = t_c * (s_c - s_a * ac - s_b * bc)
        s_d = t_d * (s_d - s_a * ad - s_b * bd - s_c * cd)
        for j in range(len(v_a)):
            x[j] -= s_a * v_a[j] + s_b * v_b[j] + s_c * v_c[j] + s_d * v_d[j]


@part
def add_rows(
    total: Vector, rows: Matrix, factors: Vector, chosen: Indices, count: int, offset: int
) -> None:
    """Add a combination of the chosen rows to a vector."""
    n, i = len(total), 0
    while i + 4 <= count:
        a, b, c, d = chosen[i], chosen[i + 1], chosen[i + 2], chosen[i + 3]
        r_a, r_b, r_c, r_d = rows[a], rows[b], rows[c], rows[d]
        f_a, f_b = factors[offset + a], factors[offset + b]
        f_c, f_d = factors[offset + c], factors[offset + d]
        for j in range(n):
            total[j] += f_a * r_a[j] + f_b * r_b[j] + f_c * r_c[j] + f_d * r_d[j]
        i += 4
    while i < count:
        add_multiple(total, factors[offset + chosen[i]], rows[chosen[i]])
        i += 1


@part
def choose_nonzero(x: Vector, chosen: Indices) -> int:
    """List the places of the nonzero numbers; return their count."""
    count = 0
    for j in range(len(x)):
        chosen[count] = j
        # Without an unpredictable branch.
        count += 1 if x[j] != 0.0 else 0
    return count


@part
def measure_values(
    lower: Vector,
    upper: Vector,
    weights: Vector,
    level_of: Indices,
    values: Vector,
    slacks: Vector,
    residuals: Vector,
) -> None:
    """Find the signed slacks of rows of such values, and `|W w|` of each level."""
    residuals[:] = 0.0
    for i in range(len(values)):
        slack = max(values[i] - upper[i], 0.0) - max(lower[i] - values[i], 0.0)
        slacks[i] = slack
        residuals[level_of[i]] += slack * weights[i] * (slack * weights[i])
    for level in range(len(residuals)):
        residuals[level] = sqrt(residuals[level])
