"""`poise describe`: a description of a URDF or MJCF that nobody has described yet."""

import argparse
import json
from pathlib import Path
from typing import Any

from poise.cli._options import add_output_options, make_folder
from poise.errors import ConfigurationError
from poise.robots import Proposal, describe, load_robot


def add_parser(verbs: Any) -> None:
    """Adds the verb to the command line."""
    parser = verbs.add_parser(
        "describe",
        help="a description of a stranger's URDF or MJCF",
        description="Proposes a description for a URDF or MJCF file: feet and soles, hands, torso, "
        "pelvis, home posture, limits and rotor inertias that the file lacks, each with its "
        "reason. Then the robot stands, squats and reaches in simulation. Writes "
        "STEM.poise.yaml and describe.html. Exit status: 0 all of it went well, 1 something did "
        "not, 2 bad input.",
        epilog="example: poise describe robot.urdf --save",
    )
    parser.add_argument("file", help="a URDF or MJCF file")
    parser.add_argument(
        "--save",
        action="store_true",
        help="write the description beside the model, where load_robot finds it",
    )
    parser.add_argument(
        "--force", action="store_true", help="let --save write over another description"
    )
    parser.add_argument("--no-trial", action="store_true", help="leave the simulation out")
    add_output_options(parser, "runs/describe-STEM")
    parser.set_defaults(act=act)


def act(options: argparse.Namespace) -> int:
    """Proposes, tries out, and writes everything."""
    path = Path(options.file)
    saved = path.parent / f"{path.stem}.poise.yaml"
    proposal = describe(path)
    if options.save and not options.force:
        _check_unwritten(saved, proposal)
    robot = load_robot(path, proposal.facts)
    trial = None
    if not options.no_trial and robot.floating_base:
        from poise.apps.strangers import try_out

        trial = try_out(robot)
    folder = make_folder(options.out, f"runs/describe-{path.stem}")
    description = saved if options.save else folder / saved.name
    description.write_text(proposal.text, encoding="utf-8")
    page = None
    if robot.floating_base:
        from poise.apps.strangers import write_page

        page = folder / "describe.html"
        write_page(robot, proposal, trial, page)
    if options.json:
        print(json.dumps(_summary(proposal, trial, description, page)))
    else:
        _print(proposal, robot, trial, description, page)
    return 0 if trial is None or trial.ok else 1


def _check_unwritten(saved: Path, proposal: Proposal) -> None:
    """Raises ConfigurationError where a description would be lost that says something else."""
    if saved.is_file() and saved.read_text(encoding="utf-8") != proposal.text:
        raise ConfigurationError(
            "there is a description already, and it is another one",
            got=str(saved),
            wanted="--force to write over it, or no --save to compare",
        )


def _summary(
    proposal: Proposal, trial: Any, description: Path, page: Path | None
) -> dict[str, object]:
    attempts = [] if trial is None else trial.attempts
    return {
        "facts": proposal.facts,
        "reasons": proposal.reasons,
        "remarks": list(proposal.remarks),
        "trial": [
            {
                "name": attempt.name,
                "ok": attempt.ok,
                "words": list(attempt.words),
                "com_error_m": attempt.com_error,
                "torque_ratio": attempt.torque_ratio,
                "weakest": attempt.weakest,
            }
            for attempt in attempts
        ],
        "description": str(description),
        "page": None if page is None else str(page),
    }


def _print(
    proposal: Proposal, robot: Any, trial: Any, description: Path, page: Path | None
) -> None:
    print(f"{proposal.name}: {robot.nj} joints, {robot.mass:.1f} kg")
    print(f"  {proposal.summary}")
    for remark in proposal.remarks:
        print(f"  note: {remark}")
    for attempt in () if trial is None else trial.attempts:
        mark = "ok  " if attempt.ok else "FAIL"
        torque = f"at most {100 * attempt.torque_ratio:.0f} % of a torque limit ({attempt.weakest})"
        print(f"  {mark}  {attempt.name}: {'; '.join(attempt.words) or torque}")
    print(f"description: {description}")
    if page is not None:
        print(f"page: {page}")
