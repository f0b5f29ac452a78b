"""Sums of rows, four rows at a time, so that the sum is read and written a quarter as often."""

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import part


@part
def add_rows(
    total: Float64[np.ndarray, " n"],
    rows: Float64[np.ndarray, "m n"],
    shares: Float64[np.ndarray, " s"],
    chosen: Int64[np.ndarray, " c"],
    count: int,
    offset: int,
) -> None:
    """Adds combinations of rows to a vector.

    Args:
        total: what is added to.
        rows: the rows.
        shares: factor of each row, from `offset` on.
        chosen: which rows.
        count: how many of them.
        offset: where the factor of the first row stands.
    """
    n, i = len(total), 0
    while i + 4 <= count:
        a, b, c, d = chosen[i], chosen[i + 1], chosen[i + 2], chosen[i + 3]
        r_a, r_b, r_c, r_d = rows[a], rows[b], rows[c], rows[d]
        s_a, s_b = shares[offset + a], shares[offset + b]
        s_c, s_d = shares[offset + c], shares[offset + d]
        for j in range(n):
            total[j] += s_a * r_a[j] + s_b * r_b[j] + s_c * r_c[j] + s_d * r_d[j]
        i += 4
    while i < count:
        row, share = rows[chosen[i]], shares[offset + chosen[i]]
        for j in range(n):
            total[j] += share * row[j]
        i += 1
