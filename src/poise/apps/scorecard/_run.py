"""`make_card`: all trials of a plan, bisected side by side, to a card.

`replay_job`: one of its episodes again.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from poise.apps.campaigns import CampaignFolder, Job, LocalWorkers, Row, Runner, Workers
from poise.apps.scenarios import Progress
from poise.apps.scorecard._bisection import Bisection
from poise.apps.scorecard._card import Card, CaseResult, Limit, SeedResult, TrialResult
from poise.apps.scorecard._episode import run_trial
from poise.apps.scorecard._intervals import Estimate, median_of, share_of
from poise.apps.scorecard._plan import FULL, NAME, QUICK, Case, Plan
from poise.apps.scorecard._trials import TRIALS, Trial
from poise.errors import ConfigurationError


@dataclass
class _Search:
    """The looks at one case with one seed.

    Attributes:
        case: what is tried.
        seed: of its episodes.
        looks: where it looks.
        rows: of its episodes.
    """

    case: Case
    seed: int
    looks: Bisection
    rows: list[Row] = field(default_factory=list[Row])


def make_card(
    plan: Plan,
    folder: Path,
    workers: Workers | None = None,
    progress: Progress | None = None,
    function: Callable[[Job], Row] = run_trial,
) -> Card:
    """Makes the card of a plan; episodes that its folder has already are not run again.

    The first seed of every case is searched without a guess; the others begin at the edge that it
    found, which most of them only confirm. A round has the next look of all searches at once, so
    that many workers have something to do.
    """
    cases, left_out = plan.cases()
    searches = [search for case in cases for search in _searches(plan, case)]
    rows = CampaignFolder(folder)
    tried = {case.trial.name for case in cases}

    def tell(*_: float) -> None:
        # What another run has left in the folder of trials that this one does not ask for.
        others = sum(row["trial_name"] not in tried for row in rows.rows.values())
        done = len(rows.rows) - others
        if progress is not None:
            expected = sum(search.looks.expected for search in searches)
            progress(float(done), float(max(done, expected)))

    with (
        rows.claimed(plan.content),
        workers or LocalWorkers() as crew,
    ):
        runner = Runner(crew, rows, progress=tell, function=function)
        easiest = [plan.job(case, 0, 0, 0.0) for case in _one_a_scene(cases)]
        for guessed in (False, True):
            own = [s for s in searches if (s.looks.guess is not None) == guessed]
            while asked := [(s, level) for s in own if (level := _level(s)) is not None]:
                jobs = [plan.job(s.case, s.seed, s.looks.done, level) for s, level in asked]
                if any(job.number not in rows.rows for job in jobs):
                    runner.warm_up(easiest)
                for (search, _), row in zip(asked, runner.run(jobs), strict=True):
                    search.rows.append(row)
                    search.looks.tell(bool(row.get("survived")))
        tell()
    return plan.card(_results(searches), left_out)


def replay_job(folder: CampaignFolder, number: int) -> Job:
    """The job of an episode that a card's folder has a row of."""
    about = folder.content()["campaign"]
    if about.get("name") != NAME:
        raise ConfigurationError("no scorecard in this folder", got=str(folder.path))
    row = folder.row(number)
    plan = Plan(
        robot=about["robot"],
        controller=about["controller"],
        strategy=about["strategy"],
        extent=QUICK if about["quick"] else FULL,
    )
    trial = next(trial for trial in TRIALS if trial.name == row["trial_name"])
    case = plan.spread(trial)[row["case"]]
    return plan.job(case, row["seed"], row["look"], row["level"])


def _searches(plan: Plan, case: Case) -> list[_Search]:
    """A search a seed; where something is bisected, the others' guess is the first one's edge."""
    looks = 1 if case.trial.share else plan.extent.looks
    searches: list[_Search] = []
    for seed in plan.seeds(case.trial):
        guess = searches[0].looks if searches and not case.trial.share else None
        searches.append(_Search(case, seed, Bisection(looks, guess)))
    return searches


def _one_a_scene(cases: Sequence[Case]) -> list[Case]:
    """What is compiled for: the easy end of a case can be begun, others need not."""
    return list({case.trial.scene: case for case in reversed(cases)}.values())


def _level(search: _Search) -> float | None:
    """Where a search looks next; trials that count seeds look once, wherever."""
    if search.case.trial.share:
        return 0.0 if search.looks.done == 0 else None
    return search.looks.level


def _results(searches: Sequence[_Search]) -> list[TrialResult]:
    results: list[TrialResult] = []
    for trial in TRIALS:
        own = [search for search in searches if search.case.trial is trial]
        cases = list(dict.fromkeys(search.case.index for search in own))
        if own:
            results.append(
                TrialResult(
                    name=trial.name,
                    title=trial.title,
                    unit=trial.unit,
                    easy=trial.easy,
                    hard=trial.hard,
                    cases=tuple(
                        _result(trial, [s for s in own if s.case.index == i]) for i in cases
                    ),
                )
            )
    return results


def _result(trial: Trial, searches: Sequence[_Search]) -> CaseResult:
    case = searches[0].case
    levels = [search.looks.held or 0.0 for search in searches]
    if trial.share:
        held = [search.looks.held is not None for search in searches]
        found = share_of(sum(held), len(held))
        amounts, level, limit = [float(h) for h in held], found.value, ""
    else:
        at = median_of(levels)
        found = _in_amounts(trial, at)
        amounts, level = [trial.amount(x) for x in levels], at.value
        limit = _limit_of_median(searches)
    worst = _nearest_failure(searches)
    return CaseResult(
        angle=None if case.angle is None else round(math.degrees(case.angle), 6),
        phase=case.phase,
        median=found.value,
        low=found.low,
        high=found.high,
        confidence=found.confidence,
        level=level,
        limit=limit,
        seeds=tuple(
            SeedResult(amount=amount, limit="" if trial.share else _limit(search))
            for amount, search in zip(amounts, searches, strict=True)
        ),
        episode=None if worst is None else worst["number"],
        mechanism="" if worst is None else worst.get("mechanism") or worst.get("reason") or "",
    )


def _in_amounts(trial: Trial, at: Estimate) -> Estimate:
    ends = sorted((trial.amount(at.low), trial.amount(at.high)))
    return Estimate(
        value=trial.amount(at.value), low=ends[0], high=ends[1], confidence=at.confidence
    )


def _limit(search: _Search) -> Limit:
    if search.looks.held is None:
        return "none"
    return "at least" if search.looks.failed is None else ""


def _limit_of_median(searches: Sequence[_Search]) -> Limit:
    """Whether the median is at an end: where it would be without the seeds beyond that end."""
    limits = [_limit(search) for search in searches]
    for limit in ("none", "at least"):
        if 2 * limits.count(limit) > len(limits):
            return limit
    return ""


def _nearest_failure(searches: Sequence[_Search]) -> Row | None:
    """The failed episode at the easiest level."""
    failed = [row for search in searches for row in search.rows if not row.get("survived")]
    return min(failed, key=lambda row: (row["level"], row["number"]), default=None)
