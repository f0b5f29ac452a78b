"""`poise robots` and `poise describe`: robots that load here, and descriptions of others."""

import warnings
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, arg

from poise.cli._command import FAILED, OK, Figures, Output, output_folder
from poise.errors import ConfigurationError, RobotError
from poise.robots import catalog, describe, description_of, load_robot


@dataclass(frozen=True, kw_only=True)
class RobotsVerb(Figures):
    """List the robots that load by name, with joints, mass, licence and whether installed.

    Any other URDF or MJCF loads by its path.

    example: poise robots --json
    """

    def act(self) -> int:
        """Print the list."""
        entries = catalog()
        names = ("name", "joints", "licence", "installed", "source", "summary")
        figures = [
            {name: getattr(e, name) for name in names} | {"mass_kg": e.mass} for e in entries
        ]
        width = max(len(e.licence) for e in entries)
        row = f"{{:17}}{{:>6}}  {{:>9}}  {{:{width}}}  {{:9}}  {{}}".format
        rows = [row("name", "joints", "mass", "licence", "installed", "what it is")]
        for e in entries:
            installed = "yes" if e.installed else "no"
            rows.append(row(e.name, e.joints, f"{e.mass:.1f} kg", e.licence, installed, e.summary))
        if not all(e.installed for e in entries):
            rows.append('\ninstall the others with: pip install "poise[robots]"')
        return self.show(figures, *rows)


@dataclass(frozen=True, kw_only=True)
class DescribeVerb(Output):
    """Propose a description for a URDF or MJCF file, each fact with its reason.

    Facts are feet and soles, hands, torso, pelvis, home posture, limits and rotor inertias that the
    file lacks. Then the robot stands, squats and reaches in simulation; one with a fixed base
    holds still and reaches. STEM.poise.yaml and describe.html lie in runs/describe-NAME, or in the
    folder of --out. Exit status: 0 all of it went well, 1 something did not, 2 bad input.

    example: poise describe robot.urdf --save

    Attributes:
        file: a URDF, MJCF or xacro file.
        save: write the description beside the model, where load_robot finds it.
        force: let --save write over another description.
        no_trial: leave the simulation out.
    """

    file: Annotated[Positional[str], arg(metavar="FILE")]
    save: bool = False
    force: bool = False
    no_trial: bool = False

    def act(self) -> int:
        """Propose and write the description, then try it and draw the page."""
        path = Path(self.file)
        saved, proposal = description_of(path), describe(path)
        other = saved.is_file() and saved.read_text(encoding="utf-8") != proposal.text
        if self.save and other and not self.force:
            what = "there is a description already, and it is another one"
            remedy = "--force to write over it, or no --save to compare"
            raise ConfigurationError(what, got=str(saved), wanted=remedy)
        with output_folder(self.out, f"runs/describe-{proposal.name}") as folder:
            description = saved if self.save else folder / saved.name
            # First: it is what to mend where the robot cannot be loaded, and is there after Ctrl-C.
            description.write_text(proposal.text, encoding="utf-8")
            refused = robot = page = None
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                try:
                    robot = load_robot(path, proposal.facts)
                except RobotError as error:
                    refused = str(error)
            trial = list[dict[str, Any]]()
            if robot is not None:
                from poise.apps.onboarding import try_out, write_page

                tried, page = None if self.no_trial else try_out(robot), folder / "describe.html"
                write_page(robot, proposal, tried, page)
                trial = [] if tried is None else [asdict(a) for a in tried.attempts]
        summary = {
            "facts": proposal.facts,
            "reasons": proposal.reasons,
            "remarks": [*proposal.remarks, *(str(warning.message) for warning in caught)],
            "refused": refused,
            "trial": trial,
            "description": str(description),
            "page": None if page is None else str(page),
        }
        size = "" if robot is None else f": {robot.nj} joints, {robot.mass:.1f} kg"
        self.show(summary, f"{proposal.name}{size}", f"  {proposal.summary}", *_rows(summary))
        return OK if refused is None and all(attempt["ok"] for attempt in trial) else FAILED


def _rows(summary: dict[str, Any]) -> Iterator[str]:
    for remark in summary["remarks"]:
        yield f"  note: {remark}"
    if summary["refused"]:
        yield f"  FAIL  load: {summary['refused']}"
    for tried in summary["trial"]:
        torque = f"at most {100 * tried['figures']['torque_ratio_max']:.0f} % of a torque limit"
        words = "; ".join(tried["words"]) or f"{torque} ({tried['weakest']})"
        yield f"  {'ok  ' if tried['ok'] else 'FAIL'}  {tried['name']}: {words}"
    mend = ", to be mended by hand" if summary["refused"] else ""
    yield f"description: {summary['description']}{mend}"
    if summary["page"]:
        yield f"page: {summary['page']}"
