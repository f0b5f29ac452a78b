"""Fewer points for a plot without losing a peak: the least and the greatest of every bucket."""

import numpy as np
from jaxtyping import Float64


def decimate(
    time: Float64[np.ndarray, " T"], values: Float64[np.ndarray, " T"], buckets: int = 500
) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " n"]]:
    """Keep the least and the greatest value of every bucket, at their own times.

    A bucket with nothing but NaN stays a gap. Short signals come back as they are.

    Args:
        time: times [s].
        values: one value a time; NaN where there is none.
        buckets: how many buckets of equal count at most; two points come from each.

    Returns:
        Times [s] and values that are left.
    """
    if len(time) <= 2 * buckets:
        return time, values
    padded = _padded(values, buckets)
    low = np.argmin(np.where(np.isnan(padded), np.inf, padded), axis=1)
    high = np.argmax(np.where(np.isnan(padded), -np.inf, padded), axis=1)
    starts = np.arange(len(padded)) * padded.shape[1]
    picked = np.stack([np.minimum(low, high) + starts, np.maximum(low, high) + starts], axis=1)
    index = np.unique(np.minimum(picked, len(time) - 1))
    return time[index], values[index]


def bucket_max(
    values: Float64[np.ndarray, "T n"], buckets: int = 600
) -> tuple[Float64[np.ndarray, "m n"], int]:
    """Greatest value of every bucket of rows, NaN where a bucket holds nothing else.

    Args:
        values: one row a time.
        buckets: how many buckets of equal count at most.

    Returns:
        One row a bucket, or `values` where it is short enough; and how many rows of `values` the
        buckets stand for, which is more than there are where the last bucket is not full.
    """
    if len(values) <= buckets:
        return values, len(values)
    padded = np.stack([_padded(column, buckets) for column in values.T], axis=2)
    greatest = np.max(np.where(np.isnan(padded), -np.inf, padded), axis=1)
    return np.where(np.isneginf(greatest), np.nan, greatest), padded.shape[0] * padded.shape[1]


def _padded(values: Float64[np.ndarray, " T"], buckets: int) -> Float64[np.ndarray, "b w"]:
    """The signal as rows of equal length, the last ones filled up with NaN."""
    width = -(-len(values) // buckets)
    full = np.full(-(-len(values) // width) * width, np.nan)
    full[: len(values)] = values
    return full.reshape(-1, width)
