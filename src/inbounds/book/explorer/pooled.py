"""Curves and endpoints over all seeds of some cells: of one cell the study's numbers, of several those of the pool."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inbounds.study import statistics
from inbounds.study.analysis import curve, estimate, generator_for, marked, scores
from inbounds.study.outcomes import Outcome
from inbounds.study.statistics import Estimate


def pooled_curve(cells: Sequence[Outcome]) -> Estimate:
    """Return the learning curve of all seeds of some cells, `[E]`: of one cell that of `analysis.curve`.

    Raises:
        ValueError: fewer than two seeds count.

    Example:
        >>> from inbounds.study.outcomes import Outcomes
        >>> from inbounds.study.store import StudyFolder
        >>> cell = Outcomes.read(StudyFolder()).finished["standard-hopper-ppo-beta"]  # in the project's folder
        >>> pooled_curve([cell]).n, pooled_curve([cell, cell]).n
        (10, 20)
    """
    if len(cells) == 1 and (alone := curve(cells[0])) is not None:
        return alone
    returns = np.concatenate([cell.returns for cell in cells])
    key = ("curve", *(cell.cell.id for cell in cells))
    return marked(statistics.learning_curve(returns, generator_for(*key), missing="exclude"), *cells)


def pooled_estimate(cells: Sequence[Outcome], endpoint: str) -> Estimate | None:
    """Return the mean of an endpoint over all seeds of some cells: of one cell that of `analysis.estimate`.

    Example:
        >>> from inbounds.study.outcomes import Outcomes
        >>> from inbounds.study.store import StudyFolder
        >>> cell = Outcomes.read(StudyFolder()).finished["standard-hopper-ppo-beta"]  # in the project's folder
        >>> pooled_estimate([cell, cell], "final").n
        20
    """
    if len(cells) == 1:
        return estimate(cells[0], endpoint)
    values = np.concatenate([scores(cell, endpoint) for cell in cells])
    return marked(statistics.mean_of(values, missing="exclude"), *cells)


__all__ = ["pooled_curve", "pooled_estimate"]
