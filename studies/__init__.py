"""The papers' own experiments: each study gives findings, tables and figures beside the paper's."""

from studies.finding import Figure, Finding, Section, Table, draw
from studies.page import write_study
from studies.plan import (
    STUDIES,
    Part,
    Progress,
    Study,
    StudyOptions,
    StudyPlan,
    Unfinished,
    load_study,
)

__all__ = [
    "STUDIES",
    "Figure",
    "Finding",
    "Part",
    "Progress",
    "Section",
    "Study",
    "StudyOptions",
    "StudyPlan",
    "Table",
    "Unfinished",
    "draw",
    "load_study",
    "write_study",
]
