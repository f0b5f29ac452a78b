"""Hierarchical QPs as a benchmark: problems that anyone can use, and a race of methods on them."""

from benchmarks.hqp.problem_set import ProblemSequence, load_folder, load_sequence, save_sequence
from benchmarks.hqp.problem_sources import make_sequence, save_all, sequence_names

__all__ = [
    "ProblemSequence",
    "load_folder",
    "load_sequence",
    "make_sequence",
    "save_all",
    "save_sequence",
    "sequence_names",
]
