"""Differences of two finished cells with so many resamples that the generator's luck moves no end, and rows of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

from inbounds.study import statistics
from inbounds.study.analysis import generator_for, marked, scores
from inbounds.study.outcomes import Outcome
from inbounds.study.second.primary import RESAMPLES
from inbounds.study.statistics import Estimate

Row = TypeVar("Row")


def difference_of(first: Outcome, second: Outcome, endpoint: str, *key: object) -> Estimate:
    """Return the first cell's mean minus the second's, with its 95 % interval and the count of diverged seeds.

    Args:
        first: a finished cell.
        second: another.
        endpoint: final or area.
        *key: names the generator of the resamples.

    Example:
        >>> from inbounds.study import StudyFolder, select
        >>> from inbounds.study.outcomes import Outcomes
        >>> cells = select(["standard-ant-ppo-beta", "standard-ant-ppo-gaussian"])
        >>> gaussian, beta = Outcomes.read(StudyFolder(), cells).finished.values()  # in the project's folder
        >>> bool(difference_of(beta, gaussian, "final", "an example").low > 0)
        True
    """
    found = statistics.difference(
        scores(first, endpoint),
        scores(second, endpoint),
        generator_for(*key),
        statistic="mean",
        resamples=RESAMPLES,
        missing="exclude",
    )
    return marked(found, first, second)


def of(rows: Sequence[Row], **which: Any) -> list[Row]:
    """Return the rows with certain values.

    Args:
        rows: of differences.
        **which: name of a field and its value, such as `algorithm="ppo"`.

    Example:
        >>> of([], algorithm="ppo")
        []
    """
    return [row for row in rows if all(getattr(row, name) == value for name, value in which.items())]
