"""Means over seeds with their intervals, as the chapters on the study write them beside the protocol's tables.

A mean and a difference of means have the interval of `inbounds.study.statistics.printed`, on every page the same.

    mean_of(scores(outcome, "final"))
    minus(scores(first, "final"), scores(second, "final"))
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from inbounds.book.drawing import figures
from inbounds.learning import TrainedPolicy
from inbounds.study.outcomes import Outcome, Outcomes
from inbounds.study.statistics import bootstrap, mean_of, minus
from inbounds.study.statistics.settings import CURVE_RESAMPLES

__all__ = ["draw", "final_policies", "mean_of", "minus"]


def draw(ax: Any, family: str, values: ArrayLike, x: ArrayLike | None = None, **changed: Any) -> None:
    """Draw a mean over seeds with its 95 % band, in a family's look.

    Args:
        ax: where to.
        family: whose look.
        values: `[S, K]`.
        x: `[K]`; None is where the study measures, the first epoch and every tenth.
        **changed: of the look, as `matplotlib.axes.Axes.plot` takes it.

    Example:
        >>> import matplotlib.pyplot as plt
        >>> fig, ax = plt.subplots()
        >>> draw(ax, "beta", np.random.default_rng(0).normal(size=(10, 3)), [1, 2, 3])
        >>> len(ax.lines), len(ax.collections)
        (1, 1)
        >>> plt.close(fig)
    """
    values = np.asarray(values, np.float64)
    places = np.array([1, *range(10, 10 * values.shape[1], 10)]) if x is None else np.asarray(x)
    found = bootstrap(values, np.random.default_rng(0), statistic="mean", resamples=CURVE_RESAMPLES)
    look = figures.family_style(family) | changed
    ax.fill_between(places, found.low, found.high, alpha=0.18, color=look["color"])
    ax.plot(places, found.value, **look)


def final_policies(outcomes: Outcomes, outcome: Outcome) -> list[TrainedPolicy]:
    """Load the final policies of all seeds of a cell.

    Args:
        outcomes: where the cell was found.
        outcome: of the cell.

    Raises:
        FileNotFoundError: the cell is of an arm that keeps no policies.

    Example:
        >>> from inbounds.study import StudyFolder
        >>> outcomes = Outcomes.read(StudyFolder())  # in the project's folder
        >>> policies = final_policies(outcomes, outcomes.finished["standard-hopper-ppo-beta"])
        >>> [policy.seed for policy in policies] == list(range(10))
        True
    """
    cell = outcome.cell
    if not cell.keeps_policies:
        raise FileNotFoundError(f"{cell.id}: arm {cell.arm} keeps no policies, only curves and measurements")
    return outcomes.folder.load_policies(cell)
