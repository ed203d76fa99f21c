"""The primary comparison: under PPO, from equal noise, does a bounded law end higher than a Gaussian with a free σ?

Two laws × two endpoints × six robots are 24 tests, one family for Holm. A verdict is given where all twenty seeds of
both sides are there; before that a row has its estimate and no verdict.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Literal

import numpy as np

from inbounds.study import statistics
from inbounds.study.analysis import generator_for, marked
from inbounds.study.cell import ROBOTS, SECOND_VERSION
from inbounds.study.grid import FREE
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.second.pooled import is_whole, pooled, pooled_scores
from inbounds.study.second.yardsticks import ENDPOINTS, MARGINS
from inbounds.study.statistics import Estimate
from inbounds.study.statistics.settings import SIGNIFICANCE

RESAMPLES = 100_000
PERMUTATIONS = 99_999
BOUNDED = ("logit-normal", "beta")
"""The laws that are compared with the Gaussian."""
GAUSSIAN = Column("equal", "ppo", "gaussian", FREE)

Finding = Literal["confirmed", "contradicted", "refuted", "undecided", ""]


@dataclass(frozen=True)
class Gap:
    """First minus second on one robot and endpoint; None and NaN where a cell is missing.

    Made by `gap`.
    """

    difference: Estimate | None
    """Of the means."""
    p_value: float
    """Of equal means, by `permutation_test`."""
    whole: bool
    """Whether all planned seeds of both sides are there."""


@dataclass(frozen=True)
class PrimaryRow:
    """One of the 24 tests.

    Made by `primary`, which has an example.
    """

    law: str
    """The bounded one."""
    endpoint: str
    """final or area."""
    robot: str
    """A robot of `ROBOTS`."""
    difference: Estimate | None
    """Bounded law minus Gaussian with a free σ."""
    p_value: float
    """Of equal means; NaN while seeds are missing."""
    p_adjusted: float
    """The same after Holm's correction over all 24."""
    margin: float
    """Below which a difference does not matter."""
    whole: bool
    """Whether all planned seeds of both sides are there."""

    @property
    def finding(self) -> Finding:
        """What the protocol calls it; empty while seeds are missing."""
        if self.difference is None or not self.whole:
            return ""
        return finding(self.difference, self.p_adjusted, self.margin)


def finding(difference: Estimate, p_adjusted: float, margin: float) -> Finding:
    """Return what a difference says to the hypothesis that the first side ends higher.

    Args:
        difference: first minus second.
        p_adjusted: after the correction that the protocol names.
        margin: below which a difference does not matter.

    Returns:
        refuted: the whole interval lies within the margin. Else confirmed or contradicted: it is found after
        correction, in the direction expected or in the other. Else undecided.

    Example:
        >>> import numpy as np
        >>> gap = Estimate(np.array(5.0), np.array(2.0), np.array(8.0), 20, 0, 0.95, "mean")
        >>> finding(gap, 0.01, margin=3), finding(gap, 0.2, margin=3), finding(gap, 0.01, margin=9)
        ('confirmed', 'undecided', 'refuted')
    """
    if -margin < difference.low and difference.high < margin:
        return "refuted"
    if p_adjusted < SIGNIFICANCE:
        return "confirmed" if difference.value > 0 else "contradicted"
    return "undecided"


def gap(
    outcomes: Outcomes,
    first: Column,
    second: Column,
    robot: str,
    endpoint: str,
    *,
    without_diverged: bool = False,
) -> Gap:
    """Compare two columns on a robot, with all finished seeds of each.

    A test of which a seed is still to be run has an estimate and no p-value: in a correction it keeps its place, like
    one whose cells are missing.
    """
    whole = are_whole(outcomes, first, second, robot)
    place = (outcomes, first, second, robot, endpoint)
    estimate, p_value = _compared(*place, without_diverged=without_diverged, tested=whole)
    return Gap(estimate, p_value, whole)


def are_whole(outcomes: Outcomes, first: Column, second: Column, robot: str) -> bool:
    """Return whether all planned seeds of two columns on a robot are there."""
    return all(is_whole(outcomes, column, robot) for column in (first, second))


def pooled_difference(
    outcomes: Outcomes, first: Column, second: Column, robot: str, endpoint: str
) -> Estimate | None:
    """Return the difference of `gap` without its test, which takes most of the time; None where a cell is missing."""
    return _compared(outcomes, first, second, robot, endpoint, tested=False)[0]


def _compared(
    outcomes: Outcomes,
    first: Column,
    second: Column,
    robot: str,
    endpoint: str,
    *,
    without_diverged: bool = False,
    tested: bool,
) -> tuple[Estimate | None, float]:
    """Return a difference and its p-value; None where a cell is missing, NaN where it is not tested."""
    a, b = (
        pooled_scores(outcomes, column, robot, endpoint, without_diverged=without_diverged)
        for column in (first, second)
    )
    if a is None or b is None:
        return None, float("nan")
    name = (*first, *second, robot, endpoint, without_diverged)
    permutations = PERMUTATIONS if tested else 0
    estimate, p_value = _of_scores(tuple(a), tuple(b), name, RESAMPLES, permutations)
    if not without_diverged:
        cells = [cell for column in (first, second) for cell in pooled(outcomes, column, robot)]
        estimate = marked(estimate, *cells)
    return estimate, p_value


@functools.cache
def _of_scores(
    first: tuple[float, ...],
    second: tuple[float, ...],
    name: tuple[str | bool, ...],
    resamples: int,
    permutations: int,
) -> tuple[Estimate, float]:
    """Kept, for a page asks for most of them twice; the name decides what is drawn. No permutations, no p-value."""
    sides = np.array(first), np.array(second)
    rng = generator_for("gap", *name, version=SECOND_VERSION)
    estimate = statistics.difference(*sides, rng, statistic="mean", resamples=resamples, missing="exclude")
    if not permutations:
        return estimate, float("nan")
    return estimate, statistics.permutation_test(*sides, rng, permutations=permutations, missing="exclude")


def primary(outcomes: Outcomes, *, without_diverged: bool = False) -> list[PrimaryRow]:
    """Return the 24 rows of the primary comparison, in the order law, endpoint, robot.

    Args:
        outcomes: of the second study, as far as it has come.
        without_diverged: leave out seeds that diverged.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study import StudyFolder
        >>> rows = primary(Outcomes.read(StudyFolder(Path("no/results"))))
        >>> len(rows), {row.finding for row in rows}
        (24, {''})
    """
    places = [(law, endpoint, robot) for law in BOUNDED for endpoint in ENDPOINTS for robot in ROBOTS]
    gaps = [
        gap(outcomes, _column(law), GAUSSIAN, robot, endpoint, without_diverged=without_diverged)
        for law, endpoint, robot in places
    ]
    adjusted = statistics.holm([each.p_value for each in gaps])
    return [
        PrimaryRow(*place, each.difference, each.p_value, float(p), MARGINS[place[1]][place[2]], each.whole)
        for place, each, p in zip(places, gaps, adjusted, strict=True)
    ]


def _column(law: str) -> Column:
    return Column("equal", "ppo", law)
