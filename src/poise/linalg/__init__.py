"""Small dense linear algebra, compiled when first called, for what is done every tick.

Python's own time for a call into NumPy or LAPACK is that of some thousand operations, as many as
most of these functions do. They work in place and allocate nothing.
"""

from poise.linalg.compiling import compiled, part, say_if_slow

__all__ = ["compiled", "part", "say_if_slow"]
