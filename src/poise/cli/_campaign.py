"""`poise campaign`: many episodes of a scenario to a table, and any one of them again."""

import argparse
import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

from poise._progress import Bar
from poise.cli._options import add_output_options, add_worker_options, make_workers, output_folder
from poise.cli._run import run_and_report
from poise.errors import ConfigurationError

_FORMS = "FILE, status FOLDER, or replay FOLDER NUMBER"
"""What may stand behind the verb."""


def add_parser(verbs: Any) -> None:
    """Adds the verb to the command line."""
    parser = verbs.add_parser(
        "campaign",
        help="many episodes of a scenario to a table",
        usage="poise campaign [options] FILE\n"
        "       poise campaign status FOLDER [--json]\n"
        "       poise campaign replay FOLDER NUMBER [--no-video]",
        description="Runs all episodes of a campaign's file over processes of this machine or a "
        "cluster, one row each of a Parquet dataset in DIR/episodes. The same command goes on with "
        "a campaign that was interrupted. `status` says how far one is; `replay` runs an episode "
        "again, with report and video. Exit status: 0 every episode has a result, 1 interrupted, "
        "or a replay has other figures, 2 bad input.",
        epilog="example: poise campaign examples/pushes.yaml --workers 8",
    )
    parser.add_argument(
        "words",
        nargs="+",
        metavar="FILE",
        help="a campaign's YAML file; or `status` or `replay`, and behind it what the usage above "
        "names: a campaign's folder, an episode's number",
    )
    add_worker_options(parser)
    parser.add_argument("--no-video", action="store_true", help="of a replay, leave the video out")
    add_output_options(parser, "runs/campaign-FILE; of a replay FOLDER/replays/NUMBER")
    parser.set_defaults(act=act, simulates=True)


def act(options: argparse.Namespace) -> int:
    """Does what the words ask for."""
    match options.words:
        case ["status", folder]:
            return _status(Path(folder), as_json=options.json)
        case ["replay", folder, number]:
            return _replay(Path(folder), number, options)
        case [file]:
            return _run(Path(file), options)
        case words:
            raise ConfigurationError("cannot read this command", got=" ".join(words), wanted=_FORMS)


def _run(file: Path, options: argparse.Namespace) -> int:
    from poise.apps.campaigns import run_campaign

    folder = Path(options.out or f"runs/campaign-{file.stem}")
    try:
        with Bar("episodes", " episodes", lines=not options.json) as bar:
            run_campaign(file, folder, make_workers(options), bar)
    except KeyboardInterrupt:
        print("interrupted; the same command goes on from here", file=sys.stderr)
        _status(folder, as_json=options.json)
        return 1
    return _status(folder, as_json=options.json)


def _status(path: Path, *, as_json: bool) -> int:
    """Says how far a campaign is; it may be running meanwhile."""
    said = _progress(path)
    if as_json:
        print(json.dumps(said))
        return 0
    print(f"{said['campaign']}: {said['done']} of {said['episodes']} episodes in {path}")
    for name, count in said["outcomes"].items():
        print(f"  {name:10}{count}")
    if said["running"]:
        left = "" if said["left_s"] is None else f", {said['left_s']:.0f} s left"
        print(f"running: {said['rate_hz']:.2f} episodes/s{left}")
    if len(said["versions"]) > 1:
        print(f"versions of Poise: {', '.join(said['versions'])}", file=sys.stderr)
    if said.get("best"):
        print(f"best: {json.dumps(said['best'])}")
    return 0


def _progress(path: Path) -> dict[str, Any]:
    """What there is to say of a campaign."""
    from poise.apps.campaigns import OUTCOMES, CampaignFolder, Design, best_trial

    folder = CampaignFolder(path)
    design = Design.of(folder)
    campaign, rows = design.campaign, folder.first(design.count)
    found = Counter(row["outcome"] for row in rows)
    said: dict[str, Any] = {
        "campaign": campaign.name,
        "episodes": design.count,
        "done": len(rows),
        "outcomes": {name: found[name] for name in OUTCOMES if found[name]},
        "versions": sorted({row["version"] for row in rows}),
        **folder.pace(design.count),
    }
    if campaign.tune is not None:
        said["best"] = best_trial(campaign, campaign.tune, path)
    return said


def _replay(path: Path, number: str, options: argparse.Namespace) -> int:
    """Runs one episode again, and compares it with its row."""
    from poise.apps.campaigns import CampaignFolder, differences, replay_job, row_of

    if not (number.isascii() and number.isdigit()):
        raise ConfigurationError("not the number of an episode", got=number, wanted="0, 1, 2, ...")
    folder = CampaignFolder(path)
    job = replay_job(folder, int(number))
    with output_folder(options.out, path / "replays" / number) as out:
        run, summary = run_and_report(
            job.make(), out, video=not options.no_video, quiet=options.json
        )
    recorded = folder.rows[job.number]
    differ = differences(recorded, row_of(job, run))
    if options.json:
        print(json.dumps({**summary, "differs": differ}))
    if differ:
        print(
            f"differs from what version {recorded['version']} recorded: {', '.join(differ)}",
            file=sys.stderr,
        )
    elif not options.json:
        print(f"the figures are those of episode {number}, outcome {recorded['outcome']}")
    return 1 if differ else 0
