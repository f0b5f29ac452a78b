"""`python -m benchmarks`: timings, interleaved in one run."""

import sys
from collections.abc import Sequence
from importlib import import_module

from poise.cli import run_command
from poise.errors import UnknownNameError

BENCHMARKS = {
    "tick": ("tick TickBench", "a controller's tick from state to command, by phase"),
    "peers": ("tick PeersBench", "TSID, placo and libdwbc beside the full and reduced controller"),
    "batch": ("batch BatchBench", "many states in one call beside single ticks"),
    "ik": ("tick VelocityBench", "mink and pink beside differential inverse kinematics"),
    "first": ("first FirstBench", "import and first controller, compiled and not"),
    "latency": ("latency LatencyBench", "an operator's message until the robot has its command"),
    "keys": ("keys KeysBench", "a key in a browser until the commanded velocity changes"),
    "run": ("running RunBench", "whole scenarios, recorded and logged, by parts of a tick"),
    "hqp": ("hqp.bench HqpBench", "solvers of hierarchical problems, with their answers judged"),
}
"""Modules with the classes of options, and what each times."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one benchmark."""
    name, *words = (sys.argv[1:] if arguments is None else arguments) or ["--help"]
    if name in ("-h", "--help"):
        print("usage: python -m benchmarks NAME ...\n\nTimes of what is compared, in turn.\n")
        print("\n".join(f"  {known:8}{about}" for known, (_, about) in BENCHMARKS.items()))
        print("\nexample: python -m benchmarks tick --controller reduced; each has a --help")
        return 0
    if name not in BENCHMARKS:
        error = UnknownNameError("no such benchmark", got=name, choices=tuple(BENCHMARKS))
        print(f"benchmarks: {error}", file=sys.stderr)
        return 2
    module, kind = BENCHMARKS[name][0].split()
    bench = getattr(import_module(f"benchmarks.{module}"), kind)
    return run_command(f"python -m benchmarks {name}", bench, words)


if __name__ == "__main__":
    sys.exit(main())
