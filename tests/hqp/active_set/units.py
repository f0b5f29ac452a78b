"""Contradictions among rows in units far apart, in one level.

`python -m tests.hqp.active_set.units`
"""

from collections import Counter

import numpy as np

from poise.hqp import HierarchicalProblem, Level, LexicographicSolver

SPANS = (8, 10, 12, 14, 16)
"""Powers of ten that the units of a level's rows span."""

COUNT = 200


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


def main():
    """Print how the searches end, span by span."""
    solver = LexicographicSolver()
    for span in SPANS:
        statuses = Counter()
        for seed in range(COUNT):
            solver.reset()
            statuses[solver.run(contradictory(seed, span)).value] += 1
        print(f"units within 1e{span}: {dict(statuses)}")


if __name__ == "__main__":
    main()
