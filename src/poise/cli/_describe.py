"""`poise describe`: a description of a URDF or MJCF that nobody has described yet."""

import argparse
import json
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from poise.cli._options import add_output_options, output_folder
from poise.errors import ConfigurationError, RobotError
from poise.robots import Proposal, Robot, describe, load_robot


def add_parser(verbs: Any) -> None:
    """Adds the verb to the command line."""
    parser = verbs.add_parser(
        "describe",
        help="a description of a stranger's URDF or MJCF",
        description="Proposes a description for a URDF or MJCF file: feet and soles, hands, torso, "
        "pelvis, home posture, limits and rotor inertias that the file lacks, each with its "
        "reason. Then the robot stands, squats and reaches in simulation; one with a fixed base "
        "holds still and reaches. Writes "
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
    parser.set_defaults(act=act, simulates=True)


def act(options: argparse.Namespace) -> int:
    """Proposes, writes the description, then tries it out and draws the page."""
    path = Path(options.file)
    saved = path.parent / f"{path.stem}.poise.yaml"
    proposal = describe(path)
    if options.save and not options.force:
        _check_unwritten(saved, proposal)
    with output_folder(options.out, f"runs/describe-{path.stem}") as folder:
        description = saved if options.save else folder / saved.name
        # First: it is what to mend where the robot cannot be loaded, and is there after Ctrl-C.
        description.write_text(proposal.text, encoding="utf-8")
        outcome = _tried(path, proposal, folder, trial=not options.no_trial)
    if options.json:
        print(json.dumps(_summary(proposal, outcome, description)))
    else:
        _print(proposal, outcome, description)
    return 0 if outcome.ok else 1


@dataclass(kw_only=True)
class _Outcome:
    """What came of a proposal.

    Attributes:
        remarks: what was found odd, by the proposal or as the robot was loaded.
        robot: the robot; None where its description cannot be right yet.
        refused: why that is so; "" elsewhere.
        trial: how it did in simulation, a `poise.apps.strangers.Trial`; None where that
            was left out.
        page: what shows it; None where the robot does not load.
    """

    remarks: list[str]
    robot: Robot | None = None
    refused: str = ""
    trial: Any = None
    page: Path | None = None

    @property
    def ok(self) -> bool:
        """Whether all went well."""
        return not self.refused and (self.trial is None or self.trial.ok)


def _tried(path: Path, proposal: Proposal, folder: Path, *, trial: bool) -> _Outcome:
    """Loads the robot as proposed, lets it try, and draws it."""
    outcome = _Outcome(remarks=list(proposal.remarks))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            outcome.robot = robot = load_robot(path, proposal.facts)
        except RobotError as error:
            outcome.refused = str(error)
            return outcome
        finally:
            outcome.remarks += [str(warning.message) for warning in told]
    from poise.apps.strangers import try_out, write_page

    outcome.trial = try_out(robot) if trial else None
    outcome.page = folder / "describe.html"
    write_page(robot, proposal, outcome.trial, outcome.page)
    return outcome


def _check_unwritten(saved: Path, proposal: Proposal) -> None:
    """Raises ConfigurationError where a description would be lost that says something else."""
    if saved.is_file() and saved.read_text(encoding="utf-8") != proposal.text:
        raise ConfigurationError(
            "there is a description already, and it is another one",
            got=str(saved),
            wanted="--force to write over it, or no --save to compare",
        )


def _summary(proposal: Proposal, outcome: _Outcome, description: Path) -> dict[str, object]:
    attempts = [] if outcome.trial is None else outcome.trial.attempts
    return {
        "facts": proposal.facts,
        "reasons": proposal.reasons,
        "remarks": outcome.remarks,
        "refused": outcome.refused or None,
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
        "page": None if outcome.page is None else str(outcome.page),
    }


def _print(proposal: Proposal, outcome: _Outcome, description: Path) -> None:
    robot = outcome.robot
    size = "" if robot is None else f": {robot.nj} joints, {robot.mass:.1f} kg"
    print(f"{proposal.name}{size}")
    print(f"  {proposal.summary}")
    for remark in outcome.remarks:
        print(f"  note: {remark}")
    if outcome.refused:
        print(f"  FAIL  load: {outcome.refused}")
    for attempt in () if outcome.trial is None else outcome.trial.attempts:
        mark = "ok  " if attempt.ok else "FAIL"
        torque = f"at most {100 * attempt.torque_ratio:.0f} % of a torque limit ({attempt.weakest})"
        print(f"  {mark}  {attempt.name}: {'; '.join(attempt.words) or torque}")
    print(f"description: {description}" + (", to be mended by hand" if outcome.refused else ""))
    if outcome.page is not None:
        print(f"page: {outcome.page}")
