"""Hierarchical QPs as a benchmark: problems that anyone can use, and a race of methods on them."""

from benchmarks.hqp.bench import HqpBench, HqpRace, HqpResult, bench_hqp, format_hqp_table
from benchmarks.hqp.figure import Profile, make_profiles, profiles_of, write_profile_figure
from benchmarks.hqp.judge import LEVEL_TOLERANCE, best_known, judge_point, measure_point
from benchmarks.hqp.methods import METHODS, usual_methods, what_is_missing
from benchmarks.hqp.problem_set import (
    FAMILIES,
    ProblemSequence,
    load_folder,
    load_sequence,
    save_sequence,
)
from benchmarks.hqp.problem_sources import USUAL_SEQUENCES, make_sequence, save_all, sequence_names

__all__ = [
    "FAMILIES",
    "LEVEL_TOLERANCE",
    "METHODS",
    "USUAL_SEQUENCES",
    "HqpBench",
    "HqpRace",
    "HqpResult",
    "ProblemSequence",
    "Profile",
    "bench_hqp",
    "best_known",
    "format_hqp_table",
    "judge_point",
    "load_folder",
    "load_sequence",
    "make_profiles",
    "make_sequence",
    "measure_point",
    "profiles_of",
    "save_all",
    "save_sequence",
    "sequence_names",
    "usual_methods",
    "what_is_missing",
    "write_profile_figure",
]
