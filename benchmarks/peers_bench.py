"""`peers_bench`: other packages beside the full and the reduced controller, in one run."""

from collections.abc import Mapping
from pathlib import Path

from benchmarks.methods import DIRECT
from benchmarks.tick import TickBench

_INSTALL = {
    "tsid": '"tsid==1.7.1" "pin==3.4.0" "cmeel-urdfdom<5" "cmeel-tinyxml2<11"',
    "placo": '"placo==0.9.3" "pin==3.7.0" "cmeel-boost<1.88" "cmeel-urdfdom<5" "cmeel-tinyxml2<11"',
}
"""What each needs in an environment of its own; the pins are those that were tried."""


def peers_bench(
    peers: Mapping[str, Path],
    *,
    robot: str = "humanoid33",
    contacts: str = "double",
    stacks: tuple[str, ...] = ("table1",),
    ticks: int = 500,
) -> TickBench:
    """What the benchmark `peers` times: full and reduced controller by their default, and peers.

    Args:
        peers: Python interpreters of the peers' environments by name; none for Poise alone.
        robot: name or path of a biped, from a URDF.
        contacts: one of `STANCES`.
        stacks: of `STACKS`.
        ticks: timed ticks of each.

    Raises:
        PoiseError: an unknown name, or an interpreter that does not exist.
    """
    return TickBench(
        robot=robot,
        contacts=contacts,
        controller="reduced",
        stacks=stacks,
        methods=(DIRECT,),
        peers=peers,
        ticks=ticks,
    )


def how_to_install(name: str) -> str:
    """How to time a peer that was not timed.

    Args:
        name: one of `PEERS`.
    """
    return (
        f"{name} was not timed. It needs an environment of its own:\n"
        f"  python3.11 -m venv peers/{name}\n"
        f"  peers/{name}/bin/pip install {_INSTALL[name]}\n"
        f"  python -m benchmarks peers --peers {name}=peers/{name}/bin/python"
    )
