"""Each model below a folder: what it does of what is asked of it, and what went wrong."""

import time
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

from poise.apps.onboarding import try_out
from poise.apps.scenarios import Run, load_scenario, run_scenario
from poise.errors import PoiseError
from poise.robots import describe, load_robot
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.strangers.model_files import model_files

_TRIED = ("stand", "squat", "reach")
"""What `poise describe` tries."""

_SCENES = {"walk": "walk", "obstacle": "over_an_obstacle"}
"""Shipped scenarios that are run as well, sized to the robot, by the column of the table."""

_WANTED = {"walk": ("steps_made",), "obstacle": ("beyond_blocks_end", "clearance_min")}
"""Metrics whose checks have to hold where a robot does not fall."""

_PARTS = {"load": 0.9, "stand": 0.9, "squat": 0.9, "reach": 0.9, "walk": 0.8, "obstacle": 0.8}
"""Of ten strangers nine should do the simple things, eight walk and be led over an obstacle."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of one model.

    Attributes:
        file: its path below the folder.
        joints: actuated joints; None where it was not loaded.
        mass: [kg]; None where it was not loaded.
        seconds: to describe and load it [s].
        minutes: for all of it [min].
        done: by thing tried whether it went well; what was not come to is left out.
        words: what went wrong and what is odd.
    """

    file: str
    joints: int | None
    mass: float | None
    seconds: float
    minutes: float
    done: dict[str, bool]
    words: str

    @property
    def row(self) -> tuple[str | int | float | None, ...]:
        """As the table has it."""
        loads = "yes" if self.joints is not None else "no"
        things = (*_TRIED, *_SCENES)
        tried = (("yes" if self.done[t] else "no") if t in self.done else None for t in things)
        mass = None if self.mass is None else round(self.mass, 1)
        times = round(self.seconds, 1), round(self.minutes, 1)
        return (self.file, loads, *tried, self.joints, mass, *times, self.words)


def tries_section(options: StudyOptions, progress: Progress) -> Section:
    """The table of all models, and how many did each thing."""
    folder, paths = model_files(options)
    outcomes: list[Outcome] = []
    for number, path in enumerate(paths):
        progress(number, len(paths))
        outcomes.append(_outcome(path, folder, simulate=not options.quick))
    table = Table(
        title="Models as downloaded",
        header="model | loads | stands | squats | reaches | walks | obstacle | joints | mass [kg] "
        "| loaded in [s] | all of it in [min] | words",
        rows=tuple(outcome.row for outcome in outcomes),
        caption="As `poise describe FILE`, `poise run walk --robot FILE` and `poise run "
        "over_an_obstacle --robot FILE` do it. A robot without hands reaches for nothing. "
        "One walks that makes all twenty steps and stays up, pushed half way, and is led over an "
        "obstacle if both feet get behind it, touch it nowhere and stay up; bounds that it misses "
        "meanwhile are said. Words say what went wrong, or what is odd about the file.",
    )
    loaded = [o for o in outcomes if o.joints is not None]
    findings = [_share("load", len(loaded), len(outcomes))]
    for thing in () if options.quick else (*_TRIED, *_SCENES):
        of = [o for o in outcomes if thing in o.done] if thing == "reach" else outcomes
        good = sum(o.done.get(thing, False) for o in of)
        findings.append(_share(thing, good, len(of)))
    return Section(tables=(table,), findings=tuple(findings))


def _share(thing: str, good: int, of: int) -> Finding:
    part = _PARTS[thing]
    name = "models that are led over an obstacle" if thing == "obstacle" else f"models that {thing}"
    return Finding(
        name=name,
        ours=good / max(of, 1),
        paper=part,
        ok=good >= part * of,
        note=f"{good} of {of}; wanted are {10 * part:.0f} of ten",
    )


def _outcome(path: Path, folder: Path, *, simulate: bool) -> Outcome:
    begin = time.perf_counter()
    file, done, words = str(path.relative_to(folder)), dict[str, bool](), list[str]()
    joints, mass, seconds = None, None, 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            proposal = describe(path)
            robot = load_robot(path, proposal.facts)
            seconds = time.perf_counter() - begin
            joints, mass = robot.nj, robot.mass
            words += proposal.remarks
            for attempt in try_out(robot).attempts if simulate else ():
                done[attempt.name] = attempt.ok
                words += [f"{attempt.name}: {said}" for said in attempt.words]
            for thing, scenario in _SCENES.items() if done.get("stand") else ():
                done[thing], said = _played(scenario, path, _WANTED[thing])
                words += [f"{thing}: {said}"] if said else []
        except PoiseError as error:
            words.append(str(error))
            seconds = seconds or time.perf_counter() - begin
    return Outcome(
        file=file,
        joints=joints,
        mass=mass,
        seconds=seconds,
        minutes=(time.perf_counter() - begin) / 60.0,
        done=done,
        words="; ".join(words),
    )


def _played(scenario: str, path: Path, wanted: tuple[str, ...]) -> tuple[bool, str]:
    """Whether a model does what a shipped scenario is for, and what failed in it."""
    try:
        run = run_scenario(replace(load_scenario(scenario), robot=str(path)))
    except PoiseError as error:
        return False, str(error)
    if run.ok:
        return True, ""
    done = [check.ok for check in run.checks if check.metric in wanted]
    return bool(done) and all(done) and not run.fell, _failure(run)


def _failure(run: Run) -> str:
    """The check that is farthest beyond its bound, or the fall, with what stood behind it."""
    failed = [check for check in run.checks if not check.ok]
    worst = max(failed, key=lambda c: abs(c.value - c.bound) / max(abs(c.bound), 1e-9))
    said = f"{worst.name} {worst.value:.2g} {worst.unit} ({worst.relation} {worst.bound:.2g})"
    if run.fell:
        worst = next(check for check in failed if check.metric == "fell")
        said = f"fell at {run.plant.time:.1f} s"
    return f"{said}: {worst.mechanism}" if worst.mechanism else said
