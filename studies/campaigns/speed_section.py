"""Rates of one and of two workers, turn by turn, and the time to the first result."""

import subprocess
import sys
import time
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from poise.apps.campaigns import LocalWorkers, run_campaign
from studies.campaigns.campaign_files import recorded, write_campaign
from studies.finding import Finding, Section, Table
from studies.plan import Progress, Steps, StudyOptions

_ROUNDS, _QUICK_ROUNDS = 5, 2

_EPISODES, _QUICK_EPISODES = 30, 12
"""Of one worker in a round; two get twice as many, so that both take as long."""

_SPEED_UP = 1.8
"""Two workers do at least so many times the episodes of one."""

_FIRST = 10.0
"""The first result is there after this long at most, when everything is compiled [s]."""


def speed_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    rounds = _QUICK_ROUNDS if options.quick else _ROUNDS
    episodes = _QUICK_EPISODES if options.quick else _EPISODES
    steps = Steps(progress, 3 * rounds)
    with TemporaryDirectory() as place:
        rates: list[tuple[float, float]] = []
        firsts: list[float] = []
        for turn in range(rounds):
            folder = Path(place) / str(turn)
            folder.mkdir()
            steps.next()
            firsts.append(_first_result(folder))
            steps.next()
            one = _rate(folder, 1, episodes)
            steps.next()
            rates.append((one, _rate(folder, 2, 2 * episodes)))
    steps.finish()
    speed_up = median(two / one for one, two in rates)
    first = median(firsts)
    return Section(
        prose=(
            f"{rounds} rounds: `poise campaign` until its first result, then {episodes} episodes "
            f"by one worker and {2 * episodes} by two. Rates count from when every worker has had "
            "its first episode, and end when the last one is recorded.",
        ),
        findings=(
            Finding(
                name="episodes of two workers over those of one",
                paper=_SPEED_UP,
                ours=round(speed_up, 3),
                ok=speed_up >= _SPEED_UP,
                note="asked: at least so many; median of the rounds. Other work on the machine "
                "costs two workers more than one",
            ),
            Finding(
                name="time to the first result",
                paper=_FIRST,
                ours=round(first, 2),
                unit="s",
                ok=first <= _FIRST,
                note="asked: at most; of the whole command, on code that was compiled before",
            ),
        ),
        tables=(
            Table(
                title="Rounds",
                header="one worker [1/s] | two workers [1/s] | ratio | first result [s]",
                rows=tuple(
                    (one, two, two / one, first)
                    for (one, two), first in zip(rates, firsts, strict=True)
                ),
            ),
        ),
    )


def _rate(folder: Path, workers: int, episodes: int) -> float:
    """Episodes a second."""
    file = write_campaign(folder / f"rate{workers}.yaml", "stand.yaml", episodes=episodes)
    times: list[float] = []
    run_campaign(
        file,
        folder / f"by-{workers}",
        LocalWorkers(workers),
        lambda *_: times.append(time.perf_counter()),
    )
    # The first time is that of no result; then each worker has one episode that includes its start.
    return (episodes - workers) / (times[-1] - times[workers])


def _first_result(folder: Path) -> float:
    """Seconds from the command to the first result on the disk."""
    file = write_campaign(folder / "first.yaml", "stand.yaml", episodes=1)
    command = [sys.executable, "-m", "poise.cli.main", "campaign", str(file), "--workers", "2"]
    begin = time.perf_counter()
    with subprocess.Popen(
        [*command, "--out", str(folder / "first")], stdout=subprocess.DEVNULL
    ) as parent:
        while not recorded(folder / "first") and parent.poll() is None:
            time.sleep(0.02)
        return time.perf_counter() - begin
