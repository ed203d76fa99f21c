"""A dial: a task of our own whose knobs say where the best action lies, what an action costs, how many there are."""

from inbounds.study.dial.cells import DialCell, dial_cells
from inbounds.study.dial.outcomes import DialOutcomes
from inbounds.study.dial.running import DialFolder, run_cell, run_cells
from inbounds.study.dial.task import DialEnv, DialTask
from inbounds.study.dial.theory import predicted_curve

__all__ = [
    "DialCell",
    "DialEnv",
    "DialFolder",
    "DialOutcomes",
    "DialTask",
    "dial_cells",
    "predicted_curve",
    "run_cell",
    "run_cells",
]
