"""The second study over all robots at once: IQM of normalised scores, probability of improvement."""

from __future__ import annotations

from inbounds.study import statistics
from inbounds.study.analysis import generator_for, marked
from inbounds.study.cell import ROBOTS, SECOND_VERSION
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.second.pooled import pooled
from inbounds.study.second.primary import GAUSSIAN, RESAMPLES
from inbounds.study.second.yardsticks import normalized
from inbounds.study.statistics import Estimate


def aggregate(outcomes: Outcomes, column: Column, endpoint: str) -> Estimate | None:
    """Return the IQM of a column's scores, doing nothing at 0 and the first study's best at 1; None unless complete.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study import StudyFolder
        >>> nothing = Outcomes.read(StudyFolder(Path("no/results")))
        >>> aggregate(nothing, Column("equal", "ppo", "beta"), "final") is None
        True
    """
    found = normalized(outcomes, column, endpoint)
    if found is None:
        return None
    rng = generator_for("aggregate", *column, endpoint, version=SECOND_VERSION)
    iqm = statistics.aggregate(found, rng, resamples=RESAMPLES, missing="exclude")
    return marked(iqm, *(cell for robot in ROBOTS for cell in pooled(outcomes, column, robot)))


def improvement(outcomes: Outcomes, column: Column, endpoint: str) -> Estimate | None:
    """Return the probability that a run of a column beats one of the Gaussian with a free σ; None unless both complete.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study import StudyFolder
        >>> nothing = Outcomes.read(StudyFolder(Path("no/results")))
        >>> improvement(nothing, Column("equal", "ppo", "beta"), "final") is None
        True
    """
    first, second = (normalized(outcomes, each, endpoint) for each in (column, GAUSSIAN))
    if first is None or second is None:
        return None
    rng = generator_for("improvement", *column, endpoint, version=SECOND_VERSION)
    better = statistics.probability_of_improvement(first, second, rng, resamples=RESAMPLES, missing="exclude")
    cells = [cell for each in (column, GAUSSIAN) for r in ROBOTS for cell in pooled(outcomes, each, r)]
    return marked(better, *cells)
