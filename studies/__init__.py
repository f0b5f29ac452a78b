"""The papers' own experiments: each study gives findings, tables and figures beside the paper's."""

from studies.figure import Figure, draw
from studies.finding import Finding, Section, Table
from studies.page import write_study
from studies.plan import Part, Progress, StudyOptions, StudyPlan
from studies.registry import STUDIES, load_study
from studies.study import Study, Unfinished

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
