"""The lexicographic optimality conditions, from a point and its multipliers alone.

With `a_i` the coefficients of bound or row i and `m_k` the multipliers of level k,

    sum_i m_ki a_i = 0,   m_ki = weight_i^2 slack_i on the level's own rows, 0 on those below,

and of an inequality's multipliers, highest level first, the first that is not zero is positive at
the upper bound and negative at the lower one. The final cost comes after the levels. Everything is
relative: rows to the numbers that cancel in them, forces to the largest that balances.
"""

import numpy as np

_CLEAR = 1e-10
"""Pushes above this share of the largest have a sign."""

_ROUNDING = 1e-14
"""Slack below this, relative to the numbers that cancel in its row, is none."""


def worst_violation(problem, x, multipliers):
    """By how much the conditions fail, relatively; `multipliers` has the final cost's last."""
    rows = np.vstack([np.eye(problem.n), problem.A])
    norms = np.linalg.norm(rows, axis=1)
    values = rows @ x
    slack = np.maximum(values - problem.upper, 0.0) - np.maximum(problem.lower - values, 0.0)
    bound = np.where(np.isfinite(problem.upper), np.abs(problem.upper), 0.0)
    bound = np.maximum(bound, np.where(np.isfinite(problem.lower), np.abs(problem.lower), 0.0))
    # How far x is, or would be if it met the rows one by one: rounding is relative to that.
    shares = np.divide(bound, norms, out=np.zeros(len(norms)), where=norms > 0.0)
    reach = max(np.linalg.norm(x), shares[problem.equality | (slack != 0.0)].max(initial=0.0))
    size = np.maximum(np.maximum(norms * reach, bound), 1e-300)
    free, worst = problem.lower == problem.upper, 0.0
    for level, found in enumerate(multipliers):
        pushes, force = found * norms, rows.T @ found
        if level < len(problem.levels):
            mine = problem.level_of == level
            miss = np.abs(found / problem.weights**2 - slack)[mine] / size[mine]
            worst = max(worst, miss.max(initial=0.0))
            assert not found[problem.level_of > level].any()
            scale = np.abs(pushes).max(initial=0.0)
        else:
            mine = np.zeros(len(values), dtype=bool)
            curvature = problem.H @ x
            force += curvature + problem.g
            scale = max(
                np.abs(pushes).max(),
                np.abs(problem.g).max(),
                np.abs(np.diag(problem.H)).max() * reach,
            )
        if scale > 0.0:
            worst = max(worst, np.abs(force).max() / scale)
        # A row's own slack has a sign beyond the rounding of its own numbers.
        own = mine & (np.abs(found / problem.weights**2) > _ROUNDING * size)
        signed = ~free & ((np.abs(pushes) > _CLEAR * scale) | own)
        for side, limit in ((1, problem.upper), (-1, problem.lower)):
            pushing = signed & (found * side > 0.0)
            gap = (values - limit)[pushing] * side
            # Own rows may be beyond their bound, all others have to be at it.
            gap = np.where(mine[pushing], np.minimum(gap, 0.0), gap)
            worst = max(worst, (np.abs(gap) / size[pushing]).max(initial=0.0))
        free = free | signed
    return worst


def beaten_by(problem, residuals, others):
    """Which methods meet some level better, all levels above it as well as `direct`."""
    return [
        other.name
        for other in others
        if (solution := other.solve(problem)).ok and _beats(solution.relative_residuals, residuals)
    ]


def _beats(theirs, ours):
    for their, our in zip(theirs, ours, strict=True):
        if our > their + 1e-6 * max(1.0, their):
            return True
        # What it gains below with what it gives up here is no gain; nor is rounding of that.
        if our < their - 1e-10 * max(1.0, their):
            return False
    return False
