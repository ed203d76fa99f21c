"""What each detail costs that the source thesis leaves out: the study's fourth arm, a table that fills as cells finish.

::

    from inbounds.book.ppo_details import what_details_cost

    what_details_cost("../results")

A cell that has not been run says so. The table's plain text is the same whatever is there, so that a stored notebook
stays a faithful record while the study goes on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from inbounds.book.drawing.figures import LOOKS
from inbounds.book.templates import macros
from inbounds.study import StudyFolder, analysis
from inbounds.study.grid import ARMS
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.statistics import Estimate

__all__ = ["DETAILS", "CostTable", "what_details_cost"]

DETAILS: Mapping[str, str] = MappingProxyType(
    {
        "printed-clip": "clip range 0.02",
        "printed-observations": "observations not normalised",
        "printed-advantages": "advantages not normalised",
        "printed-gradients": "gradients not clipped",
        "printed-weights": "PyTorch's initial weights",
        "entropy-0": "no entropy bonus",
        "entropy-0.001": "entropy coefficient 1e-3",
        "entropy-0.01": "entropy coefficient 1e-2",
    }
)
"""Variant of the study → what is changed in the preset `common`, and nothing else."""

NOT_RUN, NOT_PLANNED = "not yet run", "–"


@dataclass(frozen=True)
class CostTable:
    """Changes of the final return, by detail, robot and family; a notebook shows it as a table."""

    families: Sequence[str]
    """The columns."""
    rows: Mapping[tuple[str, str], Sequence[str]]
    """Detail, in words, and robot → a cell for each family."""

    def __repr__(self) -> str:
        return f"<table: {len(self.rows)} rows of detail and robot, {len(self.families)} families>"

    def _repr_html_(self) -> str:
        html = macros("details")
        if all(cell in (NOT_RUN, NOT_PLANNED) for cells in self.rows.values() for cell in cells):
            return str(html.not_run(dict.fromkeys(detail for detail, _ in self.rows)))
        return str(html.table([LOOKS[family].label for family in self.families], self.rows))


def what_details_cost(results: str | Path | Outcomes) -> CostTable:
    """Return the table of `DETAILS`, on the robots and families on which the study varies them.

    Args:
        results: the study's folder of results, or what has been read from it.

    Example:
        >>> table = what_details_cost("no/results")
        >>> table
        <table: 16 rows of detail and robot, 3 families>
        >>> table.rows["clip range 0.02", "Hopper"]
        ['not yet run', '–', 'not yet run']
    """
    planned = [cell for cell in ARMS["mechanisms"] if cell.variant in DETAILS]
    if not isinstance(results, Outcomes):
        compared = {(cell.algorithm, cell.family, cell.robot) for cell in planned}
        plain = [c for c in ARMS["standard"] if (c.algorithm, c.family, c.robot) in compared]
        results = Outcomes.read(StudyFolder(Path(results)), [*planned, *plain])
    families = [family for family in LOOKS if any(cell.family == family for cell in planned)]
    rows = {
        (words, robot): [_cell(results, variant, robot, family) for family in families]
        for variant, words in DETAILS.items()
        for robot in dict.fromkeys(cell.robot for cell in planned)
    }
    return CostTable(families, rows)


def _cell(outcomes: Outcomes, variant: str, robot: str, family: str) -> str:
    plan = ((c.variant, c.robot, c.family) for c in ARMS["mechanisms"])
    if (variant, robot, family) not in plan:
        return NOT_PLANNED
    outcome = outcomes.find(Column("mechanisms", "ppo", family, variant), robot)
    change = analysis.change(outcomes, outcome, "final") if outcome else None
    return spoken(change) if change else NOT_RUN


def spoken(change: Estimate) -> str:
    """Say a change with its interval.

    Example:
        >>> import numpy as np
        >>> spoken(Estimate(np.array(-12.4), np.array(-30.6), np.array(5.0), 10, 0, 0.95, "difference"))
        '−12 [−31, 5]'
    """
    value, low, high = (f"{float(x):.0f}".replace("-", "−") for x in (change.value, change.low, change.high))
    diverged = f", {change.diverged} diverged" if change.diverged else ""
    return f"{value} [{low}, {high}]{diverged}"
