"""How far answers jump from tick to tick: `python -m tests.hqp.active_set.jumps`."""

from collections import Counter

import numpy as np

from benchmarks.hqp import make_sequence
from poise.hqp import LexicographicSolver
from poise.hqp._weighted import WeightedSolver

SEQUENCES = ("ik-humanoid-overstretched", "push-humanoid33", "walk-touch-down-humanoid33")
TICKS = 31
DAMPING = 1e-2
EXACT_LEVELS = 2


def follow(problems, solver):
    """Solve tick after tick; return jumps relative to the median |x|, iterations, statuses."""
    answers = [solver.solve(problem) for problem in problems]
    x = np.array([answer.x for answer in answers])
    jumps = np.linalg.norm(np.diff(x, axis=0), axis=1) / np.median(np.linalg.norm(x, axis=1))
    statuses = Counter(answer.status.value for answer in answers)
    return jumps, [answer.iterations for answer in answers], dict(statuses)


def main():
    """Print one line a sequence and method."""
    for name in SEQUENCES:
        problems = make_sequence(name, TICKS).problems
        levels = np.arange(len(problems[0].levels))
        damping = np.where(levels < EXACT_LEVELS, 0.0, DAMPING)
        solvers = {
            "direct": LexicographicSolver(),
            f"direct, damping {DAMPING:g}": LexicographicSolver(damping=damping),
            "weighted": WeightedSolver(),
        }
        for label, solver in solvers.items():
            jumps, iterations, statuses = follow(problems, solver)
            print(
                f"{name:28} {label:20} jump of |x|: median {np.median(jumps):.1e}, most"
                f" {jumps.max():.1e}; most iterations {max(iterations)}; {statuses}"
            )


if __name__ == "__main__":
    main()
