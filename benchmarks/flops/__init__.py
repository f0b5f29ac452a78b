"""Counting the floating point operations that array code really does."""

from benchmarks.flops.counter import FlopCounter

__all__ = ["FlopCounter"]
