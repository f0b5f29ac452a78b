"""Each model below a folder: whether it loads, stands, squats and reaches, and what went wrong."""

import importlib.metadata
import time
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from poise.apps.strangers import try_out
from poise.errors import ConfigurationError, PoiseError
from poise.robots import describe, load_robot
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions

_FEWEST_JOINTS = 10
"""Files with fewer joints are hands, arms and scenery."""

_PART = 0.9
"""Nine of ten strangers should do each thing."""

_TRIED = ("stand", "squat", "reach")


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of one model.

    Attributes:
        file: its path below the folder.
        joints: actuated joints; None where it was not loaded.
        mass: [kg]; None where it was not loaded.
        seconds: to describe and load it [s].
        done: by thing tried whether it went well; what was not come to is left out.
        words: what went wrong and what is odd.
    """

    file: str
    joints: int | None
    mass: float | None
    seconds: float
    done: dict[str, bool]
    words: str

    @property
    def row(self) -> tuple[str | int | float | None, ...]:
        """As the table has it."""
        loads = "yes" if self.joints is not None else "no"
        tried = (("yes" if self.done[t] else "no") if t in self.done else None for t in _TRIED)
        mass = None if self.mass is None else round(self.mass, 1)
        return (self.file, loads, *tried, self.joints, mass, round(self.seconds, 1), self.words)


def tries_section(options: StudyOptions, progress: Progress) -> Section:
    """The table of all models, and how many did each thing."""
    folder = _folder(options)
    paths = list(_models(folder))
    if not paths:
        raise ConfigurationError(
            "no model of a robot stands below the folder", got=str(folder), wanted="URDF or MJCF"
        )
    outcomes: list[Outcome] = []
    for number, path in enumerate(paths):
        progress(number, len(paths))
        outcomes.append(_outcome(path, folder, simulate=not options.quick))
    table = Table(
        title="Models as downloaded",
        header="model | loads | stands | squats | reaches | joints | mass [kg] | loaded in [s] | "
        "words",
        rows=tuple(outcome.row for outcome in outcomes),
        caption="A robot without hands reaches for nothing. Words say what went wrong, or what is "
        "odd about the file.",
    )
    loaded = [o for o in outcomes if o.joints is not None]
    findings = [_share("models that load", len(loaded), len(outcomes))]
    for thing in () if options.quick else _TRIED:
        of = [o for o in outcomes if thing in o.done] if thing == "reach" else outcomes
        good = sum(o.done.get(thing, False) for o in of)
        findings.append(_share(f"models that {thing}", good, len(of)))
    return Section(tables=(table,), findings=tuple(findings))


def _share(name: str, good: int, of: int) -> Finding:
    return Finding(
        name=name,
        ours=good / max(of, 1),
        paper=_PART,
        ok=good >= _PART * of,
        note=f"{good} of {of}; wanted are nine of ten",
    )


def _folder(options: StudyOptions) -> Path:
    """Where the models are.

    Raises:
        ConfigurationError: no such folder, or none is named and example-robot-data is missing.
    """
    if options.directory is not None:
        folder = Path(options.directory)
        if not folder.is_dir():
            raise ConfigurationError("no such folder", got=str(folder), wanted="--dir DIR")
        return folder
    try:
        data = importlib.metadata.distribution("example-robot-data")
    except importlib.metadata.PackageNotFoundError:
        raise ConfigurationError(
            "no models to try", got="no --dir", wanted="--dir DIR, or example-robot-data"
        ) from None
    return Path(str(data.locate_file("cmeel.prefix/share/example-robot-data/robots")))


def _models(folder: Path) -> Iterator[Path]:
    """Files with a robot of some size in them; scenes that include one are left out."""
    for path in sorted([*folder.rglob("*.urdf"), *folder.rglob("*.xml")]):
        try:
            root = ET.parse(path).getroot()
        except (ET.ParseError, OSError, UnicodeDecodeError):
            continue
        if root.tag == "robot":
            joints = [j for j in root.findall("joint") if j.get("type") != "fixed"]
        elif root.tag == "mujoco":
            joints = [j for world in root.findall("worldbody") for j in world.iter("joint")]
        else:
            continue
        if len(joints) >= _FEWEST_JOINTS:
            yield path


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
        except PoiseError as error:
            words.append(str(error))
            seconds = seconds or time.perf_counter() - begin
    return Outcome(
        file=file, joints=joints, mass=mass, seconds=seconds, done=done, words="; ".join(words)
    )
