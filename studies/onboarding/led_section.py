"""Each model under the bad operator: as described, and under all conditions at once."""

import warnings
from dataclasses import dataclass
from pathlib import Path

from poise.errors import PoiseError
from studies.bad_operator.conditions import DESCRIBED, MIXED
from studies.bad_operator.falls_asked import FALL_EVERY, falls_finding, minutes
from studies.bad_operator.led_trial import Outcome, Trial, run_trial
from studies.finding import Section, Table
from studies.onboarding.model_files import all_models, models_folder
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

_CONDITIONS = (DESCRIBED, MIXED)

_SECONDS = (60.0, 10.0)
"""Of a trial, in the study and in its quick version [s]."""


@dataclass(frozen=True, kw_only=True)
class Led:
    """What became of a model that was to be led.

    Attributes:
        trial: which.
        outcome: None where it was not led.
        words: why not.
    """

    trial: Trial
    outcome: Outcome | None
    words: str = ""

    def row(self, folder: Path) -> tuple[str | int | float | None, ...]:
        """As the table has it.

        Args:
            folder: with the models.
        """
        file, led = str(Path(self.trial.robot).relative_to(folder)), self.outcome
        if led is None:
            return (file, self.trial.condition, None, None, None, None, self.words)
        fell = "fell" if led.fell else "stood"
        return (file, self.trial.condition, fell, led.seconds, led.steps, led.tilt, self.words)


def lead(trial: Trial) -> Led:
    """Runs a trial on a robot by its file; one that cannot be led says why."""
    with warnings.catch_warnings():
        # What was guessed of the robot, which the other part says.
        warnings.simplefilter("ignore")
        try:
            return Led(trial=trial, outcome=run_trial(trial))
        except PoiseError as error:
            return Led(trial=trial, outcome=None, words=str(error))


def led_section(options: StudyOptions, progress: Progress) -> Section:
    """The table of all models, and how often those fell that can be led."""
    folder = models_folder(options)
    first, seconds = options.first_seed, _SECONDS[options.quick]
    trials = [
        Trial(robot=str(path), level="torque", condition=condition, seed=first + k, seconds=seconds)
        for path in all_models(folder)
        for condition in _CONDITIONS
        for k in range(options.count(1, 1))
    ]
    found = list(run_each(lead, Led, trials, progress, options).values())
    groups = {
        condition: [
            led.outcome for led in found if led.outcome and led.trial.condition == condition
        ]
        for condition in _CONDITIONS
    }
    return Section(
        prose=(
            f"{seconds:.0f} s a seed, from seed {first}, by torques. As described sensors have "
            "noise, load cells 2 N of it whatever the robot weighs, and the attitude is off by "
            "half a degree. One fall in ten minutes is allowed, as it is of G1.",
        ),
        findings=tuple(
            falls_finding(f"models led {condition}", group, minutes(group) / FALL_EVERY)
            for condition, group in groups.items()
        ),
        tables=(
            Table(
                title="Models under the bad operator",
                header="model | condition | outcome | after [s] | feet lifted | "
                "lean, greatest [rad] | words",
                rows=tuple(led.row(folder) for led in found),
            ),
        ),
    )
