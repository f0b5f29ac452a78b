"""Random hierarchies: feasible ones, and ones that are degenerate or in conflict."""

import numpy as np

from poise.hqp import HierarchicalProblem, Level


def random_problem(seed: int, *, feasible: bool) -> HierarchicalProblem:
    """Mixed rows, 1 to 5 levels, 2 to 20 variables; a feasible one has a point in all rows."""
    rng = np.random.default_rng([seed, int(feasible)])
    n = int(rng.integers(2, 21))
    inside = rng.standard_normal(n)
    earlier = np.zeros((0, n))
    levels = []
    for _ in range(int(rng.integers(1, 6))):
        rows = int(rng.integers(0, 9))
        A = _coefficients(rng, rows, n, earlier)
        centre = A @ inside
        if not feasible and rng.random() < 0.6:
            centre = centre + rng.standard_normal(rows) * rng.choice([0.0, 1.0, 5.0], rows)
        lower, upper = _bounds(rng, centre)
        weights = 10.0 ** rng.uniform(-1.0, 1.0, rows) if rng.random() < 0.5 else None
        levels.append(Level(A, lower, upper, weights))
        earlier = np.vstack([earlier, A])
    H = g = x_lower = x_upper = None
    if rng.random() < 0.5:
        root = rng.standard_normal((n, n))
        H = root @ root.T + 0.1 * np.eye(n)
        g = rng.standard_normal(n)
    if rng.random() < 0.4:
        x_lower = np.where(rng.random(n) < 0.6, inside - rng.uniform(0.0, 1.0, n), -np.inf)
        x_upper = np.where(rng.random(n) < 0.6, inside + rng.uniform(0.0, 1.0, n), np.inf)
        if not feasible:
            shift = rng.standard_normal(n)
            x_lower, x_upper = x_lower + shift, x_upper + shift
    return HierarchicalProblem(
        levels, H, g, x_lower, x_upper, bounds_level=int(rng.integers(len(levels)))
    )


def _coefficients(rng, rows, n, earlier):
    A = rng.standard_normal((rows, n))
    kind = rng.random()
    if rows and kind < 0.25:  # rank-deficient
        rank = int(rng.integers(1, min(rows, n) + 1))
        A = rng.standard_normal((rows, rank)) @ rng.standard_normal((rank, n))
    elif kind < 0.4:  # sparse, with zero rows now and then
        A *= rng.random((rows, n)) < 0.3
    if rows and len(earlier) and rng.random() < 0.4:  # repeats or combines rows seen before
        picks = rng.integers(0, len(earlier), max(1, rows // 2))
        A[: len(picks)] = earlier[picks]
        A[-1] = rng.standard_normal(len(earlier)) @ earlier
    if rows >= 2 and rng.random() < 0.2:
        A[1] = A[0]
    if rows and rng.random() < 0.1:
        A[int(rng.integers(rows))] = 0.0
    return A


def _bounds(rng, centre):
    rows = len(centre)
    kind = rng.integers(0, 5, rows)  # 0, 1: equality; 2: two-sided; 3: lower only; 4: upper only
    below, above = rng.uniform(0.0, 1.0, (2, rows))
    tight = rng.random(rows) < 0.2
    below[tight] = 0.0
    lower, upper = centre - below, centre + above
    lower[kind <= 1] = upper[kind <= 1] = centre[kind <= 1]
    lower[kind == 4] = -np.inf
    upper[kind == 3] = np.inf
    return lower, upper
