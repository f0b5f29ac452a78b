"""Random hierarchies of many kinds, each from a seed."""

import numpy as np

from poise.hqp import HierarchicalProblem, Level

from ..random_problems import random_problem


def feasible(seed):
    return random_problem(seed, feasible=True)


def degenerate(seed):
    return random_problem(seed, feasible=False)


def humanoid(seed):
    """As large as a humanoid's: 20 to 80 variables, 50 to 200 rows, 2 to 6 levels, conflicts."""
    rng = np.random.default_rng([seed, 2])
    n, count = int(rng.integers(20, 81)), int(rng.integers(2, 7))
    rows = rng.multinomial(int(rng.integers(50, 201)), np.full(count, 1.0 / count))
    inside = rng.standard_normal(n)
    tension = rng.choice([0.0, 0.1, 1.0])
    levels = []
    for k in rows:
        A = rng.standard_normal((k, n)) * (rng.random((k, n)) < rng.uniform(0.1, 1.0))
        centre = A @ inside + tension * rng.standard_normal(k) * (rng.random(k) < 0.3)
        room = np.where(rng.random(k) < 0.4, 0.0, rng.uniform(0.0, 2.0, k))
        levels.append(Level(A, centre - room, centre + room))
    root = rng.standard_normal((n, n)) * (rng.random((n, n)) < 0.1)
    H = root @ root.T + np.diag(10.0 ** rng.uniform(-4, 1, n))
    bounds = rng.uniform(0.5, 3.0, (2, n))
    return HierarchicalProblem(
        levels,
        H,
        rng.standard_normal(n),
        inside - bounds[0],
        inside + bounds[1],
        bounds_level=int(rng.integers(count)),
    )


def badly_scaled(seed):
    """Coefficients from 1e-8 to 1e8 in one problem: each row in a unit of its own."""
    rng = np.random.default_rng([seed, 3])
    problem = random_problem(seed, feasible=bool(seed % 2))
    scale = 10.0 ** rng.uniform(-8.0, 8.0, problem.m)
    problem.A *= scale[:, None]
    problem.lower[problem.n :] *= scale
    problem.upper[problem.n :] *= scale
    # In the same units, a level of such rows would be decided by its largest rows alone.
    problem.weights[problem.n :] /= scale
    return problem


def unequal_levels(seed):
    """Each level in a unit of its own, from 1e-8 to 1e8."""
    rng = np.random.default_rng([seed, 4])
    problem = random_problem(seed, feasible=bool(seed % 2))
    for view in problem.levels:
        scale = 10.0 ** rng.uniform(-8.0, 8.0)
        for part in (view.A, view.lower, view.upper):
            part *= scale
    return problem


def nearly_dependent(seed):
    """Levels whose singular values fall from 1 to 1e-6."""
    rng = np.random.default_rng([seed, 5])
    n = int(rng.integers(3, 21))
    inside, levels = rng.standard_normal(n), []
    for _ in range(int(rng.integers(1, 5))):
        k = int(rng.integers(1, 10))
        u, _ = np.linalg.qr(rng.standard_normal((k, k)))
        v, _ = np.linalg.qr(rng.standard_normal((n, n)))
        rank = min(k, n)
        A = u[:, :rank] * np.logspace(0, rng.uniform(-6, 0), rank) @ v[:rank]
        centre = A @ inside + rng.standard_normal(k) * rng.choice([0.0, 1.0])
        room = np.where(rng.random(k) < 0.5, 0.0, rng.uniform(0.0, 1.0, k))
        levels.append(Level(A, centre - room, centre + room))
    return HierarchicalProblem(levels)


def integers(seed):
    """Small whole numbers: ties everywhere, and many rows through each vertex."""
    rng = np.random.default_rng([seed, 6])
    n, levels = int(rng.integers(2, 9)), []
    for _ in range(int(rng.integers(1, 5))):
        k = int(rng.integers(1, 12))
        A = rng.integers(-1, 2, (k, n)).astype(float)
        lower = rng.integers(-2, 2, k).astype(float)
        levels.append(Level(A, lower, lower + rng.integers(0, 3, k)))
    box = rng.integers(0, 3, n).astype(float)
    H = np.diag(rng.integers(0, 3, n).astype(float)) if rng.random() < 0.3 else None
    return HierarchicalProblem(
        levels, H, None, -box, box, bounds_level=int(rng.integers(len(levels)))
    )


def overdetermined(seed):
    """More equalities than variables at the top: nothing is left for the levels below."""
    rng = np.random.default_rng([seed, 7])
    n = int(rng.integers(2, 12))
    k = n + int(rng.integers(1, 20))
    A, B = rng.standard_normal((k, n)), rng.standard_normal((5, n))
    b = A @ rng.standard_normal(n) + rng.choice([0.0, 1.0]) * rng.standard_normal(k)
    c = rng.standard_normal(5)
    return HierarchicalProblem(
        [Level(A, b, b), Level(np.zeros((0, n)), 0, 0), Level(B, c, c + (rng.random(5) < 0.5))]
    )


def duplicates(seed):
    """Few different rows, each many times over, in one level and in several."""
    rng = np.random.default_rng([seed, 8])
    n = int(rng.integers(2, 8))
    A = rng.standard_normal((4, n))
    levels = []
    for _ in range(int(rng.integers(1, 4))):
        picks = rng.integers(0, 4, int(rng.integers(10, 60)))
        centre = (
            rng.standard_normal(4)[picks] if rng.random() < 0.5 else rng.standard_normal(len(picks))
        )
        room = rng.choice([0.0, 0.5])
        levels.append(Level(A[picks], centre - room, centre + room))
    return HierarchicalProblem(levels)


def contradictory(seed, span):
    """Two levels of more rows than rank, each in its unit, half of them inequalities."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 12))
    levels = []
    for rows in (n + 3, 4):
        rank = min(rows, n - 2)
        A = rng.standard_normal((rows, rank)) @ rng.standard_normal((rank, n))
        room = np.where(rng.random(rows) < 0.5, rng.uniform(0.0, 1.0, rows), 0.0)
        centre = rng.standard_normal(rows)
        unit = 10.0 ** rng.uniform(-span / 2, span / 2, rows)
        levels.append(Level(A * unit[:, None], (centre - room) * unit, (centre + room) * unit))
    return HierarchicalProblem(levels)


FAMILIES = (
    feasible,
    degenerate,
    humanoid,
    badly_scaled,
    unequal_levels,
    nearly_dependent,
    integers,
    overdetermined,
    duplicates,
)
