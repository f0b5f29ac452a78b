"""`Selection`: some of the coordinates of the velocity vector, in an order of their own."""

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from jaxtyping import Float64, Int64


class Selection:
    """Some of the coordinates of `v`, copied out of vectors and matrices.

    Neighbours are copied together as slices. A humanoid's legs, or its whole upper body, are one
    run of neighbours, and copying runs is quicker than picking single coordinates.

    Args:
        index: the coordinates, in the selection's order.

    Attributes:
        index: the coordinates, in the selection's order.
        runs: runs of neighbours: where each lies in `v`, and where in the selection.
    """

    def __init__(self, index: Iterable[int]) -> None:
        self.index: Int64[np.ndarray, " k"] = np.array([*index], dtype=np.int64)
        self.index.flags.writeable = False
        breaks = np.flatnonzero(np.diff(self.index) != 1) + 1
        edges = (0, *breaks.tolist(), len(self.index)) if len(self.index) else ()
        self.runs = tuple(
            (slice(first := int(self.index[a]), first + b - a), slice(a, b))
            for a, b in pairwise(edges)
        )

    def __len__(self) -> int:
        """Number of coordinates."""
        return len(self.index)

    def entries(self, source: Float64[np.ndarray, " nv"], out: Float64[np.ndarray, " k"]) -> None:
        """Copies the entries of a vector.

        Args:
            source: in the order of `v`.
            out: receives the entries, in the selection's order.
        """
        for run, place in self.runs:
            out[place] = source[run]

    def columns(self, source: Float64[np.ndarray, "m nv"], out: Float64[np.ndarray, "m k"]) -> None:
        """Copies the columns of a matrix, such as a Jacobian.

        Args:
            source: its columns in the order of `v`.
            out: receives the columns, in the selection's order.
        """
        for run, place in self.runs:
            out[:, place] = source[:, run]

    def block(
        self,
        columns: "Selection",
        source: Float64[np.ndarray, "nv nv"],
        out: Float64[np.ndarray, "k c"],
    ) -> None:
        """Copies the block of a square matrix with this selection's rows.

        Args:
            columns: the columns of the block.
            source: rows and columns in the order of `v`.
            out: receives the block, rows and columns in the order of their selections.
        """
        for rows, row_place in self.runs:
            for run, place in columns.runs:
                out[row_place, place] = source[rows, run]

    def scatter(self, entries: Float64[np.ndarray, " k"], out: Float64[np.ndarray, " nv"]) -> None:
        """Writes entries where they belong in a vector, the reverse of `entries`.

        Args:
            entries: in the selection's order.
            out: in the order of `v`; other entries are left as they are.
        """
        for run, place in self.runs:
            out[run] = entries[place]
