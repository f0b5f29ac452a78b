"""`poise warmup`: compiles ahead what controllers need, so that no first use has to."""

import argparse
import json
import os
import sys
from dataclasses import asdict
from time import perf_counter
from typing import Any

from poise._compiled import clear_bar, draw_bar
from poise.control import CONTROLLERS, usable_cores, warm_up


def add_parser(verbs: Any) -> None:
    """Adds the verb to the command line."""
    parser = verbs.add_parser(
        "warmup",
        help="compile ahead what controllers need",
        description="Compiles what controllers and step teleoperation need, for images, robots "
        "and CI: otherwise the first ones on a machine do it, which takes some thirty seconds. It "
        "is kept for this kind of processor, beside the sources where they can be written, else in "
        "the user's cache folder, or in the folder that NUMBA_CACHE_DIR names. Exit status: 0 all "
        "is compiled and kept, 2 it cannot be kept.",
        epilog="example: poise warmup --controller whole_body",
    )
    parser.add_argument(
        "--controller",
        metavar="C",
        action="append",
        help=f"only for this one, of {', '.join(CONTROLLERS)}; may be given several times",
    )
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    parser.set_defaults(act=act)


def act(options: argparse.Namespace) -> int:
    """Compiles, with a bar where somebody looks on."""
    # Here: `poise --help` has no need of leaders.
    from poise.locomotion import StepTeleoperator
    from poise.robots import load_robot

    controllers = tuple(dict.fromkeys(options.controller or CONTROLLERS))
    if not options.json:
        cores = usable_cores()
        print(f"compiling for {', '.join(controllers)}; cores: {cores}", flush=True)
    begin = perf_counter()
    try:
        # A bar of its own: that of the other verbs is none without the extra that they need.
        done = warm_up(
            controllers,
            others=[lambda: StepTeleoperator(load_robot("humanoid33"))],
            note=lambda done, total: draw_bar(
                f"{total} functions", done / total, perf_counter() - begin
            ),
        )
    finally:
        clear_bar()
    processor = sum(os.times()[:4])
    if options.json:
        print(json.dumps({**asdict(done), "processor_s": processor}))
    elif done.functions:
        print(
            f"compiled {done.functions} functions in {done.seconds:.1f} s "
            f"({processor:.1f} s of processor time), kept in {done.folder}"
        )
    else:
        print(f"nothing to compile: all is kept in {done.folder}")
    sys.stdout.flush()
    return 0
