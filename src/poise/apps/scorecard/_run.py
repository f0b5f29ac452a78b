"""`make_card`: a campaign whose levels are bisected, trial by trial and seed by seed, to a card.

`replay_job`: one of its episodes again.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from poise.apps.campaigns import (
    CampaignFolder,
    Job,
    LocalWorkers,
    Row,
    Runner,
    Workers,
    row_of,
    run_episode,
)
from poise.apps.scenarios import Progress, Run, explain, missed_ticks, symptoms_of
from poise.apps.scorecard._bisection import Bisection
from poise.apps.scorecard._card import Card, CaseResult, Limit, SeedResult, TrialResult
from poise.apps.scorecard._plan import Case, Plan
from poise.apps.scorecard._trials import TRIALS, Trial


@dataclass
class _Search:
    """The looks at one case with one seed, and the rows of their episodes."""

    case: Case
    seed: int
    looks: Bisection
    rows: list[Row] = field(default_factory=list[Row])

    @property
    def limit(self) -> Limit:
        """The end of the range, if the search has reached one."""
        if self.case.trial.share:
            return ""
        if self.looks.held is None:
            return "none"
        return "at least" if self.looks.failed is None else ""


def make_card(
    plan: Plan,
    folder: Path,
    workers: Workers | None = None,
    progress: Progress | None = None,
    function: Callable[[Job], Row] | None = None,
) -> Card:
    """Make the card of a plan; episodes that its folder has already are not run again.

    The first seed of every case is searched without a guess; the others begin at the edge that it
    found, which most of them only confirm. A round has the next look of all searches at once, so
    that many workers have something to do.
    """
    cases, left_out = plan.cases()
    searches = [search for case in cases for search in _searches(plan, case)]
    rows = CampaignFolder(folder)
    tried = {case.trial.name for case in cases}
    # What compiles for all: the easy end of a trial of each scene, which fits its robot.
    one_a_scene = {case.trial.scene: plan.job(case, 0, 0, 0.0) for case in reversed(cases)}

    def tell() -> None:
        # Rows of trials that this run does not ask for are those of another one.
        done = sum(row["trial_name"] in tried for row in rows.rows.values())
        if progress is not None:
            progress(float(done), float(max(done, sum(s.looks.expected for s in searches))))

    with rows.claimed(plan.content), workers or LocalWorkers() as crew:
        runner = Runner(crew, rows, progress=tell, function=function or run_trial)
        for guessed in (False, True):
            own = [s for s in searches if (s.looks.guess is not None) == guessed]
            while asked := [(s, level) for s in own if (level := s.looks.level) is not None]:
                jobs = [plan.job(s.case, s.seed, s.looks.done, level) for s, level in asked]
                found = runner.run(jobs, begin_with=[*one_a_scene.values()])
                for (search, _), row in zip(asked, found, strict=True):
                    search.rows.append(row)
                    search.looks.tell(bool(row.get("survived")))
        tell()
    return plan.card([*_results(searches)], left_out)


def run_trial(job: Job) -> Row:
    """Run an episode: its row has `survived`, and if not, the `mechanism`."""
    return run_episode(job, _judged)


def _judged(job: Job, run: Run) -> Row:
    came_through = survived(run)
    why = "" if came_through else mechanism(run)
    return {**row_of(job, run), "survived": came_through, "mechanism": why}


def survived(run: Run) -> bool:
    """True for a robot that came through.

    No fall, no divergence, no tick without an answer; it stands upright at the end, its walk has
    ended, and what its scene checks holds, which for standing is being at rest.
    """
    return not (run.fell or run.ended_early or missed_ticks(run.signals) or _end(run))


def mechanism(run: Run) -> str:
    """The first events of a run that was not survived, and its end."""
    begun = explain(symptoms_of(run.signals, run.robot, run.scenario), run.signals.time)
    end = run.ended_early or _end(run) or "it went on to the end"
    return "; then ".join(filter(None, (begun, end)))


def lean(run: Run) -> float:
    """Angle of the base's vertical at the end of a run from that at home [rad]."""
    home, now = (
        pin.Quaternion(q[3:7]).toRotationMatrix()[:, 2]
        for q in (run.robot.q_home, run.signals.q[-1])
    )
    return float(np.arccos(np.clip(home @ now, -1.0, 1.0)))


def _end(run: Run) -> str:
    """The state at the end that is no survival, or ""."""
    # Upright is a base that leans no further than this from its home attitude [rad].
    if lean(run) > 0.5:
        return f"it leaned by {lean(run):.2f} rad at the end"
    if run.scenario.walk is not None and run.signals.modes[-1][1] != "walk standing":
        return f"the walk was not finished ({run.signals.modes[-1][1]})"
    own = run.checks[len(run.checks) - len(run.scenario.checks) :]
    return "; ".join(f"at the end {c.name} was {c.value:.2g} {c.unit}" for c in own if not c.ok)


def replay_job(folder: CampaignFolder, number: int) -> Job:
    """The job of an episode that a card's folder has a row of."""
    plan, row = Plan.of(folder), folder.row(number)
    trial = next(trial for trial in TRIALS if trial.name == row["trial_name"])
    return plan.job(plan.spread(trial)[row["case"]], row["seed"], row["look"], row["level"])


def _searches(plan: Plan, case: Case) -> list[_Search]:
    """A search a seed; where levels are bisected, the others' guess is the first one's edge."""
    if case.trial.share:
        # The only look of each is at the hard end.
        return [_Search(case, seed, Bisection(1)) for seed in plan.seeds(case.trial)]
    first, *others = plan.seeds(case.trial)
    begun = Bisection(plan.extent.looks)
    guessing = [_Search(case, seed, Bisection(begun.looks, begun)) for seed in others]
    return [_Search(case, first, begun), *guessing]


def _results(searches: Sequence[_Search]) -> Iterator[TrialResult]:
    for trial, own in groupby(searches, key=lambda search: search.case.trial):
        cases = groupby(own, key=lambda search: search.case.index)
        yield TrialResult(
            name=trial.name,
            title=trial.title,
            unit=trial.unit,
            easy=trial.easy,
            hard=trial.hard,
            cases=tuple(_result(trial, [*same]) for _, same in cases),
        )


class Estimate(NamedTuple):
    """A figure, its interval, and the probability that such an interval holds the true figure."""

    value: float
    low: float
    high: float
    confidence: float


def median_of(values: Sequence[float], confidence: float = 0.95) -> Estimate:
    """The median, with the interval between two order statistics.

    The r-th smallest and the r-th largest of n values hold the median between them with probability
    1 - 2 P(B < r), B binomial with n and 1/2 (David and Nagaraja, Order Statistics, 2003, 7.1). r
    is the largest for which that is `confidence` or more; 1 where few values give less.
    """
    from scipy.stats import binom  # takes a second, which commands without episodes do without

    found, n = sorted(values), len(values)
    held = {r: max(0.0, 1.0 - 2.0 * float(binom.cdf(r - 1, n, 0.5))) for r in range(1, n // 2 + 1)}
    rank = max((r for r, probability in held.items() if probability >= confidence), default=1)
    middle = 0.5 * (found[(n - 1) // 2] + found[n // 2])
    return Estimate(middle, found[rank - 1], found[n - rank], held.get(rank, 0.0))


def share_of(count: int, of: int, confidence: float = 0.95) -> Estimate:
    """A share, with Wilson's interval (Wilson 1927, J. Am. Stat. Assoc. 22)."""
    from scipy.stats import binomtest

    interval = binomtest(count, of).proportion_ci(confidence, method="wilson")
    return Estimate(count / of, float(interval.low), float(interval.high), confidence)


def _result(trial: Trial, searches: Sequence[_Search]) -> CaseResult:
    case = searches[0].case
    levels = [search.looks.held or 0.0 for search in searches]
    if trial.share:
        amounts = [float(search.looks.held is not None) for search in searches]
        found = share_of(int(sum(amounts)), len(amounts))
        level = found.value
    else:
        at = median_of(levels)
        amounts, level = [trial.amount(x) for x in levels], at.value
        low, high = sorted((trial.amount(at.low), trial.amount(at.high)))
        found = Estimate(trial.amount(at.value), low, high, at.confidence)
    limits: list[Limit] = [search.limit for search in searches]
    common: list[Limit] = [limit for limit in limits if 2 * limits.count(limit) > len(limits)]
    failed = [row for search in searches for row in search.rows if not row.get("survived")]
    # The nearest to the largest survived.
    worst: Row = min(failed, key=lambda row: (row["level"], row["number"]), default={})
    return CaseResult(
        angle=None if case.angle is None else round(math.degrees(case.angle), 6),
        phase=case.phase,
        median=found.value,
        low=found.low,
        high=found.high,
        confidence=found.confidence,
        level=level,
        # Where the median would be without the seeds beyond an end.
        limit=common[0] if common else "",
        seeds=tuple(
            SeedResult(amount=amount, limit=limit)
            for amount, limit in zip(amounts, limits, strict=True)
        ),
        episode=worst.get("number"),
        mechanism=worst.get("mechanism") or worst.get("reason") or "",
    )
