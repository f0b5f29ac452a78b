"""Everything that `python -m benchmarks hqp` can make problems of, by name.

`USUAL_SEQUENCES`: what is raced on where nothing else is asked for.
"""

from collections.abc import Mapping
from pathlib import Path

from benchmarks.hqp import inverse_kinematics, random_families, recorded
from benchmarks.hqp.problem_set import ProblemSequence, Progress, Source, save_sequence
from poise.errors import UnknownNameError

SOURCES: Mapping[str, Source] = {
    source.name: source
    for source in (
        *recorded.SOURCES,
        *random_families.SOURCES,
        *inverse_kinematics.SOURCES,
    )
}
"""What each sequence is and how it is made."""


def sequence_names() -> tuple[str, ...]:
    """Names of all sequences that can be made, family by family."""
    return tuple(SOURCES)


def make_sequence(name: str, count: int, progress: Progress | None = None) -> ProblemSequence:
    """Makes a sequence; the same one every time on one machine.

    Recorded ones are simulated for it, which takes seconds.
    """
    if name not in SOURCES:
        raise UnknownNameError("unknown problem sequence", got=name, choices=SOURCES)
    return SOURCES[name].sequence(count, progress)


def save_all(folder: Path, count: int, progress: Progress | None = None) -> tuple[Path, ...]:
    """Makes and saves every sequence."""
    paths: list[Path] = []
    for source in SOURCES.values():
        paths.append(save_sequence(source.sequence(count), folder))
        if progress is not None:
            progress(len(paths), len(SOURCES))
    return tuple(paths)


USUAL_SEQUENCES = (
    "stand-humanoid33",
    "squat-humanoid33",
    "reach-beyond-humanoid33",
    "push-humanoid33",
    "one-leg-humanoid33",
    "walk-lift-off-humanoid33",
    "walk-touch-down-humanoid33",
    "moving-20-double",
    "moving-45-double",
    "moving-60-double",
    "table1-33-double",
    "reduced-33-double",
    "velocity-reach-humanoid33",
    "random-rank",
    "random-condition",
    "random-conflict",
    "random-contradiction",
    "random-active",
    "random-drift-slow",
    "random-drift-fast",
    "ik-planar-7",
    "ik-arm6-wrist",
    "ik-arm6-elbow",
    "ik-humanoid-reach",
    "ik-humanoid-conflict",
)
"""Some of every family, from every scenario that is quickly simulated, on robots that need no
further package."""
