"""Each model: its verdicts from loading to an obstacle, and what went wrong in words."""

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from poise.apps.onboarding import try_out
from poise.apps.scenarios import Run, load_scenario, run_scenario
from poise.errors import PoiseError
from poise.robots import describe, load_robot
from studies.finding import Cell, Finding, Section, Table
from studies.onboarding.listed import LISTED
from studies.onboarding.model_files import listed_models, models_folder, other_models
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

_SCENES = {"walk": "walk", "obstacle": "over_an_obstacle"}
"""Shipped scenarios that are run besides `poise describe`, by the column of the table."""

_WANTED = {"walk": ("steps_made",), "obstacle": ("beyond_blocks_end", "clearance_min")}
"""Metrics whose checks have to hold where a robot does not fall."""

_PARTS = {"load": 0.9, "stand": 0.9, "squat": 0.9, "reach": 0.9, "walk": 0.8, "obstacle": 0.8}
"""Of ten models nine should do the simple things, eight walk and step over an obstacle."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """A file to try.

    Attributes:
        path: of the file.
        changed: when the file was last changed [ns]; a changed file is tried again.
        simulate: try more than loading.
    """

    path: Path
    changed: int
    simulate: bool


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The verdicts on one model.

    Attributes:
        joints: actuated joints; None where it was not loaded.
        mass: [kg]; None where it was not loaded.
        seconds: to describe and load it [s].
        minutes: for all of it [min].
        done: by thing tried, success; things that were not reached are left out.
        remarks: on the file, and on what failed.
    """

    joints: int | None = None
    mass: float | None = None
    seconds: float | None = None
    minutes: float | None = None
    done: dict[str, bool]
    remarks: str

    @property
    def cells(self) -> tuple[Cell, ...]:
        """The row of the table, without its first columns."""
        done = (
            ("yes" if self.done[thing] else "no") if thing in self.done else None
            for thing in _PARTS
        )
        numbers = (
            None if number is None else round(number, 1)
            for number in (self.joints, self.mass, self.seconds, self.minutes)
        )
        return (*done, *numbers, self.remarks)


def listed_section(options: StudyOptions, progress: Progress) -> Section:
    """Try the fixed list, and say which of its models are missing.

    Args:
        options: name the folder.
        progress: of the models.
    """
    folder = models_folder(options)
    there = listed_models(folder)
    outcomes = _outcomes(tuple(there.values()), options, progress)
    tried = dict(zip(there, outcomes, strict=True))
    missing = Outcome(done={}, remarks="missing below the folder")
    table = _table(
        "The fixed list",
        "model | repository | listed for | licence",
        [(m.model, m.repository, m.kind, m.licence, *tried.get(m, missing).cells) for m in LISTED],
    )
    count = Finding(
        name="models of the list below the folder",
        ours=len(there),
        paper=len(LISTED),
        ok=len(there) == len(LISTED),
        note="each at `OWNER+NAME/PATH` below it",
    )
    return Section(tables=(table,), findings=(count, *_shares("listed models", outcomes, options)))


def others_section(options: StudyOptions, progress: Progress) -> Section:
    """Try every other model below the folder.

    Args:
        options: name the folder.
        progress: of the models.
    """
    folder = models_folder(options)
    paths = other_models(folder)
    outcomes = _outcomes(paths, options, progress)
    rows = [(str(p.relative_to(folder)), *o.cells) for p, o in zip(paths, outcomes, strict=True)]
    return Section(
        tables=(_table("Models as downloaded", "file", rows),),
        findings=_shares("other models", outcomes, options),
    )


def _outcomes(paths: Sequence[Path], options: StudyOptions, progress: Progress) -> list[Outcome]:
    trials = [
        Trial(path=path, changed=path.stat().st_mtime_ns, simulate=not options.quick)
        for path in paths
    ]
    return list(run_each(try_model, Outcome, trials, progress, options).values())


def _table(title: str, first: str, rows: Sequence[tuple[Cell, ...]]) -> Table:
    return Table(
        title=title,
        header=f"{first} | {' | '.join(_PARTS)} | joints | mass [kg] | loaded in [s] "
        "| all of it in [min] | remarks",
        rows=tuple(rows),
        caption="As `poise describe FILE`, `poise run walk --robot FILE` and `poise run "
        "over_an_obstacle --robot FILE` do it. A robot without hands reaches for nothing, and one "
        "that does not stand is not tried further. "
        "One walks that makes all twenty steps and stays up, pushed half way, and is led over an "
        "obstacle if both feet get behind it, touch it nowhere and stay up; other bounds that it "
        "misses are remarked on.",
    )


def _shares(models: str, outcomes: Sequence[Outcome], options: StudyOptions) -> tuple[Finding, ...]:
    """The share of models that did each thing; hands reach of those alone that came so far."""
    found: list[Finding] = []
    things = ("load",) if options.quick else tuple(_PARTS)
    for thing in things if outcomes else ():
        of = [o for o in outcomes if thing in o.done] if thing == "reach" else outcomes
        good, part = sum(o.done.get(thing, False) for o in of), _PARTS[thing]
        found.append(
            Finding(
                name=f"{models}: {thing}",
                ours=good / max(len(of), 1),
                paper=part,
                ok=good >= part * len(of),
                note=f"{good} of {len(of)}; wanted are {10 * part:.0f} of ten",
            )
        )
    return tuple(found)


def try_model(trial: Trial) -> Outcome:
    """Describe and load a file, then try what it can do.

    Args:
        trial: the file.
    """
    begin = time.perf_counter()
    done, remarks, thing = dict[str, bool](), list[str](), "load"
    joints, mass, seconds = None, None, None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            proposal = describe(trial.path)
            robot = load_robot(trial.path, proposal.facts)
            seconds = time.perf_counter() - begin
            done["load"], joints, mass, thing = True, robot.nj, robot.mass, "stand"
            remarks += proposal.remarks
            for attempt in try_out(robot).attempts if trial.simulate else ():
                done[attempt.name] = attempt.ok
                remarks += [f"{attempt.name}: {said}" for said in attempt.words]
            for thing, scenario in _SCENES.items() if done.get("stand") else ():
                done[thing], said = _played(scenario, trial.path, _WANTED[thing])
                remarks += [f"{thing}: {said}"] if said else []
        except Exception as error:
            # A file that trips a library fails alone: the others are tried all the same.
            named = "" if isinstance(error, PoiseError) else f"{type(error).__name__}: "
            remarks.append(f"{named}{error}")
            done[thing] = False
    return Outcome(
        joints=joints,
        mass=mass,
        seconds=time.perf_counter() - begin if seconds is None else seconds,
        minutes=(time.perf_counter() - begin) / 60.0,
        done=done,
        remarks="; ".join(remarks),
    )


def _played(scenario: str, path: Path, wanted: tuple[str, ...]) -> tuple[bool, str]:
    """Run a shipped scenario: success, and what failed in it."""
    try:
        run = run_scenario(replace(load_scenario(scenario), robot=str(path)))
    except PoiseError as error:
        return False, str(error)
    if run.ok:
        return True, ""
    done = [check.ok for check in run.checks if check.metric in wanted]
    return bool(done) and all(done) and not run.fell, _failure(run)


def _failure(run: Run) -> str:
    """The check that is farthest beyond its bound, or the fall, with its mechanism."""
    failed = [check for check in run.checks if not check.ok]
    worst = max(failed, key=lambda c: abs(c.value - c.bound) / max(abs(c.bound), 1e-9))
    said = f"{worst.name} {worst.value:.2g} {worst.unit} ({worst.relation} {worst.bound:.2g})"
    if run.fell:
        worst = next(check for check in failed if check.metric == "fell")
        said = f"fell at {run.plant.time:.1f} s"
    return f"{said}: {worst.mechanism}" if worst.mechanism else said
