"""The bias acceleration of (Park, Jin, Kang 2022): its formulas, to be read, run and timed."""

from benchmarks.bias.bench import BiasBench, BiasResult, bench_bias, format_bias_table

__all__ = ["BiasBench", "BiasResult", "bench_bias", "format_bias_table"]
