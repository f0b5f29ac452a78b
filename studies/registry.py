"""The studies by name; a study's module is imported when it is asked for."""

from importlib import import_module

from poise.errors import UnknownNameError
from studies.plan import StudyPlan

_MODULES = {
    "bias-acceleration": "studies.bias_acceleration",
    "step-teleoperation": "studies.step_teleoperation",
    "reduced-dynamics": "studies.reduced_dynamics",
    "bad-operator": "studies.bad_operator",
}
"""Where each study's `PLAN` is."""

STUDIES = tuple(_MODULES)
"""Names of the studies."""


def load_study(name: str) -> StudyPlan:
    """The plan of a study.

    Args:
        name: one of `STUDIES`.

    Raises:
        UnknownNameError: there is no such study.
    """
    if name not in _MODULES:
        raise UnknownNameError("unknown study", got=name, choices=STUDIES)
    return import_module(_MODULES[name]).PLAN
