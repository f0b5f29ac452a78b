"""The elimination of a chain's own motion, on small systems, by what it has to leave."""

import numpy as np
import pytest
from jaxtyping import Float64

from poise._compiled import compiled, view
from poise.control._reduced._elimination import ChainRows, answer, chain_rows, eliminate

INSIDE, NR = 6, 4
"""Unknowns that are eliminated, and those that stay."""


@compiled
def run(address: int) -> None:
    eliminate(view(ChainRows, address))


@compiled
def find(address: int, y: Float64[np.ndarray, " n"], p: Float64[np.ndarray, " np"]) -> None:
    answer(view(ChainRows, address), y, p)


class Eliminated:
    """What is left of E x + P p = e, and p as a function of x and of the p that stay unknowns."""

    def __init__(self, E, P, e, ends):
        self.rows = rows = chain_rows(NR + 1, INSIDE, np.array(ends))
        rows.E[:], rows.P[:], rows.ease[:] = np.vstack([E.T, -e]), P.T, 1.0
        run(rows.address)
        self.used, self.kept, self.left = rows.used, rows.kept, rows.left.tolist()
        chosen, weak = rows.kept_rows[: sum(self.left)], rows.weak[: self.kept]
        self.coefficients = np.vstack([rows.E[:NR, chosen], rows.P[np.ix_(weak, chosen)]]).T
        self.values = -rows.E[NR, chosen]

    def recover(self, x, s=()):
        p = np.full(INSIDE, np.nan)
        find(self.rows.address, np.concatenate([x, [1.0], s]), p)
        return p


def system(seed, count):
    rng = np.random.default_rng(seed)
    E, P, e = rng.normal(size=(count, NR)), rng.normal(size=(count, INSIDE)), rng.normal(size=count)
    return rng, E, P, e


@pytest.mark.parametrize("seed", range(5))
def test_levels_that_the_chain_can_follow_are_met_for_any_motion_of_the_rest(seed):
    rng, E, P, e = system(seed, 5)
    found = Eliminated(E, P, e, [0, 2, 5])
    assert (found.used, found.kept, found.left) == (5, 0, [0, 0])
    x = rng.normal(size=NR)
    np.testing.assert_allclose(E @ x + P @ found.recover(x), e, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_a_level_is_followed_with_the_least_energy(seed):
    rng, E, P, e = system(seed, 4)
    found = Eliminated(E, P, e, [0, 1, 4])
    x = rng.normal(size=NR)
    np.testing.assert_allclose(found.recover(x), np.linalg.pinv(P) @ (e - E @ x), atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_of_rows_that_depend_on_each_other_their_contradiction_is_left(seed):
    """The third row is the sum of the first two in p, and asks for something else."""
    rng, E, P, e = system(seed, 3)
    P[2] = P[0] + P[1]
    found = Eliminated(E, P, e, [0, 3])
    assert (found.used, found.kept, found.left) == (2, 0, [1])
    expected = np.append(E[0] + E[1] - E[2], e[0] + e[1] - e[2]) / np.sqrt(3.0)
    left = np.append(found.coefficients[0], found.values[0])
    np.testing.assert_allclose(left * np.sign(left @ expected), expected, atol=1e-9)
    # What p can do about the rows, it does: nothing of the residual is in the range of P.
    x = rng.normal(size=NR)
    np.testing.assert_allclose(P.T @ (E @ x + P @ found.recover(x) - e), 0.0, atol=1e-9)


def test_a_level_below_gets_what_the_ones_above_leave():
    """More rows than unknowns: six are met, the rest is left whatever x is."""
    rng, E, P, e = system(0, 9)
    found = Eliminated(E, P, e, [0, 4, 9])
    assert (found.used, found.kept, found.left) == (6, 0, [0, 3])
    x = rng.normal(size=NR)
    residual = E @ x + P @ found.recover(x) - e
    np.testing.assert_allclose(residual[:4], 0.0, atol=1e-9)
    left = found.coefficients @ x - found.values
    assert np.linalg.norm(residual) == pytest.approx(np.linalg.norm(left))


@pytest.mark.parametrize("ends", [[0, 20], [0, 4, 20], [0, 6, 20], [0, 2, 8, 20]])
def test_of_a_level_no_more_rows_are_left_than_unknowns(ends):
    """What x can do about the level is in them; what it cannot, no row says."""
    rng, E, P, e = system(1, 20)
    found = Eliminated(E, P, e, ends)
    assert (found.used, found.kept, found.left[-1]) == (6, 0, NR)
    last = slice(ends[-2], None)
    out_of_reach = []
    for _ in range(3):
        x = rng.normal(size=NR)
        residual = E @ x + P @ found.recover(x) - e
        left = (found.coefficients @ x - found.values)[-NR:]
        out_of_reach.append(residual[last] @ residual[last] - left @ left)
    assert out_of_reach[0] > 0.0
    np.testing.assert_allclose(out_of_reach, out_of_reach[0])


@pytest.mark.parametrize("ends", [[0, 3], [0, 3, 9], [0, 9]])
def test_what_the_chain_hardly_moves_stays_unknown(ends):
    """Eliminated, what is a ten-thousandth of the rest would take ten thousand times as much."""
    rng, E, P, e = system(2, ends[-1])
    U, size, V = np.linalg.svd(P[: ends[1]], full_matrices=False)
    size[-1] = 1e-4 * size[0]
    P[: ends[1]] = U * size @ V
    found = Eliminated(E, P, e, ends)
    assert found.kept == 1
    assert np.abs(found.rows.G[: NR + 1]).max() < 1e2
    x, s = rng.normal(size=NR), rng.normal(size=1)
    residual = E @ x + P @ found.recover(x, s) - e
    left = found.coefficients @ np.append(x, s) - found.values
    # Row for row in another order, and a level's may be combined.
    assert np.linalg.norm(residual) == pytest.approx(np.linalg.norm(left))


def test_no_number_ends_in_no_number():
    _, E, P, e = system(0, 9)
    P[0, 0] = np.nan
    found = Eliminated(E, P, e, [0, 4, 9])
    assert not np.isfinite(found.coefficients).all() or not np.isfinite(found.values).all()
