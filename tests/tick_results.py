"""Made-up results of timed ticks."""

from dataclasses import replace

from benchmarks.result import PHASES, TickResult

_RESULT = TickResult(
    robot="humanoid33",
    joints=33,
    controller="whole_body",
    solver="direct",
    stack="table1",
    contacts="double",
    schedule="tick",
    variables=51,
    rows=124,
    p50_us=100.0,
    p99_us=120.0,
    max_us=150.0,
    cpu_min_us=97.0,
    cpu_p10_us=98.0,
    cpu_p50_us=99.0,
    cpu_p99_us=119.0,
    phases_us=dict.fromkeys(PHASES, 25.0),
    ticks=10,
    residual_max=1e-15,
    ratio_to_direct=1.0,
    ratio_to_whole=1.0,
    relaxed_ticks=0,
    missed_ticks=0,
)


def tick_result(**changes):
    return replace(_RESULT, **changes)
