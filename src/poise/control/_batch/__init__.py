"""Many states at once: `Batch`, with a `Lane` for each thread, each in one compiled loop."""

from poise.control._batch.batch import Batch

__all__ = ["Batch"]
