"""`poise run`: one scenario to a report."""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from poise._progress import Bar
from poise.cli._options import (
    add_output_options,
    controllers_text,
    output_folder,
    strategies_text,
    whole_number,
)

DEFAULT_SCENARIO = "over_an_obstacle"
"""What runs with no argument: a robot is walked over two blocks by hand."""


def add_parser(verbs: Any) -> None:
    """Adds the verb to the command line."""
    parser = verbs.add_parser(
        "run",
        help="one scenario to a report",
        description="Runs a scenario in simulation and writes report.html, video.mp4, log.mcap and "
        "summary.json. Exit status: 0 all checks hold, 1 a check failed or the robot fell, 2 bad "
        "input.",
        epilog="example: poise run push --robot g1 --out runs/push",
    )
    parser.add_argument(
        "scenario",
        nargs="?",
        default=DEFAULT_SCENARIO,
        help="a shipped scenario or a YAML file; --list shows those shipped (default: %(default)s)",
    )
    parser.add_argument("--list", action="store_true", help="list the shipped scenarios and stop")
    parser.add_argument(
        "--robot",
        metavar="R",
        help="another robot than the file's: a name that `poise robots` lists, or a file",
    )
    parser.add_argument(
        "--controller",
        metavar="C",
        help=f"another controller than the file's: {controllers_text()}",
    )
    parser.add_argument(
        "--strategy",
        metavar="S",
        help=f"how the controller solves, in place of the file's: {strategies_text()}",
    )
    parser.add_argument(
        "--seed",
        metavar="N",
        type=whole_number,
        help="another seed than the file's of everything random: noise of sensors, bad operators, "
        "poor links",
    )
    parser.add_argument("--view", action="store_true", help="show the robot in a window")
    parser.add_argument("--no-video", action="store_true", help="leave the video out")
    add_output_options(parser, "runs/SCENARIO-ROBOT")
    parser.set_defaults(act=act, simulates=True)


def act(options: argparse.Namespace) -> int:
    """Runs the scenario and writes everything."""
    from poise.apps.scenarios import load_scenario

    if options.list:
        return _list(as_json=options.json)
    scenario = _overridden(load_scenario(options.scenario), options)
    default = f"runs/{scenario.name}-{Path(scenario.robot).stem}"
    with output_folder(options.out, default) as folder:
        run, summary = run_and_report(
            scenario, folder, video=not options.no_video, view=options.view, quiet=options.json
        )
    if options.json:
        print(json.dumps(summary))
    return 0 if run.ok else 1


def run_and_report(
    scenario: Any, folder: Path, *, video: bool, quiet: bool, view: bool = False
) -> tuple[Any, dict[str, object]]:
    """Runs a scenario and writes everything that a run leaves behind."""
    from poise.apps.scenarios import (
        LOG,
        discard_video,
        run_scenario,
        summarise,
        write_page,
        write_summary,
        write_video,
    )

    with Bar("simulating", "s", lines=not quiet) as bar:
        run = run_scenario(scenario, log=folder / LOG, view=view, progress=bar)
    # Until there is something in its place, the report of an earlier run keeps its video.
    discard_video(folder)
    summary = summarise(run)
    write_summary(summary, folder)
    no_video = None
    if video:
        try:
            with Bar("drawing the video", " frames", lines=not quiet) as bar:
                no_video = write_video(run, folder, bar)
        except KeyboardInterrupt:
            no_video = "No video: interrupted by the user"
    page = write_page(run, summary, folder, no_video)
    if not quiet:
        _print(run, summary, no_video, page)
    return run, summary


def _overridden(scenario: Any, options: argparse.Namespace) -> Any:
    """The scenario with what the command line says instead of the file."""
    controller = scenario.controller
    if options.controller is not None:
        controller = replace(controller, name=options.controller)
    if options.strategy is not None:
        controller = replace(controller, strategy=options.strategy)
    return replace(
        scenario,
        robot=scenario.robot if options.robot is None else options.robot,
        seed=scenario.seed if options.seed is None else options.seed,
        controller=controller,
    )


def _list(*, as_json: bool) -> int:
    from poise.apps.scenarios import load_scenario, shipped_scenarios

    about = {name: load_scenario(name).description for name in shipped_scenarios()}
    if as_json:
        print(json.dumps(about))
        return 0
    width = max(map(len, about)) + 2
    for name, description in about.items():
        print(f"{name:{width}}{description}")
    return 0


def _print(run: Any, summary: dict[str, Any], no_video: str | None, page: Path) -> None:
    verdict = "all checks hold" if run.ok else "FAILED"
    print(f"{run.scenario.name} on {run.robot.name}: {verdict}")
    for check in run.checks:
        mark = "ok  " if check.ok else "FAIL"
        bound = f"{check.relation} {check.bound:g} {check.unit}".rstrip()
        worst = "" if check.ok or check.time is None else f" at {check.time:.2f} s"
        print(f"  {mark}  {check.name}: {check.value:.3g} ({bound}){worst}")
        if check.mechanism:
            print(f"        {check.mechanism}")
    tick = summary["tick_us"]
    if tick["p50"] is not None:
        print(
            f"tick {tick['p50']:.0f} us median, {tick['p99']:.0f} us p99; "
            f"{summary['real_time_factor']:.1f} times real time"
        )
    if run.ended_early:
        print(f"ended early: {run.ended_early}", file=sys.stderr)
    if no_video:
        print(no_video, file=sys.stderr)
    print(f"report: {page}")
