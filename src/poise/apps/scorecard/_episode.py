"""`run_trial`: one run of a trial, and whether the robot survived it."""

from poise.apps.campaigns import Job, Row, row_of, run_episode
from poise.apps.scenarios import Run
from poise.apps.scorecard._mechanism import LEAN_MAX, lean, mechanism
from poise.control import CommandStatus


def survived(run: Run) -> bool:
    """Whether a robot came through.

    No fall, no divergence, no tick without an answer; it stands upright at the end, its walk has
    ended, and what its scene checks holds, which for standing is being at rest.
    """
    answered = all(status == CommandStatus.OK.value for status in run.signals.status)
    if run.fell or run.ended_early or not answered or lean(run) > LEAN_MAX:
        return False
    if run.scenario.walk is not None and run.signals.modes[-1][1] != "walk standing":
        return False
    own = run.checks[len(run.checks) - len(run.scenario.checks) :]
    return all(check.ok for check in own)


def run_trial(job: Job) -> Row:
    """Runs an episode of a trial: its row says `survived`, and if not, the `mechanism`."""
    return run_episode(job, _judged)


def _judged(job: Job, run: Run) -> Row:
    came_through = survived(run)
    why = "" if came_through else mechanism(run)
    return {**row_of(job, run), "survived": came_through, "mechanism": why}
