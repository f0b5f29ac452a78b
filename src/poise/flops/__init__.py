"""Counting the floating point operations that array code really does."""

from poise.flops.counter import FlopCounter

__all__ = ["FlopCounter"]
