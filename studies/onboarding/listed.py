"""`LISTED`: the public humanoid models that the study tries, with the peculiarity of each."""

import csv
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Listed:
    """One model of the list.

    Attributes:
        model: the robot, and the format of its file.
        repository: on GitHub, as `OWNER/NAME`.
        path: of the file in the repository.
        kind: the peculiarity for which it is listed.
        licence: of the model.
    """

    model: str
    repository: str
    path: str
    kind: str
    licence: str

    @property
    def file(self) -> str:
        """Path below the folder with the models: `OWNER+NAME/PATH`."""
        return f"{self.repository.replace('/', '+')}/{self.path}"


with Path(__file__).with_suffix(".csv").open(encoding="utf-8", newline="") as _table:
    LISTED = tuple(Listed(**row) for row in csv.DictReader(_table))
"""Fixed: a model that fails stays in it."""
