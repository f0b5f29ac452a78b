"""`poise campaign` and `poise scorecard`: many episodes to a table, or to a robot's limits."""

import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from json import dumps
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, arg

from poise._progress import Bar
from poise.cli._command import FAILED, OK, Output
from poise.cli._run import replay
from poise.errors import ConfigurationError, import_extra


@dataclass(frozen=True, kw_only=True)
class _Episodes(Output):
    """Options of verbs that run many episodes.

    Attributes:
        workers: how many processes (one a core by default), or jobs, where --slurm wants a number.
        scheduler: address of a Dask cluster, as in tcp://10.0.0.1:8786.
        slurm: submit --workers jobs to Slurm; sbatch reads its options from SBATCH_PARTITION,
            SBATCH_TIMELIMIT, ...
    """

    workers: int | None = None
    scheduler: Annotated[str | None, arg(metavar="ADDRESS")] = None
    slurm: bool = False

    def run(self, run: Any, work: Any, folder: Path) -> Any:
        """Result of all episodes; None where they are interrupted."""
        try:
            with Bar("episodes", " episodes", lines=not self.json) as bar:
                return run(work, folder, self._workers(), bar)
        except KeyboardInterrupt:
            print("interrupted; the same command goes on from here", file=sys.stderr)
            return None

    def _workers(self) -> Any:
        from poise.apps import campaigns

        if self.scheduler is not None:
            if self.slurm or self.workers is not None:
                what = "a cluster has its own number of workers"
                raise ConfigurationError(what, got=self.workers, wanted="no --workers, no --slurm")
            return campaigns.DaskWorkers(self.scheduler)
        if self.slurm:
            if self.workers is None:
                raise ConfigurationError("--slurm asks for so many jobs", wanted="--workers N")
            return campaigns.SlurmWorkers(self.workers)
        return campaigns.LocalWorkers(self.workers)


@dataclass(frozen=True, kw_only=True)
class CampaignVerb(_Episodes):
    """Run all episodes of a campaign's file, one row each of a Parquet dataset in DIR/episodes.

    `poise campaign FILE` runs them over processes of this machine or a cluster, into
    runs/campaign-FILE; the same command goes on with a campaign that was interrupted.

    `poise campaign status FOLDER` prints how far one is.

    `poise campaign replay FOLDER NUMBER` runs an episode again, with report and video, into
    FOLDER/replays/NUMBER.

    Exit status: 0 every episode has a result, 1 interrupted, or a replay has other figures, 2 bad
    input.

    example: poise campaign examples/pushes.yaml --workers 8

    Attributes:
        words: a campaign's YAML file, or the words of another form above.
        no_video: leave out the video of a replay.
    """

    words: Annotated[Positional[tuple[str, ...]], arg(metavar="FILE")]
    no_video: bool = False

    def act(self) -> int:
        """Carry out one of the three forms."""
        match self.words:
            case ["status", folder]:
                return self._status(Path(folder))
            case ["replay", folder, number]:
                return self._replay(Path(folder), number)
            case [file]:
                # Before the simulator is missed, which is in a smaller extra.
                import_extra("pyarrow", "campaign", "A campaign")
                from poise.apps.campaigns import run_campaign

                folder = Path(self.out or f"runs/campaign-{Path(file).stem}")
                found = self.run(run_campaign, Path(file), folder)
                self._status(folder)
                return FAILED if found is None else OK
            case words:
                forms = "FILE, status FOLDER, or replay FOLDER NUMBER"
                raise ConfigurationError("no such form", got=" ".join(words), wanted=forms)

    def _status(self, path: Path) -> int:
        """Print the progress of a campaign, which may be running."""
        from poise.apps import campaigns

        folder = campaigns.CampaignFolder(path)
        design = campaigns.Design.of(folder)
        campaign, rows = design.campaign, folder.first(design.count)
        found = Counter(row["outcome"] for row in rows)
        status: dict[str, Any] = {
            "campaign": campaign.name,
            "episodes": design.count,
            "done": len(rows),
            "outcomes": {name: found[name] for name in campaigns.OUTCOMES if found[name]},
            "versions": sorted({row["version"] for row in rows}),
            **folder.pace(design.count),
        }
        if campaign.tune is not None:
            status["best"] = campaigns.best_trial(campaign, campaign.tune, path)
        if len(status["versions"]) > 1:
            print(f"versions of Poise: {', '.join(status['versions'])}", file=sys.stderr)
        head = f"{campaign.name}: {len(rows)} of {design.count} episodes in {path}"
        outcomes = [f"  {name:10}{count}" for name, count in status["outcomes"].items()]
        if status["running"]:
            left = "" if status["left_s"] is None else f", {status['left_s']:.0f} s left"
            outcomes.append(f"running: {status['rate_hz']:.2f} episodes/s{left}")
        if status.get("best"):
            outcomes.append(f"best: {dumps(status['best'])}")
        return self.show(status, head, *outcomes)

    def _replay(self, folder: Path, number: str) -> int:
        """Run one episode again, and compare it with its row."""
        from poise.apps import campaigns

        job, run, summary = replay(
            folder, number, campaigns.replay_job, self, video=not self.no_video
        )
        recorded = campaigns.CampaignFolder(folder).rows[job.number]
        differ = campaigns.differences(recorded, campaigns.row_of(job, run))
        same = f"the figures are those of episode {number}, outcome {recorded['outcome']}"
        self.show({**summary, "differs": differ}, *([] if differ else [same]))
        if differ:
            what = f"differs from what version {recorded['version']} recorded"
            print(f"{what}: {', '.join(differ)}", file=sys.stderr)
        return FAILED if differ else OK


@dataclass(frozen=True, kw_only=True)
class ScorecardVerb(_Episodes):
    """Put a robot with its controller to trials that get harder, and write a page with the figures.

    Trials are pushes, slopes, bumps, friction, payloads, errors of the model, slow motors, noise,
    delay, bad operators and speed. scorecard.html and scorecard.json lie in
    runs/scorecard-ROBOT-CONTROLLER, of a quick one with -quick behind, or in the folder of --out.
    The same command goes on with a card that was interrupted. Exit status: 0 the card is made, 1
    interrupted, 2 bad input.

    example: poise scorecard --robot g1 --controller whole_body --quick

    example: poise scorecard --compare runs/one runs/other

    Attributes:
        robot: a robot on two feet: a name that `poise robots` lists, or a file.
        controller: its controller: whole_body, reduced, osf, differential_ik, or
            step_teleoperation where an operator leads the robot's feet.
        strategy: how the controller solves, by default the first of its own: direct, cascade,
            weighted (whole_body, reduced); fused (osf); closed_form, hqp (differential_ik).
        quick: few seeds, directions and looks: minutes, not hours.
        trials: these alone (--list names all); another run in the same folder may add others.
        list: list the trials and stop.
        against: a card that the page shows beside the new one.
        compare: two cards, by their files or folders, in place of making one.
        replay: run an episode of a card again, by the number on its page, with report and video.
    """

    robot: str = "humanoid33"
    controller: str = "whole_body"
    strategy: str | None = None
    quick: bool = False
    trials: Annotated[str, arg(metavar="NAME,...")] = ""
    list: bool = False
    against: Annotated[str | None, arg(metavar="CARD")] = None
    compare: Annotated[tuple[str, str] | None, arg(metavar="A B")] = None
    replay: Annotated[tuple[str, str] | None, arg(metavar="FOLDER NUMBER")] = None

    def act(self) -> int:
        """Make a card, or look at cards that are there."""
        from poise.apps import scorecard

        if self.list:
            titles = {trial.name: trial.title for trial in scorecard.TRIALS}
            return self.show(titles, *map(_range_row, scorecard.TRIALS))
        if self.replay is not None:
            folder, number = self.replay
            *_, summary = replay(Path(folder), number, scorecard.replay_job, self, video=True)
            return self.show(summary)
        if self.compare is not None:
            first, second = (scorecard.read_card(Path(name)) for name in self.compare)
            figures = [
                {**asdict(d), "trial": d.trial.name, "verdict": d.verdict}
                for d in scorecard.compare(first, second)
            ]
            page = scorecard.write_page(first, Path(self.out or "runs/scorecard-compare"), second)
            return self.show(figures, *_difference_rows(first, second), f"page: {page}")
        return self._make()

    def _make(self) -> int:
        from poise.apps import scorecard

        other = None if self.against is None else scorecard.read_card(Path(self.against))
        plan = scorecard.Plan(
            robot=self.robot,
            controller=self.controller,
            strategy=self.strategy,
            extent=scorecard.QUICK if self.quick else scorecard.FULL,
            trials=tuple(name.strip() for name in self.trials.split(",") if name.strip()),
        )
        parts = (Path(plan.robot).stem, plan.controller, plan.strategy, "quick" * self.quick)
        folder = Path(self.out or "-".join(["runs/scorecard", *filter(None, parts)]))
        if other is not None:
            # Found before hours of work, not after.
            scorecard.compare(plan.card((), {}), other)
        card = self.run(scorecard.make_card, plan, folder)
        if card is None:
            return FAILED
        card.write(folder)
        page = scorecard.write_page(card, folder, other)
        beside = () if other is None else _difference_rows(card, other)
        return self.show(asdict(card), *_card_rows(card), *beside, f"page: {page}")


def _range_row(trial: Any) -> str:
    ends = f"{trial.easy:g} to {trial.hard:g} {trial.unit}".rstrip()
    return f"{trial.name:18}{trial.title:34}{ends}"


def _card_rows(card: Any) -> Iterator[str]:
    from poise.apps.scorecard import reasons_of, result_text

    yield f"{card.robot} with {card.title}"
    for trial in card.trials:
        for case in trial.cases:
            yield f"  {trial.named(case):44}{result_text(case, trial.unit)}"
    for reason, titles in reasons_of(card).items():
        yield f"left out: {', '.join(titles)}: {reason}"
    if card.worst is not None:
        trial, case = card.worst
        why = f": {case.mechanism}" if case.mechanism else ""
        yield f"worst: {trial.named(case)}{why}"


def _difference_rows(first: Any, second: Any) -> Iterator[str]:
    """Rows of both results of a case, and whether their intervals are apart."""
    from poise.apps.scorecard import VERDICTS, compare, result_text

    yield f"{first.robot}: {first.title} | {second.title}"
    for difference in compare(first, second):
        trial = difference.trial
        name = trial.named(difference.either)
        texts = [result_text(c, trial.unit) for c in (difference.first, difference.second)]
        verdict = VERDICTS[difference.verdict]
        yield f"  {name:44}{texts[0]:34}{texts[1]:34}{verdict}".rstrip()
