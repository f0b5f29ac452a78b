"""The bias acceleration of (Park, Jin, Kang 2022): its formulas, to be read, run and timed."""

from benchmarks.bias.bench import time_formulas

__all__ = ["time_formulas"]
