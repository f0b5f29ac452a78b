"""`tune`: fields of a scenario tuned by Optuna, over the same runner as any campaign."""

import json
import math
import warnings
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from poise.apps.campaigns._campaign import Campaign, Design, Draw, TunePlan
from poise.apps.campaigns._episode import RAN, Job, Row
from poise.errors import PoiseError, import_extra

_STORAGE = "tuning.sqlite"
_PLOTS = {
    "history": "plot_optimization_history",
    "slices": "plot_slice",
    "importances": "plot_param_importances",
}


def tune(
    design: Design, plan: TunePlan, run: Callable[[Sequence[Job]], list[Row]], folder: Path
) -> list[Row]:
    """Tune the fields that a campaign names.

    Trials are chosen a batch at a time. Each is chosen by a sampler with a seed of its own, so that
    a tuning goes on after an interruption as if there had been none.
    """
    rows: list[Row] = []
    with _stored(folder):
        study = _study(design.campaign, plan, folder)
        for begin in range(0, plan.trials, plan.batch):
            numbers = range(begin, min(begin + plan.batch, plan.trials))
            values = [_chosen(study, n, plan, design.campaign.seed) for n in numbers]
            jobs = [design.trial(n, v) for n, v in zip(numbers, values, strict=True)]
            found = run([job for trial in jobs for job in trial])
            for place, number in enumerate(numbers):
                own = found[place * plan.episodes : (place + 1) * plan.episodes]
                study.tell(number, cost(own, plan), skip_if_finished=True)
            rows += found
        _draw(study, folder)
    return rows


def cost(rows: list[Row], plan: TunePlan) -> float:
    """The worth of a trial: the mean of its episodes' figures."""
    values = [row.get(plan.figure) if row["outcome"] in RAN else None for row in rows]
    return float(np.mean([plan.failure if value is None else value for value in values]))


def best_trial(campaign: Campaign, plan: TunePlan, folder: Path) -> dict[str, Any] | None:
    """The best trial so far: its number, its value, and the values of its fields."""
    with _stored(folder):
        study = _study(campaign, plan, folder)
        if not _finished(study):
            return None
        trial = study.best_trial
    fields = {path: _value(plan.fields[path], trial.params[path]) for path in plan.fields}
    return {"trial": trial.number, plan.figure: trial.value, "fields": fields}


def _optuna() -> Any:
    optuna = import_extra("optuna", "campaign", "tuning")
    # Of each trial there is a line in the results already.
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    return optuna


@contextmanager
def _stored(folder: Path) -> Generator[None]:
    """Errors of Optuna, and of the SQLAlchemy below it, in one line."""
    failures = _optuna().exceptions.OptunaError, import_module("sqlalchemy.exc").SQLAlchemyError
    try:
        yield
    except failures as error:
        reason = " ".join(str(error).split())
        place = str(folder / _STORAGE)
        raise PoiseError(f"Optuna's storage failed ({reason})", got=place) from None


def _study(campaign: Campaign, plan: TunePlan, folder: Path) -> Any:
    """The study in its storage; begun with the trial that the campaign asks for first."""
    study = _optuna().create_study(
        storage=f"sqlite:///{folder / _STORAGE}",
        study_name=campaign.name,
        direction=plan.goal.replace("ise", "ize"),
        load_if_exists=True,
    )
    if plan.start and not study.trials:
        study.enqueue_trial({p: _label(value) for p, value in plan.start.items()})
    return study


def _chosen(study: Any, number: int, plan: TunePlan, seed: int) -> dict[str, Any]:
    """Values of the fields in a trial: those that were chosen earlier, where it was."""
    optuna = _optuna()
    own_seed = int(np.random.SeedSequence([seed, number]).generate_state(1)[0])
    study.sampler = optuna.samplers.TPESampler(seed=own_seed)
    begun = [t for t in study.trials if t.state != optuna.trial.TrialState.WAITING]
    # A frozen trial can choose no value that is missing, and nothing public makes a live one of it.
    trial = (
        optuna.trial.Trial(study, begun[number]._trial_id) if number < len(begun) else study.ask()
    )
    return {path: _value(draw, _suggested(trial, path, draw)) for path, draw in plan.fields.items()}


def _suggested(trial: Any, path: str, draw: Draw) -> Any:
    if draw.choice is not None:
        return trial.suggest_categorical(path, [_label(value) for value in draw.choice])
    low, high = draw.extremes
    return trial.suggest_float(path, low, high, log=draw.log_uniform is not None)


def _label(value: Any) -> Any:
    """Optuna's name of a choice: it takes no lists."""
    return value if isinstance(value, str | int | float) else json.dumps(value)


def _value(draw: Draw, label: Any) -> Any:
    if draw.choice is None:
        return label
    return next(value for value in draw.choice if _label(value) == label)


def _finished(study: Any) -> list[Any]:
    return [t for t in study.trials if t.value is not None and math.isfinite(t.value)]


def _draw(study: Any, folder: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    plots = import_module("optuna.visualization.matplotlib")
    if len(_finished(study)) < 2:
        return
    for name, function in _PLOTS.items():
        with warnings.catch_warnings(), mpl.rc_context():
            # That the function may change with a version of Optuna.
            warnings.simplefilter("ignore")
            figure = np.ravel(getattr(plots, function)(study))[0].figure
            figure.savefig(folder / f"tuning-{name}.svg", bbox_inches="tight")
            plt.close(figure)
