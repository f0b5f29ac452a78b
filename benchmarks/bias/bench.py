"""`time_formulas`: times the formulas of the bias acceleration, interleaved in one run."""

from time import perf_counter

import numpy as np
from jaxtyping import Float64

from benchmarks.bias.formulas import FORMULAS
from benchmarks.bias.recording import BiasInputs, record_motion
from benchmarks.clocked import batches, in_turn
from benchmarks.recording import Progress
from poise.robots import load_robot

WARM_UP = 30
"""Ticks before those that count."""

ROBOT = "upper17"
"""Robot of the second study of (Park, Jin, Kang 2022)."""


def time_formulas(
    ticks: int, progress: Progress | None = None
) -> dict[str, Float64[np.ndarray, " ticks"]]:
    """Record a moving run, then time every formula on its states, tick by tick in turn.

    The order rotates from tick to tick. Quantities that all formulas share are computed before the
    clock starts, see `formulas`; the garbage collector never runs inside a timed tick.
    """
    robot = load_robot(ROBOT)
    states, inputs, names = record_motion(robot), BiasInputs(robot), list(FORMULAS)
    total = WARM_UP + ticks
    seconds = np.zeros((len(names), total))
    for batch in batches(total, 50):
        for i in batch:
            tick = inputs.of(states[i % len(states)])
            for j in in_turn(range(len(names)), i):
                begin = perf_counter()
                FORMULAS[names[j]](tick)
                seconds[j, i] = perf_counter() - begin
        if progress is not None:
            progress(float(batch.stop), float(total))
    return dict(zip(names, seconds[:, WARM_UP:], strict=True))
