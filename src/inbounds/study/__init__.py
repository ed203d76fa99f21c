"""The experiment: a declarative grid of cells, run and resumed on one machine or many, stored, verified."""

from inbounds.study.grid import ARMS, STUDY_VERSION, Cell, all_cells, select, study_cells
from inbounds.study.running.attempts import Settings
from inbounds.study.running.many_cells import run_study
from inbounds.study.running.one_cell import StudyError, run_cell
from inbounds.study.running.verify import verify
from inbounds.study.store import StudyFolder, read_cell

__all__ = [
    "ARMS",
    "STUDY_VERSION",
    "Cell",
    "Settings",
    "StudyError",
    "StudyFolder",
    "all_cells",
    "read_cell",
    "run_cell",
    "run_study",
    "select",
    "study_cells",
    "verify",
]
