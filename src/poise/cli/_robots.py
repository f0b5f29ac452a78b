"""`poise robots`: what can be loaded here."""

import argparse
import json
from typing import Any

from poise.robots import catalog


def add_parser(verbs: Any) -> None:
    """Adds the verb to the command line."""
    parser = verbs.add_parser(
        "robots",
        help="what can be loaded here",
        description="Lists the robots that load by name, with joints, mass, licence and whether "
        "they are installed. Any other URDF or MJCF loads by its path.",
        epilog="example: poise robots --json",
    )
    parser.add_argument("--json", action="store_true", help="print the list as JSON")
    parser.set_defaults(act=act)


def act(options: argparse.Namespace) -> int:
    """Prints the list."""
    entries = catalog()
    if options.json:
        rows = [
            {
                "name": e.name,
                "joints": e.joints,
                "mass_kg": e.mass,
                "licence": e.licence,
                "installed": e.installed,
                "source": e.source,
                "summary": e.summary,
            }
            for e in entries
        ]
        print(json.dumps(rows))
        return 0
    width = max(len(e.licence) for e in entries)
    print(
        f"{'name':17}{'joints':>6}  {'mass':>9}  {'licence':{width}}  {'installed':9}  what it is"
    )
    for e in entries:
        installed = "yes" if e.installed else "no"
        print(
            f"{e.name:17}{e.joints:>6}  {e.mass:>6.1f} kg  {e.licence:{width}}  {installed:9}  "
            f"{e.summary}"
        )
    if not all(e.installed for e in entries):
        print('\ninstall the others with: pip install "poise[robots]"')
    return 0
