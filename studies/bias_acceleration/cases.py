"""The robots and tasks for which the paper counts operations, and the numbers that it quotes."""

from dataclasses import dataclass

Size = tuple[int, int, int]
"""Degrees of freedom n, number of tasks k, rows of a task m."""


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """One panel of Figures 1 and 3: one of n, k and m grows while the others stay.

    Attributes:
        letter: which of them grows.
        axis: label of the axis.
        fixed: what stays, in words.
        sizes: the points.
    """

    letter: str
    axis: str
    fixed: str
    sizes: tuple[Size, ...]

    @property
    def values(self) -> list[int]:
        """What grows, at each point."""
        return [size["nkm".index(self.letter)] for size in self.sizes]


SWEEPS = (
    Sweep(
        letter="n",
        axis="degrees of freedom of the robot, n [-]",
        fixed="k = 2 tasks of m = 3 rows",
        sizes=tuple((n, 2, 3) for n in range(6, 51, 2)),
    ),
    Sweep(
        letter="k",
        axis="tasks, k [-]",
        fixed="n = 30, tasks of m = 3 rows",
        sizes=tuple((30, k, 3) for k in range(2, 11)),
    ),
    Sweep(
        letter="m",
        axis="rows of a task, m [-]",
        fixed="n = 30, k = 2 tasks",
        sizes=tuple((30, 2, m) for m in range(2, 16)),
    ),
)
"""The paper's sweeps (a), (b), (c); it does not say at which steps it drew them."""


@dataclass(frozen=True, kw_only=True)
class Quoted:
    """What the paper's section III.F quotes for one size.

    Attributes:
        size: n, k, m.
        bias_original: operations of the original formula [FLOP].
        osf_original: operations of the formulation with it [FLOP].
        share: of the former in the latter [%].
        bias_proposed: operations of the proposed formula [FLOP].
        ratio: of the proposed formula to the original [%].
        saved: by how much the formulation becomes smaller [%].
    """

    size: Size
    bias_original: int
    osf_original: int
    share: float
    bias_proposed: int
    ratio: float
    saved: float


QUOTED = (
    Quoted(
        size=(50, 2, 3),
        bias_original=46_398,
        osf_original=154_937,
        share=29.9,
        bias_proposed=1_206,
        ratio=2.6,
        saved=29.2,
    ),
    Quoted(
        size=(30, 10, 3),
        bias_original=153_522,
        osf_original=327_642,
        share=46.9,
        bias_proposed=6_534,
        ratio=4.3,
        saved=44.9,
    ),
    Quoted(
        size=(30, 2, 15),
        bias_original=92_760,
        osf_original=259_860,
        share=35.7,
        bias_proposed=3_630,
        ratio=3.9,
        saved=34.3,
    ),
)
"""One size at the end of each sweep."""

FIGURE_2: Size = (30, 4, 3)
"""The size that Figure 2 takes apart."""
