"""The whole-body problem in two parts, Ahn et al. 2024, section 4.2: LQP 1, then LQP 2."""

from poise.control._reduced._controller import ReducedController

__all__ = ["ReducedController"]
