"""The papers' own experiments: each study gives findings, tables and figures beside the paper's."""

from poise.studies.figure import Figure, draw
from poise.studies.finding import Finding
from poise.studies.plan import Part, Progress, StudyOptions, StudyPlan
from poise.studies.registry import STUDIES, load_study
from poise.studies.section import Section, Table
from poise.studies.study import Study, Unfinished
from poise.studies.write import write_study

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
