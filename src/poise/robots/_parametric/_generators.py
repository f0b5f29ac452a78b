"""Robots made in code: their URDF text, by the name a description asks for."""

from collections.abc import Callable

from poise.errors import UnknownNameError
from poise.robots._parametric._humanoid import TELEOPERATED_BIPED, TOCABI_CLASS, humanoid
from poise.robots._parametric._manipulators import arm6, upper17
from poise.robots._parametric._tree import Tree

_GENERATORS: dict[str, Callable[[int], Tree]] = {
    "humanoid": lambda joints: humanoid(f"humanoid{joints}", joints, TOCABI_CLASS),
    "biped": lambda joints: humanoid(f"biped{joints}", joints, TELEOPERATED_BIPED),
    "arm6": lambda _: arm6(),
    "upper17": lambda _: upper17(),
}


def generate(name: str, joints: int) -> str:
    """URDF text of a robot made in code.

    Args:
        name: which generator.
        joints: number of joints; the manipulators have a number of their own.

    Returns:
        The document.

    Raises:
        UnknownNameError: no generator of that name.
        ConfigurationError: the generator does not make that number of joints.
    """
    if name not in _GENERATORS:
        raise UnknownNameError("unknown robot generator", got=name, choices=_GENERATORS)
    return _GENERATORS[name](joints).urdf()
