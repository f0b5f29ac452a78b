"""The papers' own experiments: each study gives findings, tables and figures beside the paper's."""

from studies.figure import Figure, draw
from studies.finding import Finding
from studies.plan import Part, Progress, StudyOptions, StudyPlan
from studies.registry import STUDIES, load_study
from studies.section import Section, Table
from studies.study import Study, Unfinished
from studies.write import write_study

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
