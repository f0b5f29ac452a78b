"""`poise scorecard`: what a robot with its controller survives, and two cards side by side."""

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from poise._progress import Bar
from poise.cli._options import (
    add_output_options,
    add_worker_options,
    controllers_text,
    make_workers,
    output_folder,
    strategies_text,
)
from poise.cli._run import run_and_report
from poise.errors import ConfigurationError


def add_parser(verbs: Any) -> None:
    """Adds the verb to the command line."""
    parser = verbs.add_parser(
        "scorecard",
        help="what a robot with its controller survives",
        description="Puts a robot with its controller to trials that get harder (pushes, slopes, "
        "bumps, friction, payloads, errors of the model, slow motors, noise, delay, bad "
        "operators, speed) and writes scorecard.html and scorecard.json. The same command goes on "
        "with a card that was interrupted. Exit status: 0 the card is made, 1 interrupted, 2 bad "
        "input.",
        epilog="examples: poise scorecard --robot g1 --controller whole_body --quick; "
        "poise scorecard --compare runs/one runs/other",
    )
    parser.add_argument(
        "--robot",
        metavar="R",
        default="humanoid33",
        help="a robot on two feet: a name that `poise robots` lists, or a file "
        "(default: %(default)s)",
    )
    parser.add_argument(
        "--controller",
        metavar="C",
        default="whole_body",
        help=f"its controller: {controllers_text()} (default: %(default)s)",
    )
    parser.add_argument(
        "--strategy",
        metavar="S",
        help=f"how the controller solves: {strategies_text()} (default: the first of its own)",
    )
    parser.add_argument(
        "--quick", action="store_true", help="few seeds, directions and looks: minutes, not hours"
    )
    parser.add_argument(
        "--trials",
        metavar="NAME,...",
        default="",
        help="these alone (--list says which there are); another run in the same folder may add "
        "others",
    )
    parser.add_argument("--list", action="store_true", help="list the trials and stop")
    parser.add_argument(
        "--against", metavar="CARD", help="a card that the page shows beside the new one"
    )
    parser.add_argument(
        "--compare",
        nargs=2,
        metavar=("A", "B"),
        help="two cards, by their files or folders, in place of making one",
    )
    parser.add_argument(
        "--replay",
        nargs=2,
        metavar=("FOLDER", "NUMBER"),
        help="run an episode of a card again, by the number on its page, with report and video",
    )
    add_worker_options(parser)
    add_output_options(parser, "runs/scorecard-ROBOT-CONTROLLER, of a quick one with -quick behind")
    parser.set_defaults(act=act, simulates=True)


def act(options: argparse.Namespace) -> int:
    """Makes a card, or compares two."""
    if options.list:
        return _list(as_json=options.json)
    if options.compare is not None:
        return _compare(options)
    if options.replay is not None:
        return _replay(options)
    return _make(options)


def _make(options: argparse.Namespace) -> int:
    from poise.apps.scorecard import FULL, QUICK, Plan, compare, make_card, read_card, write_page

    other = None if options.against is None else read_card(Path(options.against))
    plan = Plan(
        robot=options.robot,
        controller=options.controller,
        strategy=options.strategy,
        extent=QUICK if options.quick else FULL,
        trials=tuple(name.strip() for name in options.trials.split(",") if name.strip()),
    )
    name = "-".join(
        part
        for part in (
            "scorecard",
            Path(plan.robot).stem,
            plan.controller,
            plan.strategy,
            "quick" if options.quick else None,
        )
        if part
    )
    folder = Path(options.out or f"runs/{name}")
    if other is not None:
        # Found before hours of work, not after.
        compare(plan.card((), {}), other)
    try:
        with Bar("episodes", " episodes", lines=not options.json) as bar:
            card = make_card(plan, folder, make_workers(options), bar)
    except KeyboardInterrupt:
        print("interrupted; the same command goes on from here", file=sys.stderr)
        return 1
    card.write(folder)
    page = write_page(card, folder, other)
    if options.json:
        print(json.dumps(asdict(card)))
        return 0
    _print(card)
    if other is not None:
        _print_differences(card, other)
    print(f"page: {page}")
    return 0


def _print(card: Any) -> None:
    from poise.apps.scorecard import reasons_of, result_text

    print(f"{card.robot} with {card.title}")
    for trial in card.trials:
        for case in trial.cases:
            name = f"{trial.title} {case.label}".strip()
            print(f"  {name:44}{result_text(case, trial.unit)}")
    for reason, titles in reasons_of(card).items():
        print(f"left out: {', '.join(titles)}: {reason}")
    if card.worst is not None:
        trial, case = card.worst
        why = f": {case.mechanism}" if case.mechanism else ""
        print(f"worst: {trial.title} {case.label}".rstrip() + why)


def _compare(options: argparse.Namespace) -> int:
    from poise.apps.scorecard import compare, read_card, write_page

    first, second = (read_card(Path(name)) for name in options.compare)
    differences = compare(first, second)
    page = write_page(first, Path(options.out or "runs/scorecard-compare"), second)
    if options.json:
        said = [{**asdict(d), "trial": d.trial.name, "verdict": d.verdict} for d in differences]
        print(json.dumps(said))
        return 0
    _print_differences(first, second)
    print(f"page: {page}")
    return 0


def _replay(options: argparse.Namespace) -> int:
    """Runs one episode again, with everything that a run leaves behind."""
    from poise.apps.campaigns import CampaignFolder
    from poise.apps.scorecard import replay_job

    path, number = Path(options.replay[0]), options.replay[1]
    if not (number.isascii() and number.isdigit()):
        raise ConfigurationError("not the number of an episode", got=number, wanted="0, 1, 2, ...")
    scenario = replay_job(CampaignFolder(path), int(number)).make()
    with output_folder(options.out, path / "replays" / number) as out:
        _, summary = run_and_report(scenario, out, video=True, quiet=options.json)
    if options.json:
        print(json.dumps(summary))
    return 0


def _print_differences(first: Any, second: Any) -> None:
    """A line a case: both results, and whether their intervals are apart."""
    from poise.apps.scorecard import VERDICTS, compare, result_text

    print(f"{first.robot}: {first.title} | {second.title}")
    for difference in compare(first, second):
        trial = difference.trial
        case = difference.first or difference.second
        name = f"{trial.title} {case.label if case else ''}".strip()
        texts = [result_text(c, trial.unit) for c in (difference.first, difference.second)]
        verdict = VERDICTS[difference.verdict]
        print(f"  {name:44}{texts[0]:34}{texts[1]:34}{verdict}".rstrip())


def _list(*, as_json: bool) -> int:
    from poise.apps.scorecard import TRIALS

    if as_json:
        print(json.dumps({trial.name: trial.title for trial in TRIALS}))
        return 0
    for trial in TRIALS:
        ends = f"{trial.easy:g} to {trial.hard:g} {trial.unit}".rstrip()
        print(f"{trial.name:18}{trial.title:34}{ends}")
    return 0
