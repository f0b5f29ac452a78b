"""Draws the picture of the lexicographic solver: one factorisation, and how the search goes.

    python docs/images/draw_lexls.py

It solves the problems in `problems/` and prints what the picture says in numbers.
"""

from collections import Counter
from functools import partial
from pathlib import Path
from timeit import repeat

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Rectangle
from PIL import Image

from poise.bench.hqp import load_sequence
from poise.hqp import HierarchicalProblem
from poise.hqp.lexls import LexicographicSolver
from poise.hqp.lexls.guess import guess
from poise.hqp.lexls.optimum import find_optimum
from poise.hqp.lexls.search import CONVERGED
from poise.hqp.lexls.tolerances import COLD_CHANGES, WARM_CHANGES
from poise.hqp.lexls.workspace import (
    BEGINNING,
    BEGUN,
    CHANGES,
    ENOUGH,
    EQUALITY,
    FREE,
    GUESSED,
    LEAPING,
    PHASE,
    STEPPING,
    Problem,
    Work,
)
from poise.linalg import compiled
from poise.report.plots.style import INK, LINE, MUTED, PALETTE, house_style

HERE = Path(__file__).parent
PROBLEMS = HERE.parents[1] / "problems"
EXAMPLE, NUMBER = "push-humanoid33", 2
WORDS = {"contacts": "contacts, cones, ...", "com, pelvis, momentum": "com, pelvis, ..."}
SLACK = "#C81E1E"
UPRIGHT = {"rotation": 90, "ha": "right", "va": "top"}
NOTHING = 1e-9
"""Of a row's length, below which a coefficient is drawn as zero."""

FAINT = 1e-4
"""Likewise, what is drawn faintest."""

MANY = 10
"""Sequences are shown whose cold problems take more single steps than this, in the median."""

STEPS, LEAPS, ALL = "single steps alone", "leaps, then steps", "with a guess, as it is"
WAYS = {STEPS: (BEGINNING, False), LEAPS: (LEAPING, False), ALL: (LEAPING, True)}
FIRST = "in the first factorisation"
EASY = {LEAPING: "by a leap before the guess", STEPPING: "by steps before the guess"}
HARD = {LEAPING: "by a leap after the guess", STEPPING: "by steps after the guess"}


# --- the factorisation ------------------------------------------------------------------------


def draw_factor(ax: Axes) -> None:
    """The active rows of the example in y = Q^T x, level by level, with their slack beside them."""
    problem = load_sequence(PROBLEMS / f"{EXAMPLE}.npz").problems[NUMBER]
    solver = LexicographicSolver()
    solver.run(problem)
    work = solver._work
    levels, n = len(problem.levels), problem.n
    rows, free = int(work.begin[levels]), int(work.state[FREE])
    R = rotated_rows(problem, solver)
    for level in range(levels):
        draw_level(ax, problem, solver, R, level)
    ax.add_patch(
        Rectangle((n - free, 0), free, rows, facecolor="none", edgecolor=MUTED, hatch="////", lw=0)
    )
    ax.text(n - free - 1, 1.2, f"{free} left for\nthe final cost", ha="right", va="top")
    ax.text(n / 2, -0.8, f"{n} coordinates y = Q^T x", ha="center", color=MUTED)
    ax.text(-2.0, 0, f"{rows} active rows, of {n + problem.m}", color=MUTED, **UPRIGHT)
    draw_key(ax, rows)
    ax.set(xlim=(-3.5, n + 20), ylim=(rows + 5, -2.5), aspect="equal", anchor="NW")
    ax.axis("off")
    ax.set_title("One factorisation of all levels", x=0.02)


def draw_key(ax: Axes, rows: int) -> None:
    """What the small squares mean."""
    words = {INK: "pivot", MUTED: "active inequality", SLACK: "row with slack"}
    for x, (colour, word) in zip((0.0, 9.0, 28.0), words.items(), strict=True):
        side = 0.5 if word == "pivot" else 0.8
        ax.add_patch(Rectangle((x, rows + 2.6 - side / 2), side, side, color=colour, lw=0))
        ax.text(x + 1.6, rows + 2.6, word, va="center")


def rotated_rows(problem: HierarchicalProblem, solver: LexicographicSolver) -> np.ndarray:
    """Active rows of length one in y, computed anew from the problem and the reflections."""
    work, n = solver._work, problem.n
    Q = np.eye(n)
    for k in range(int(work.first[len(problem.levels)])):
        v = np.append(np.zeros(k), work.V[k, k:])
        Q -= work.tau[k] * np.outer(Q @ v, v)
    a = np.vstack([np.eye(n), problem.A])[work.order[: work.begin[len(problem.levels)]]]
    return a @ Q / np.linalg.norm(a, axis=1)[:, None]


def draw_level(
    ax: Axes, problem: HierarchicalProblem, solver: LexicographicSolver, R: np.ndarray, level: int
) -> None:
    """A level's rows: all they see, the coordinates it takes, its pivots, and who has slack."""
    work, colour = solver._work, PALETTE[level]
    begin, end = int(work.begin[level]), int(work.begin[level + 1])
    first, rank, n = int(work.first[level]), int(work.rank[level]), problem.n
    size = np.abs(R[begin:end])
    right = float(size[:, first + rank :].max(initial=0.0))
    print(f"level {level + 1}: {end - begin} rows, rank {rank}, right of the trapezoid {right:.0e}")
    shade = np.log10(np.maximum(size, FAINT) / FAINT) / -np.log10(FAINT)
    shade = np.where(size > NOTHING, 0.15 + 0.85 * shade, np.nan)
    map_ = LinearSegmentedColormap.from_list("level", ["#FFFFFF", colour])
    ax.imshow(shade, cmap=map_, vmin=0.0, vmax=1.15, extent=(0, n, end, begin), aspect="equal")
    if rank > 0:
        place, side = (first, begin), (rank, end - begin)
        ax.add_patch(Rectangle(place, *side, facecolor="none", edgecolor=colour, lw=1.4))
        k = np.arange(rank)
        ax.scatter(first + k + 0.5, begin + k + 0.5, s=3.2, c=INK, marker="s", lw=0, zorder=3)
    ax.add_patch(Rectangle((n + 2.0, begin + 0.15), 0.7, end - begin - 0.3, color=colour, lw=0))
    for row in range(begin, end):
        if work.side[work.order[row]] != EQUALITY:
            ax.add_patch(Rectangle((-1.1, row + 0.1), 0.8, 0.8, color=MUTED, lw=0))
        if work.slack[row] != 0.0:
            ax.add_patch(Rectangle((n + 0.4, row + 0.1), 0.8, 0.8, color=SLACK, lw=0))
    name = problem.levels[level].name
    words = f"{level + 1}  {WORDS.get(name, name)}\n{what_became(end - begin, rank)}"
    ax.text(n + 3.6, begin + min((end - begin) / 2, 4.0), words, va="center", linespacing=1.3)


def what_became(rows: int, rank: int) -> str:
    """How many of its rows decide something."""
    if rank == rows:
        return f"{rows} rows, all pivots"
    if rank == 0:
        return f"{rows} rows, none decides"
    return f"{rows} rows, {rank} pivots"


# --- the search -------------------------------------------------------------------------------


def count_ends() -> dict[str, Counter[str]]:
    """In which phase the searches of the problem set end, from a cold and from a warm start."""
    solver, ends = LexicographicSolver(), {"cold": Counter(), "warm": Counter()}
    for path in sorted(PROBLEMS.glob("*.npz")):
        sequence = load_sequence(path)
        for start, found in ends.items():
            if start == "warm" and not sequence.consecutive:
                continue
            for k, problem in enumerate(sequence.problems):
                if start == "cold" or k == 0:
                    solver.reset()
                ok = solver.run(problem).ok
                if start == "cold" or k > 0:
                    found[end_of(solver) if ok else "not optimal"] += 1
    return ends


def end_of(solver: LexicographicSolver) -> str:
    """In which phase the last search ended."""
    state = solver._work.state
    if solver.changes == 1:
        return FIRST
    return (HARD if state[GUESSED] else EASY)[int(state[PHASE])]


def draw_search(ax: Axes, ends: dict[str, Counter[str]]) -> None:
    """The phases, one below the other, and the share of searches that end in each."""
    ax.set(xlim=(0, 100), ylim=(0, 100))
    ax.axis("off")
    ax.set_title("The search, and the share that ends where", x=0.0)
    box(ax, 0, 77, 30, 17, "cold\nequalities are active;\nleaps", PALETTE[0])
    box(ax, 34, 77, 30, 17, "warm\nthe last active set;\nsingle steps", PALETTE[0])
    box(
        ax,
        0,
        50,
        64,
        14,
        "guess, from none, level by level:\ndual method with penalties",
        PALETTE[1],
    )
    box(
        ax,
        0,
        28,
        64,
        14,
        "leaps: lets go of what pulls and\nadds what is violated, many rows at once",
        PALETTE[2],
    )
    box(
        ax,
        0,
        3,
        64,
        14,
        "single steps: goes as far as the next row\nthat is in the way, or lets go of one",
        PALETTE[3],
    )
    arrow(ax, 15, 77, 64.5, f"{COLD_CHANGES} factorisations,\nor doubt")
    arrow(ax, 49, 77, 64.5, f"{WARM_CHANGES} factorisations,\nor doubt")
    arrow(ax, 32, 50, 42.5, "")
    arrow(ax, 32, 28, 17.5, "no progress")
    lines = {
        89: ("at once", [FIRST]),
        81: ("then", list(EASY.values())),
        35: ("", [HARD[LEAPING]]),
        10: ("", [HARD[STEPPING]]),
    }
    for right, (start, found) in zip((74, 88), ends.items(), strict=True):
        ax.text(right, 96, f"{found.total()}\n{start}", ha="right", weight="bold")
        for height, (_, keys) in lines.items():
            share = sum(found[key] for key in keys) / found.total()
            ax.text(right, height, f"{100 * share:.0f}%", ha="right", va="center")
    for height, (word, _) in lines.items():
        ax.text(90, height, word, va="center", color=MUTED)


def box(ax: Axes, x: float, y: float, width: float, height: float, text: str, colour: str) -> None:
    """A phase."""
    style = "round,pad=0,rounding_size=2"
    ax.add_patch(
        FancyBboxPatch(
            (x, y), width, height, boxstyle=style, fc="white", ec=colour, lw=1.4, clip_on=False
        )
    )
    ax.text(x + width / 2, y + height / 2, text, ha="center", va="center", linespacing=1.25)


def arrow(ax: Axes, x: float, top: float, bottom: float, text: str) -> None:
    """From one phase to the next, and why."""
    ax.annotate("", (x, bottom), (x, top), arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1})
    ax.text(x + 1.5, (top + bottom) / 2, text, va="center", color=MUTED, fontsize=8)


def count_ways() -> dict[str, dict[str, float]]:
    """Median of the factorisations that a cold search takes by each way, sequence by sequence."""
    solver, found = LexicographicSolver(), {}
    for path in sorted(PROBLEMS.glob("*.npz")):
        problems = load_sequence(path).problems
        counts = {
            way: float(np.median([search(solver, problem, *WAYS[way]) for problem in problems]))
            for way in WAYS
        }
        if counts[STEPS] > MANY:
            found[path.stem] = counts
    return dict(sorted(found.items(), key=lambda item: item[1][STEPS]))


def search(
    solver: LexicographicSolver, problem: HierarchicalProblem, phase: int, may_guess: bool
) -> int:
    """How many factorisations a cold search takes that begins in a phase."""
    solver.reset()
    solver._fit(problem)
    state = solver._work.state
    state[BEGUN] = 0
    # Sets the search up and ends at once.
    solver._search(problem, 0)
    state[PHASE] = phase
    if not may_guess:
        state[ENOUGH], state[GUESSED] = 0, 1
    if solver._search(problem, solver._limit) != CONVERGED:
        raise RuntimeError("a search that is counted should end at the optimum")
    return solver.changes


def draw_ways(ax: Axes, ways: dict[str, dict[str, float]]) -> None:
    """One line a sequence, one dot a way."""
    for place, counts in enumerate(ways.values()):
        ax.plot([min(counts.values()), max(counts.values())], [place] * 2, color=LINE, lw=2)
    for way, colour, marker in zip(WAYS, (PALETTE[3], PALETTE[2], PALETTE[1]), "so^", strict=True):
        x = [counts[way] for counts in ways.values()]
        ax.scatter(x, range(len(x)), s=26, c=colour, marker=marker, label=way, zorder=3)
    ax.set_yticks(range(len(ways)), list(ways))
    ax.set_xscale("log")
    ax.set_xticks([1, 3, 10, 30, 100, 300], ["1", "3", "10", "30", "100", "300"])
    ax.minorticks_off()
    ax.set_xlim(1, None)
    ax.tick_params(length=0)
    ax.set_title("Factorisations of a cold search", x=0.0)
    ax.legend(loc="upper right", bbox_to_anchor=(1.0, -0.09), ncols=3, columnspacing=1.2)


@compiled
def run_guess(problem: Problem, work: Work) -> None:
    """The guess, which only compiled functions may call."""
    guess(problem, work)


@compiled
def run_factoring(problem: Problem, work: Work) -> None:
    """Likewise the factorisation."""
    find_optimum(problem, work)


def time_guess() -> list[float]:
    """How many factorisations a guess takes the time of, for the first problem of each sequence."""
    solver, ratios = LexicographicSolver(), []
    for path in sorted(PROBLEMS.glob("*.npz")):
        problem = load_sequence(path).problems[0]
        solver.reset()
        solver.run(problem)
        numbers = (problem.A, problem.lower, problem.upper, problem.weights, problem.H, problem.g)
        whole = Problem(*numbers, solver._damping, solver._starts, problem.bounds_level)
        solver._work.state[CHANGES] = 1  # So that every level is factored anew.
        factoring = min(repeat(partial(run_factoring, whole, solver._work), number=1, repeat=9))
        guessing = min(repeat(partial(run_guess, whole, solver._work), number=1, repeat=9))
        ratios.append(guessing / factoring)
    return sorted(ratios)


def main() -> None:
    """Solves, prints, draws."""
    ends, ways = count_ends(), count_ways()
    for start, found in ends.items():
        print(start, found.total(), dict(found))
    for name, counts in ways.items():
        print(f"{name:32}", *(f"{way} {count:g}" for way, count in counts.items()), sep="  ")
    ratios = time_guess()
    print(f"a guess: {ratios[0]:.1f} to {ratios[-1]:.1f} factorisations, median", end=" ")
    print(f"{np.median(ratios):.1f}")
    path = HERE / "lexls.png"
    with house_style():
        figure = Figure(figsize=(11.2, 7.4))
        left = figure.add_axes((0.005, 0.005, 0.52, 0.955))
        draw_factor(left)
        draw_search(figure.add_axes((0.535, 0.45, 0.46, 0.51)), ends)
        draw_ways(figure.add_axes((0.735, 0.085, 0.255, 0.315)), ways)
        figure.savefig(path, facecolor="white", dpi=150)
    Image.open(path).convert("RGB").quantize(128).save(path, optimize=True)
    print(path.name, Image.open(path).size, path.stat().st_size, "bytes")


if __name__ == "__main__":
    main()
