"""Benchmarks: timings of Poise beside other methods and other packages, interleaved in one run."""
