"""Draws the picture of the lexicographic solver: one factorisation, and how the search goes.

    python docs/images/draw_active_set.py

It solves the problems in `problems/` and prints what the picture says in numbers.
"""

from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Rectangle
from PIL import Image

from benchmarks.hqp.problem_set import load_sequence
from poise._compiled import compiled, view
from poise.apps.pages import INK, LINE, MUTED, PALETTE, house_style
from poise.hqp import HierarchicalProblem, LexicographicSolver
from poise.hqp._active_set.guess import guess
from poise.hqp._active_set.moves import change_rows, find_values
from poise.hqp._active_set.optimum import find_optimum
from poise.hqp._active_set.search import CONVERGED, UNFINISHED
from poise.hqp._active_set.workspace import (
    EQUALITY,
    EXCHANGING,
    GUESS,
    LAST,
    LEAPING,
    NOTHING,
    STEPPING,
    Problem,
    SearchWork,
)
from poise.hqp._tolerances import (
    ASTRAY,
    COLD_CHANGES,
    MANY,
    MOST_EXCHANGES,
    WARM_CHANGES,
)

HERE = Path(__file__).parent
PROBLEMS = HERE.parents[1] / "problems"
EXAMPLE, NUMBER = "push-humanoid33", 2
WORDS = {"contacts": "contacts, cones, ...", "com, pelvis, momentum": "com, pelvis, ..."}
SLACK = "#C81E1E"
UPRIGHT: dict[str, Any] = {"rotation": 90, "ha": "right", "va": "top"}
INVISIBLE = 1e-9
"""Of a row's length, below which a coefficient is drawn as zero."""

FAINT = 1e-4
"""Of a row's length, what is drawn faintest."""

SHOWN = 10
"""Sequences are shown whose cold problems take more single steps than this, in the median."""

STEPS, LEAPS_ALONE, ALL = "single steps alone", "without a guess", "as it is"
WAYS = {STEPS: NOTHING, LEAPS_ALONE: GUESS, ALL: LAST}
"""Where the search is told that its active set came from: what may still follow depends on that."""

AT_ONCE, RIGHT, ANEW, NOT_OPTIMAL = "at once", "by a right guess", "anew by steps", "not optimal"
BEFORE = {
    EXCHANGING: "by exchanges before a guess",
    STEPPING: "by steps before a guess",
    LEAPING: "by one leap",
}
"""How a search ends before the guess, by its phase."""

AFTER = {
    EXCHANGING: "by exchanges after it",
    STEPPING: "by steps after it",
    LEAPING: "by leaps after it",
}
"""How it ends after the guess, where something is wrong with that."""

REPEATS = 30
"""How often what is timed runs; the quickest counts."""


# --- the factorisation ------------------------------------------------------------------------


def draw_factor(ax: Axes) -> None:
    """The active rows of the example in y = Q^T x, level by level, with their slack beside them."""
    problem = load_sequence(PROBLEMS / f"{EXAMPLE}.npz").problems[NUMBER]
    solver = LexicographicSolver()
    solver.run(problem)
    levels, n = len(problem.levels), problem.n
    rows, free = int(solver._work.factor.begin[levels]), solver._work.state.free
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
    factor, n = solver._work.factor, problem.n
    Q = np.eye(n)
    for k in range(int(factor.first[len(problem.levels)])):
        v = np.append(np.zeros(k), factor.V[k, k:])
        Q -= factor.tau[k] * np.outer(Q @ v, v)
    a = np.vstack([np.eye(n), problem.A])[factor.order[: factor.begin[len(problem.levels)]]]
    return a @ Q / np.linalg.norm(a, axis=1)[:, None]


def draw_level(
    ax: Axes, problem: HierarchicalProblem, solver: LexicographicSolver, R: np.ndarray, level: int
) -> None:
    """A level's rows: all they see, the coordinates it takes, its pivots, and who has slack."""
    factor, colour = solver._work.factor, PALETTE[level]
    begin, end = int(factor.begin[level]), int(factor.begin[level + 1])
    first, rank, n = int(factor.first[level]), int(factor.rank[level]), problem.n
    size = np.abs(R[begin:end])
    right = float(size[:, first + rank :].max(initial=0.0))
    print(f"level {level + 1}: {end - begin} rows, rank {rank}, right of the trapezoid {right:.0e}")
    shade = np.log10(np.maximum(size, FAINT) / FAINT) / -np.log10(FAINT)
    shade = np.where(size > INVISIBLE, 0.15 + 0.85 * shade, np.nan)
    map_ = LinearSegmentedColormap.from_list("level", ["#FFFFFF", colour])
    ax.imshow(shade, cmap=map_, vmin=0.0, vmax=1.15, extent=(0, n, end, begin), aspect="equal")
    if rank > 0:
        place, side = (first, begin), (rank, end - begin)
        ax.add_patch(Rectangle(place, *side, facecolor="none", edgecolor=colour, lw=1.4))
        k = np.arange(rank)
        ax.scatter(first + k + 0.5, begin + k + 0.5, s=3.2, c=INK, marker="s", lw=0, zorder=3)
    ax.add_patch(Rectangle((n + 2.0, begin + 0.15), 0.7, end - begin - 0.3, color=colour, lw=0))
    for row in range(begin, end):
        if solver.sides[factor.order[row]] != EQUALITY:
            ax.add_patch(Rectangle((-1.1, row + 0.1), 0.8, 0.8, color=MUTED, lw=0))
        if factor.slack[row] != 0.0:
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
    """How the searches of the problem set end, from a cold and from a warm start."""
    solver, ends = LexicographicSolver(), {"cold": Counter(), "warm": Counter()}
    for path in sorted(PROBLEMS.glob("*.npz")):
        sequence = load_sequence(path)
        for start, found in ends.items():
            if start == "warm" and not sequence.consecutive:
                continue
            for k, problem in enumerate(sequence.problems):
                if start == "cold" or k == 0:
                    solver.reset()
                end = follow(solver, problem)
                if start == "cold" or k > 0:
                    found[end] += 1
    return ends


def follow(solver: LexicographicSolver, problem: HierarchicalProblem) -> str:
    """Solves a problem, change by change, and says how its search ended."""
    solver._fit(problem)
    state = solver._work.state
    state.begun = 0
    guessed, found = 0, UNFINISHED
    for changes in range(1, solver._limit + 1):
        found = solver._search(changes)
        if found != UNFINISHED:
            break
        if state.origin == GUESS and guessed == 0:
            guessed = changes
    if found != CONVERGED:
        return NOT_OPTIMAL
    if solver.changes == 1:
        return AT_ONCE
    if state.origin == NOTHING:
        return ANEW
    if state.origin == LAST:
        return BEFORE[state.phase]
    return RIGHT if solver.changes == guessed + 1 else AFTER[state.phase]


def draw_search(ax: Axes, ends: dict[str, Counter[str]]) -> None:
    """The ways, from above to below, and the share of searches that end in each."""
    ax.set(xlim=(0, 100), ylim=(0, 100))
    ax.axis("off")
    ax.set_title("The search, and where it ends", x=0.0)
    draw_ways_on(ax)
    lines = {
        91: (AT_ONCE, [AT_ONCE]),
        72.5: ("by exchanges", [BEFORE[EXCHANGING]]),
        68: ("by steps", [BEFORE[STEPPING]]),
        63.5: ("by the leap", [BEFORE[LEAPING]]),
        45.5: ("by the guess", [RIGHT]),
        26.5: ("by exchanges", [AFTER[EXCHANGING]]),
        22: ("by steps", [AFTER[STEPPING]]),
        17.5: ("by leaps", [AFTER[LEAPING]]),
        2.5: ("anew", [ANEW, NOT_OPTIMAL]),
    }
    for right, (start, found) in zip((72, 81), ends.items(), strict=True):
        ax.text(right, 99, f"{found.total()}\n{start}", ha="right", va="bottom", weight="bold")
        for height, (_, keys) in lines.items():
            share = sum(found[key] for key in keys) / found.total()
            ax.text(right, height, f"{100 * share:.0f}%", ha="right", va="center")
    for height, (word, _) in lines.items():
        ax.text(83, height, word, va="center", color=MUTED)


def draw_ways_on(ax: Axes) -> None:
    """The boxes and what leads from one to the next."""
    few = f"1 or {MANY} wrong" if MANY == 2 else f"up to {MANY} wrong"
    pull, none, later = f"{few},\nsome pull", f"{few},\nnone pulls", f"after\n{MOST_EXCHANGES}"
    after = f"cold after {COLD_CHANGES}, warm after {WARM_CHANGES}\nfactorisations, or in doubt"
    box(ax, (0, 85), (64, 12), "cold: the equalities are active\nwarm: the last active set", 0)
    box(ax, (0, 62), (16, 12), "exchanges,\none by one", 4)
    box(ax, (24, 62), (12, 12), "single\nsteps", 3)
    box(ax, (43, 62), (13, 12), "one leap", 2)
    box(ax, (0, 39), (64, 13), "guess, level by level:\ndual method with penalties", 1)
    box(ax, (0, 16), (16, 12), "exchanges,\none by one", 4)
    box(ax, (24, 16), (12, 12), "single\nsteps", 3)
    box(ax, (43, 16), (21, 12), "leaps, many\nrows at a time", 2)
    box(ax, (0, -1), (64, 7), "anew: the equalities, single steps alone", 3)
    arrow(ax, (4, 85), (4, 74), none)
    arrow(ax, (26, 85), (26, 74), pull)
    arrow(ax, (46, 85), (46, 74), "more,\nnone pulls")
    arrow(ax, (60, 85), (60, 52), "more,\nsome pull", 79.5)
    arrow(ax, (4, 62), (4, 52), after)
    arrow(ax, (35, 62), (35, 52), "")
    arrow(ax, (49, 62), (49, 52), "")
    arrow(ax, (4, 39), (4, 28), none)
    arrow(ax, (26, 39), (26, 28), pull)
    arrow(ax, (53, 39), (53, 28), "more")
    for height in (65, 19):
        arrow(ax, (16, height), (24, height), "")
        above(ax, 20, height, later)
    arrow(ax, (43, 19), (36, 19), "")
    above(ax, 39.5, 19, "stuck")
    arrow(ax, (4, 16), (4, 6), "in doubt")
    arrow(ax, (26, 16), (26, 6), f"after {ASTRAY} factorisations,\nor in doubt")
    arrow(ax, (60, 16), (60, 6), "")


def above(ax: Axes, middle: float, height: float, text: str) -> None:
    """What stands above an arrow to the side."""
    ax.text(middle, height + 1, text, ha="center", va="bottom", color=MUTED, fontsize=8)


def box(
    ax: Axes, corner: tuple[float, float], size: tuple[float, float], text: str, colour: int
) -> None:
    """A phase."""
    (x, y), (width, height) = corner, size
    style = "round,pad=0,rounding_size=2"
    ax.add_patch(
        FancyBboxPatch(
            corner,
            width,
            height,
            boxstyle=style,
            fc="white",
            ec=PALETTE[colour],
            lw=1.4,
            clip_on=False,
        )
    )
    ax.text(x + width / 2, y + height / 2, text, ha="center", va="center", linespacing=1.25)


def arrow(
    ax: Axes,
    begin: tuple[float, float],
    end: tuple[float, float],
    text: str,
    height: float | None = None,
) -> None:
    """From one phase to the next, and why."""
    ax.annotate("", end, begin, arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1})
    middle = (begin[1] + end[1]) / 2 if height is None else height
    ax.text(begin[0] + 1.2, middle, text, va="center", color=MUTED, fontsize=8)


def count_ways() -> dict[str, dict[str, float]]:
    """Median of the factorisations that a cold search takes by each way, sequence by sequence."""
    solver, found = LexicographicSolver(), {}
    for path in sorted(PROBLEMS.glob("*.npz")):
        problems = load_sequence(path).problems
        counts = {
            way: float(np.median([search(solver, problem, WAYS[way]) for problem in problems]))
            for way in WAYS
        }
        if counts[STEPS] > SHOWN:
            found[path.stem] = counts
    return dict(sorted(found.items(), key=lambda item: item[1][STEPS]))


def search(solver: LexicographicSolver, problem: HierarchicalProblem, origin: int) -> int:
    """How many factorisations a cold search takes that is told where its active set came from."""
    solver.reset()
    solver._fit(problem)
    state = solver._work.state
    state.begun = 0
    # Sets the search up and ends at once.
    solver._search(0)
    state.origin = origin
    if solver._search(solver._limit) != CONVERGED:
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
def run_nothing(_problem_at: int, _work_at: int) -> None:
    """What it takes to call a compiled function."""


@compiled
def run_guess(problem_at: int, work_at: int) -> None:
    """The guess, which only compiled functions may call."""
    guess(view(Problem, problem_at), view(SearchWork, work_at))


@compiled
def run_leap(problem_at: int, work_at: int) -> None:
    """The leap before it, which only compiled functions may call."""
    problem, work = view(Problem, problem_at), view(SearchWork, work_at)
    find_optimum(problem, work)
    find_values(problem.A, work.points.target, work.points.target_values)
    change_rows(problem, work)


@compiled
def run_factoring(problem_at: int, work_at: int) -> None:
    """The factorisation, which only compiled functions may call."""
    problem, work = view(Problem, problem_at), view(SearchWork, work_at)
    work.state.changes = 1  # So that every level is factored anew.
    find_optimum(problem, work)


def arrays_of(work: SearchWork) -> list[np.ndarray]:
    """All arrays of a workspace."""
    groups = (work.rows, work.points, work.factor, work.squares, work.cost, work.duals)
    return [a for group in (*groups, work.answer, work.guessed) for a in group.arrays().values()]


def time_guess() -> list[float]:
    """How many factorisations a guess takes the time of, after one leap of a cold search.

    The factorisation is that of the active set which is right. The first problem of each sequence
    counts where more is wrong than what steps would do for.
    """
    before, after, ratios = LexicographicSolver(), LexicographicSolver(), []
    for path in sorted(PROBLEMS.glob("*.npz")):
        problem = load_sequence(path).problems[0]
        for solver in (before, after):
            solver._fit(problem)
            solver.reset()
        after.run(problem)
        if before._search(1) != UNFINISHED or before._work.state.phase != LEAPING:
            continue
        run_leap(before._problem.address, before._work.address)
        arrays, spent = arrays_of(before._work), []
        found = [array.copy() for array in arrays]
        for _ in range(REPEATS):
            for array, numbers in zip(arrays, found, strict=True):
                array[:] = numbers
            runs = ((run_nothing, before), (run_factoring, after), (run_guess, before))
            spent.append(
                [
                    seconds(partial(run, solver._problem.address, solver._work.address))
                    for run, solver in runs
                ]
            )
        nothing, factoring, guessing = np.min(spent, axis=0)
        ratios.append((guessing - nothing) / (factoring - nothing))
    return sorted(ratios)


def seconds(run: Callable[[], None]) -> float:
    """How long a call takes."""
    begin = perf_counter()
    run()
    return perf_counter() - begin


def main() -> None:
    """Solves, prints, draws."""
    ends, ways = count_ends(), count_ways()
    for start, found in ends.items():
        print(start, found.total(), dict(found))
    for name, counts in ways.items():
        print(f"{name:32}", *(f"{way} {count:g}" for way, count in counts.items()), sep="  ")
    ratios = time_guess()
    print(
        f"{len(ratios)} guesses: {ratios[0]:.1f} to {ratios[-1]:.1f} factorisations, median",
        end=" ",
    )
    print(f"{np.median(ratios):.1f}")
    path = HERE / "active_set.png"
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
