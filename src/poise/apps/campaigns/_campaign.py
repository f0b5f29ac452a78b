"""`Campaign`: the form of a campaign's file. `Design`: the episodes that it describes."""

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator

from poise._schema import Bounds, Count, Number, Text, Vector, checked, read
from poise._yaml import read_text, read_yaml
from poise.apps.campaigns._episode import ABOUT, FIGURES, TIMINGS, Job
from poise.apps.campaigns._fields import spread, with_fields
from poise.apps.campaigns._folder import CampaignFolder
from poise.apps.scenarios import Measurement, make_scenario, read_scenario
from poise.errors import ConfigurationError, PoiseError, UnknownNameError
from poise.robots import files_digest

_OWN = ("seed", "name")  # fields that no campaign varies: each episode has its own seed

# Names of columns of which there are as many as a run has levels and checks.
_OF_A_RUN = re.compile(r"residual_max_\d+|check: .*", re.DOTALL)

_Range = Annotated[tuple[float, float], Vector(2)]


@checked()
@dataclass(frozen=True, kw_only=True)
class Draw:
    """Values of one field; one of these keys is given."""

    grid: tuple[Any, ...] | None = None  # each, with every point of the other grids; a bare list
    uniform: _Range | None = None  # drawn between two bounds, each value as likely
    log_uniform: _Range | None = None  # between two bounds > 0, each order of magnitude as likely
    choice: tuple[Any, ...] | None = None  # drawn from these, each as likely

    def __post_init__(self) -> None:
        given = {k: v for k, v in vars(self).items() if v is not None}
        if len(given) != 1:
            raise ConfigurationError(
                "there must be one of these keys", got=list(given), choices=tuple(vars(self))
            )
        kind, values = given.popitem()
        if not values:
            raise ConfigurationError(f"{kind} is empty", got=[], wanted="a value or several")
        if kind.endswith("uniform") and not values[0] < values[1]:
            raise ConfigurationError(f"{kind} has no room", got=list(values), wanted="low < high")
        if kind == "log_uniform" and values[0] <= 0.0:
            raise ConfigurationError(
                "log_uniform is not above zero", got=list(values), wanted="> 0"
            )

    @property
    def extremes(self) -> tuple[Any, ...]:
        """All values where they can be counted, else the bounds."""
        return self.grid or self.choice or self.uniform or self.log_uniform or ()

    @property
    def samples(self) -> tuple[Any, ...]:
        """All values where they can be counted, else the bounds and one between."""
        if self.uniform is None and self.log_uniform is None:
            return self.extremes
        # At random, as bounds and the middle of them may be whole numbers where others are not.
        return (*self.extremes, self.draw(np.random.default_rng(0)))

    def takes(self, value: Any) -> bool:
        """True for a value that may be drawn."""
        if self.uniform is None and self.log_uniform is None:
            return value in self.extremes
        low, high = self.extremes
        return isinstance(value, int | float) and low <= value <= high

    def draw(self, rng: np.random.Generator) -> Any:
        """A value at random."""
        if self.uniform is not None:
            return float(rng.uniform(*self.uniform))
        if self.log_uniform is not None:
            low, high = (math.log(bound) for bound in self.log_uniform)
            # Rounding must not lead beyond a bound that the scenario may not pass either.
            return float(np.clip(math.exp(rng.uniform(low, high)), *self.log_uniform))
        values = self.extremes
        return values[int(rng.integers(len(values)))]


def _as_grid(value: Any) -> Any:
    """A grid may be given as a bare list."""
    return {"grid": list(value)} if isinstance(value, list) else value


def _as_draw(value: Any) -> Any:
    """A plain value stands for itself."""
    drawn = isinstance(value, dict) and [*value] in (["uniform"], ["log_uniform"], ["choice"])
    return value if drawn else {"choice": [value]}


_Draws = dict[Text, Annotated[Draw, BeforeValidator(_as_grid)]]
_Case = dict[Text, Annotated[Draw, BeforeValidator(_as_draw)]]


@checked()
@dataclass(frozen=True, kw_only=True)
class TunePlan:
    """The section `tune`."""

    fields: _Draws  # by path; no grids
    figure: Text  # a column of the results, its mean over a trial's episodes
    goal: Literal["minimise", "maximise"] = "minimise"
    failure: Number  # value of an episode that came to no end, in the figure's unit
    trials: Count  # sets of values that are tried
    episodes: Count = 1  # of one trial; they are drawn alike in all trials
    batch: Count = 4  # trials chosen at a time, so that many workers have something to do
    start: dict[Text, Any] = field(default_factory=dict[str, Any])  # of the first trial, by path

    def __post_init__(self) -> None:
        if not self.fields:
            raise ConfigurationError("fields is empty", got={}, wanted="a field or several")
        for path, draw in self.fields.items():
            if draw.grid is not None:
                raise ConfigurationError(
                    f"{path} is tuned over a grid", got=list(draw.grid), wanted="choice: [...]"
                )
        for path, value in self.start.items():
            if path not in self.fields:
                raise ConfigurationError(
                    "start has a field that is not tuned", got=path, choices=self.fields
                )
            draw = self.fields[path]
            if not draw.takes(value):
                kind = "one of" if draw.choice is not None else "in"
                wanted = f"{kind} {list(draw.extremes)}"
                raise ConfigurationError(
                    f"start has a value that {path} is not tuned over", got=value, wanted=wanted
                )


@checked()
@dataclass(frozen=True, kw_only=True)
class Campaign:
    """Many episodes of one scenario: the form of the file."""

    name: Text
    scenario: Text  # a shipped one, or a file, from the campaign's folder
    seed: Annotated[int, Bounds(least=0.0, whole=True)] = 0  # of draws and the episodes' seeds
    episodes: Count | None = None  # once through the grid when None; those of a tuning are its own
    set: dict[Text, Any] = field(default_factory=dict[str, Any])  # by path, for all episodes
    vary: _Draws = field(default_factory=dict[str, Draw])  # by path, for each episode
    # By name, values or draws of fields that go together: a grid of their own, which changes last
    cases: dict[Text, _Case] = field(default_factory=dict[str, _Case])
    figures: dict[Text, Measurement] = field(default_factory=dict[str, Measurement])
    tune: TunePlan | None = None

    def __post_init__(self) -> None:
        if self.tune is not None and self.episodes is not None:
            raise ConfigurationError(
                "a tuning has no episodes of its own", got=self.episodes, wanted="tune: episodes"
            )
        tuned = () if self.tune is None else self.tune.fields
        columns = {*ABOUT, *FIGURES, *TIMINGS, *self.vary, *tuned}
        for name in self.figures:
            if name in columns or _OF_A_RUN.fullmatch(name):
                raise ConfigurationError(
                    "a figure has the name of another column", got=name, wanted="another name"
                )
        if "seed" in self.set:
            raise ConfigurationError(
                "set has the seed, of which each episode has one of its own",
                got=self.set["seed"],
                wanted="the campaign's own key seed",
            )
        choices = (*self.figures, *FIGURES)
        if self.tune is not None and self.tune.figure not in choices:
            raise UnknownNameError("tune: no such figure", got=self.tune.figure, choices=choices)


class Design:
    """A campaign with its scenario: makes the job of each episode.

    Args:
        campaign: content of the campaign's file.
        scenario: content of the scenario's file.
        where: name of the campaign's file, for messages.
    """

    def __init__(
        self, campaign: Mapping[str, Any], scenario: Mapping[str, Any], where: str
    ) -> None:
        self._content = {"campaign": campaign, "scenario": scenario}
        self._where = where
        self.campaign: Campaign = read(Campaign, campaign, where, error=ConfigurationError)
        self.scenario = _located(with_fields(scenario, self.campaign.set))
        draws = self.campaign.vary
        self._grids = {path: draw.grid for path, draw in draws.items() if draw.grid is not None}
        points = math.prod(len(values) for values in self._grids.values())
        self._points = points * max(1, len(self.campaign.cases))
        self._check()

    @classmethod
    def load(cls, path: Path) -> "Design":
        """Read a campaign from its file; the path of the scenario is relative to its folder."""
        data = read_yaml(
            read_text(path, error=ConfigurationError), path.name, error=ConfigurationError
        )
        campaign: Campaign = read(Campaign, data, path.name, error=ConfigurationError)
        beside = path.parent / campaign.scenario
        scenario, _ = read_scenario(beside if beside.is_file() else campaign.scenario)
        return cls(data, _located(scenario), path.name)

    @classmethod
    def of(cls, folder: CampaignFolder) -> "Design":
        """Read the campaign whose results are in a folder."""
        content = folder.content()
        return cls(content["campaign"], content["scenario"], str(folder.path))

    @property
    def count(self) -> int:
        """Number of episodes."""
        tune = self.campaign.tune
        if tune is not None:
            return tune.trials * tune.episodes
        return self.campaign.episodes or self._points

    def jobs(self) -> Iterator[Job]:
        """Return all episodes of a campaign without tuning."""
        return (self.job(number) for number in range(self.count))

    def trial(self, trial: int, values: Mapping[str, Any]) -> list[Job]:
        """Return the episodes of a trial; seeds and draws are the same for every trial."""
        count = self.campaign.tune.episodes if self.campaign.tune is not None else 0
        return [
            replace(
                job,
                number=trial * count + job.number,
                values=_located({**job.values, **values}),
                labels={"trial": trial},
            )
            for job in map(self.job, range(count))
        ]

    def job(self, number: int) -> Job:
        """Return one episode; it does not depend on how many there are."""
        rng = np.random.default_rng([self.campaign.seed, number])
        seed = int(rng.integers(10**9))
        point, name = self._point(number)
        case, drawn = self.campaign.cases.get(name, {}), dict[str, Any]()
        # Lists of a case are there before their items vary, and it has the last word on a field.
        for path, draw in {**case, **self.campaign.vary, **case}.items():
            given = path in point and path not in case
            for each in self._spread(path, drawn):
                drawn[each] = point[path] if given else draw.draw(rng)
        return Job(
            number=number,
            scenario=self.scenario,
            where=self.campaign.scenario,
            values=_located(drawn),
            seed=seed,
            figures=self.campaign.figures,
            labels={"case": name} if name else {},
        )

    def to_json(self) -> dict[str, Any]:
        """Everything that determines an episode, as JSON; enough to construct the same `Design`."""
        draws = [fields["robot"] for fields in self._sections.values() if "robot" in fields]
        robots = [self.scenario.get("robot"), *(value for d in draws for value in d.extremes)]
        content = {**self._content, "robots": robot_files(robots)}
        return json.loads(json.dumps(content, default=str))

    @property
    def _sections(self) -> dict[str, dict[str, Draw]]:
        """Fields that differ between episodes, by the section of the file that names them."""
        tune = self.campaign.tune
        cases = {f"cases: {name!r}": draws for name, draws in self.campaign.cases.items()}
        tuned = {} if tune is None else tune.fields
        return {"vary": self.campaign.vary, "tune: fields": tuned, **cases}

    def _spread(self, path: str, values: Mapping[str, Any]) -> list[str]:
        """Paths that one with `[*]` stands for, beside other values."""
        return spread(with_fields(self.scenario, values), path) if "[*]" in path else [path]

    def _point(self, index: int) -> tuple[dict[str, Any], str]:
        """The point of the grid of an episode, the last field changes first, and its case."""
        point: dict[str, Any] = {}
        for path, values in reversed(self._grids.items()):
            index, place = divmod(index, len(values))
            point[path] = values[place]
        cases = [*self.campaign.cases]
        return point, cases[index % len(cases)] if cases else ""

    def _check(self) -> None:
        """Try every value that can be counted, and some of every range, once."""
        make_scenario(self.scenario, self.campaign.scenario)
        for section, draws in self._sections.items():
            beside: dict[str, Any] = {}
            for path, draw in draws.items():
                if path in _OWN:
                    raise ConfigurationError(
                        f"{self._where}: {section} names a field that cannot be varied", got=path
                    )
                for value in draw.samples:
                    own = dict.fromkeys(self._spread(path, beside), value)
                    self._try({**beside, **own}, f"{section}: {path!r}")
                    if section.startswith("cases"):
                        beside |= own
        if self.campaign.tune is not None:
            self._try(self.campaign.tune.start, "tune: start")

    def _try(self, values: Mapping[str, Any], place: str) -> None:
        try:
            make_scenario(with_fields(self.scenario, values), self.campaign.scenario)
        except PoiseError as error:
            raise error.located(f"{self._where}: {place}") from None


def robot_files(robots: Iterable[Any]) -> dict[str, str]:
    """A digest of the files of each robot that comes from one, by its path."""
    files = {Path(r).resolve() for r in robots if isinstance(r, str) and Path(r).is_file()}
    return {str(file): files_digest(file) for file in sorted(files)}


def _located(content: Mapping[str, Any]) -> dict[str, Any]:
    """Content with the robot's file, where it names one, for whatever folder a worker is in."""
    robot = content.get("robot")
    if isinstance(robot, str) and Path(robot).is_file():
        return {**content, "robot": str(Path(robot).resolve())}
    return dict(content)
