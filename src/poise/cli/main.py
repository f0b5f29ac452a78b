"""The `poise` command: few verbs, each with `--help` and an example in it."""

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec

from poise.cli._command import OK, carry_out, parse
from poise.errors import ConfigurationError

_VERBS = {
    "run": ("_run", "one scenario to a report"),
    "scorecard": ("_campaign", "what a robot with its controller survives"),
    "campaign": ("_campaign", "many episodes of a scenario to a table"),
    "robots": ("_robots", "what can be loaded here"),
    "describe": ("_robots", "propose a description for a URDF or MJCF"),
    "teleop": ("_live", "a person walks the robot step by step, in a browser"),
    "drive": ("_live", "a person drives the robot by velocities, in a browser"),
    "simulate": ("_deploy", "a simulated robot behind the real one's bus"),
    "deploy": ("_deploy", "a scenario on a robot behind a link"),
    "balance": ("_balance", "balance for another program that moves the arms"),
    "warmup": ("_warmup", "compile ahead what controllers need"),
    "doctor": ("_doctor", "check this installation and name what mends it"),
}
"""Modules with the verbs' classes, imported when they are used, and a summary."""

_WITHOUT_SIMULATOR = ("robots", "warmup", "doctor")


def main(arguments: Sequence[str] | None = None) -> int:
    """Carry out one verb.

    Args:
        arguments: the command line without the program's name; the process's own when None.

    Returns:
        The exit status: 0 done, 1 a check failed, 2 bad input.
    """
    words = sys.argv[1:] if arguments is None else arguments
    return carry_out("poise", lambda: _act(*words))


def _act(verb: str = "", *words: str) -> int:
    if verb == "--version":
        from poise import __version__

        print(f"poise {__version__}")
        return OK
    if verb in ("-h", "--help"):
        print("usage: poise [-h] [--version] VERB ...\n\nWhole-body control for humanoid robots.\n")
        print("\n".join(f"  {name:11}{about}" for name, (_, about) in _VERBS.items()))
        print("\n`poise VERB --help` lists options.\nexample: poise run squat --out runs/squat")
        return OK
    if verb not in _VERBS:
        raise ConfigurationError("no such verb", got=verb, choices=_VERBS)
    kind = getattr(import_module(f"poise.cli.{_VERBS[verb][0]}"), f"{verb.capitalize()}Verb")
    options = parse(kind, f"poise {verb}", words)
    if options is None:
        return OK
    if verb not in _WITHOUT_SIMULATOR and find_spec("mujoco") is not None:
        # MuJoCo's own warnings are kept off the screen.
        import_module("poise.sim").silence()
    return options.act()
