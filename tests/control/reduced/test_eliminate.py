"""The elimination of a chain's own motion, on small systems, by what it has to leave."""

import numpy as np
import pytest

from poise.control._reduced._eliminate import Eliminated, eliminate, restore

INSIDE, NR = 6, 4
"""Unknowns that are eliminated, and those that stay."""


def eliminated(E, P, e, ends):
    """What is left of E x + P p = e, and p as a function of x."""
    m, width = len(e), NR + INSIDE
    out = Eliminated(
        G=np.zeros((INSIDE, width)),
        c=np.zeros(INSIDE),
        V=np.zeros((INSIDE, INSIDE)),
        tau=np.zeros(INSIDE),
        rows=np.zeros((m, width)),
        values=np.zeros(m),
        left=np.zeros(len(ends) - 1, dtype=np.int64),
        scratch=np.zeros(2 * m + width),
        before=np.zeros((m, INSIDE)),
    )
    wide = np.hstack([E, np.zeros((m, INSIDE))])
    done, kept = eliminate(wide, P.copy(), e.copy(), NR, np.array(ends), out)

    def recover(x):
        p = out.c - out.G[:, :NR] @ x
        p[done:] = 0.0
        restore(p, out.V, out.tau, done)
        return p

    return out, done, kept, recover


@pytest.mark.parametrize("seed", range(5))
def test_levels_that_the_chain_can_follow_are_met_for_any_motion_of_the_rest(seed):
    rng = np.random.default_rng(seed)
    E, P, e = rng.normal(size=(5, NR)), rng.normal(size=(5, INSIDE)), rng.normal(size=5)
    out, done, kept, recover = eliminated(E, P, e, [0, 2, 5])
    assert (done, kept, out.left.tolist()) == (5, 0, [0, 0])
    x = rng.normal(size=NR)
    np.testing.assert_allclose(E @ x + P @ recover(x), e, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_of_rows_that_depend_on_each_other_their_contradiction_is_left(seed):
    """The third row is the sum of the first two in p, and asks for something else."""
    rng = np.random.default_rng(seed)
    E, P, e = rng.normal(size=(3, NR)), rng.normal(size=(3, INSIDE)), rng.normal(size=3)
    P[2] = P[0] + P[1]
    out, done, kept, recover = eliminated(E, P, e, [0, 3])
    assert (done, kept, out.left.tolist()) == (2, 0, [1])
    expected = np.append(E[0] + E[1] - E[2], e[0] + e[1] - e[2]) / np.sqrt(3.0)
    found = np.append(out.rows[0, :NR], out.values[0])
    np.testing.assert_allclose(found * np.sign(found @ expected), expected, atol=1e-9)
    # What p can do about the rows, it does: nothing of the residual is in the range of P.
    x = rng.normal(size=NR)
    np.testing.assert_allclose(P.T @ (E @ x + P @ recover(x) - e), 0.0, atol=1e-9)


def test_a_level_below_gets_what_the_ones_above_leave():
    """More rows than unknowns: six are met, the rest is left whatever x is."""
    rng = np.random.default_rng(0)
    E, P, e = rng.normal(size=(9, NR)), rng.normal(size=(9, INSIDE)), rng.normal(size=9)
    out, done, kept, recover = eliminated(E, P, e, [0, 4, 9])
    assert (done, kept, out.left.tolist()) == (6, 0, [0, 3])
    x = rng.normal(size=NR)
    residual = E @ x + P @ recover(x) - e
    np.testing.assert_allclose(residual[:4], 0.0, atol=1e-9)
    left = out.rows[:3, :NR] @ x - out.values[:3]
    assert np.linalg.norm(residual) == pytest.approx(np.linalg.norm(left))
