"""The analysis that `results/PROTOCOL.md` fixed before the first run, number by number.

    outcomes = Outcomes.read(StudyFolder())
    differences(outcomes, CONTRASTS[0], "final")["Hopper"]

What is missing stays missing: a function of cells that are not all finished returns None in their place. A seed that
diverged counts with its last return, `Estimate.diverged` says how many do, and `without_diverged=True` repeats
everything without them. Means and their differences have the intervals of `statistics.printed`, everything else a
random generator of its own, seeded by its name.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from inbounds.study import statistics
from inbounds.study.cell import ROBOTS, STUDY_VERSION
from inbounds.study.outcomes import Column, Floats, Outcome, Outcomes
from inbounds.study.statistics import Comparison, Estimate, Profile
from inbounds.study.statistics.intervals import StatisticName
from inbounds.study.statistics.seeds import countable
from inbounds.study.statistics.settings import LAST_EVALUATIONS

ENDPOINTS: Mapping[str, str] = MappingProxyType(
    {"final": "final return", "area": "area under the learning curve", "greedy": "greedy return"}
)
"""Name → what it is called; the first two are primary."""


class Contrast(NamedTuple):
    """First minus second, within an algorithm and an arm.

    Example:
        >>> Contrast("standard", "ppo", "beta", "gaussian").columns[0].family
        'beta'
    """

    arm: str
    algorithm: str
    first: str
    second: str

    @property
    def columns(self) -> tuple[Column, Column]:
        """The two columns."""
        first, second = (Column.within(self.arm, self.algorithm, f) for f in (self.first, self.second))
        return first, second


_PLAN: Sequence[tuple[str, str, Sequence[tuple[str, str]]]] = [
    ("standard", "ppo", [("logit-normal", "gaussian"), ("beta", "gaussian"), ("logit-normal", "beta")]),
    ("standard", "trpo", [("logit-normal", "gaussian")]),
    ("printed", "ppo", [("logit-normal", "gaussian"), ("beta", "gaussian"), ("logit-normal", "beta")]),
    ("printed", "trpo", [("logit-normal", "gaussian")]),
    ("beyond", "ppo", [("clipped-gaussian", "gaussian"), ("logit-normal", "clipped-gaussian")]),
    ("beyond", "trpo", [("clipped-gaussian", "gaussian"), ("logit-normal", "clipped-gaussian")]),
    ("beyond", "trpo", [("beta", "gaussian"), ("logit-normal", "beta")]),
]
CONTRASTS = tuple(Contrast(arm, algorithm, *pair) for arm, algorithm, pairs in _PLAN for pair in pairs)
"""The differences of the protocol's table, in its order."""

REFERENCE = Column("standard", "ppo", "gaussian")
"""Whose first epoch is 0 and whose final return is 1 in normalised scores."""


def generator_for(*name: object, version: int = STUDY_VERSION) -> np.random.Generator:
    """Return the generator of a number, by what the number is called and the version of its study.

    Example:
        >>> a, b = generator_for("final", "Hopper"), generator_for("final", "Hopper")
        >>> bool(a.random() == b.random())
        True
    """
    words = "|".join(map(str, ("study", version, *name)))
    return np.random.default_rng(int.from_bytes(hashlib.sha256(words.encode()).digest()[:16]))


def scores(outcome: Outcome, endpoint: str, *, without_diverged: bool = False) -> Floats:
    """Return an endpoint of each seed, `[S]`; NaN where it is missing.

    Args:
        outcome: of a cell.
        endpoint: a key of `ENDPOINTS`.
        without_diverged: count seeds that diverged as missing.

    Raises:
        ValueError: there is no such endpoint.

    Example:
        >>> from inbounds.study import StudyFolder, outcomes
        >>> study = outcomes.Outcomes.read(StudyFolder())  # in the project's folder
        >>> scores(study.finished["standard-hopper-ppo-beta"], "final").shape
        (10,)
    """
    if endpoint == "final":
        values = statistics.final_score(outcome.returns)
    elif endpoint == "area":
        values = statistics.area_under_curve(outcome.returns)
    elif endpoint == "greedy":
        values = outcome.greedy[:, -LAST_EVALUATIONS:].mean(-1)
    else:
        raise ValueError(f"no endpoint {endpoint!r}; choose one of {', '.join(ENDPOINTS)}")
    return np.where(outcome.diverged, np.nan, values) if without_diverged else values


def curve(outcome: Outcome) -> Estimate | None:
    """Return a cell's learning curve `[E]`: mean over seeds, with a band that holds at each epoch by itself.

    Example:
        >>> from inbounds.study import StudyFolder, outcomes
        >>> study = outcomes.Outcomes.read(StudyFolder())  # in the project's folder
        >>> band = curve(study.finished["standard-hopper-ppo-beta"])
        >>> band.value.shape, bool((band.low < band.high).all())
        ((500,), True)
    """
    if countable(outcome.returns[:, 0]) < 2:
        return None
    estimate = statistics.learning_curve(
        outcome.returns, generator_for("curve", outcome.cell.id), missing="exclude"
    )
    return marked(estimate, outcome)


def estimate(
    outcome: Outcome, endpoint: str, statistic: StatisticName = "mean", *, without_diverged: bool = False
) -> Estimate | None:
    """Return mean or IQM of an endpoint over the seeds of a cell; None where fewer than two seeds have one.

    Example:
        >>> from inbounds.study import StudyFolder, outcomes
        >>> study = outcomes.Outcomes.read(StudyFolder())  # in the project's folder
        >>> final = estimate(study.finished["standard-hopper-ppo-beta"], "final")
        >>> final.n, bool(final.low < final.value < final.high)
        (10, True)
    """
    values = scores(outcome, endpoint, without_diverged=without_diverged)
    if countable(values) < 2:
        return None
    found = statistics.mean_of(values, statistic=statistic, missing="exclude")
    return found if without_diverged else marked(found, outcome)


def by_way(outcome: Outcome) -> dict[str, Estimate | None]:
    """Return the mean return of a cell's final policies under each way to act; empty where they were not kept.

    Example:
        >>> from inbounds.study import StudyFolder, outcomes
        >>> study = outcomes.Outcomes.read(StudyFolder())  # in the project's folder
        >>> sorted(by_way(study.finished["standard-hopper-ppo-beta"]))
        ['mean', 'median', 'mode', 'sample']
    """
    found: dict[str, Estimate | None] = {}
    for way, values in outcome.ways.items():
        mean = statistics.mean_of(values, missing="exclude") if countable(values) >= 2 else None
        diverged = int((outcome.diverged & np.isfinite(values)).sum())  # those without a return are left out
        found[way] = mean and dataclasses.replace(mean, diverged=diverged)
    return found


def differences(
    outcomes: Outcomes,
    contrast: Contrast,
    endpoint: str,
    *,
    without_diverged: bool = False,
    as_planned: bool = False,
) -> dict[str, Comparison]:
    """Compare two columns robot by robot: difference of means, p-value, p-value after Holm over six robots.

    Args:
        outcomes: of the study.
        contrast: what is compared.
        endpoint: a key of `ENDPOINTS`.
        without_diverged: leave out seeds that diverged.
        as_planned: with the protocol's own intervals, of 5000 resamples; the p-values are the same.

    Returns:
        A comparison for each of the six robots; where a cell is missing, one without a difference.

    Example:
        >>> from inbounds.study import StudyFolder, analysis, outcomes
        >>> study = outcomes.Outcomes.read(StudyFolder())  # in the project's folder
        >>> row = differences(study, analysis.Contrast("standard", "ppo", "beta", "gaussian"), "final")["HalfCheetah"]
        >>> bool(row.difference.low > 0), row.p_adjusted < 0.05
        (True, True)
    """
    first, second = (_scores_by_robot(outcomes, c, endpoint, without_diverged) for c in contrast.columns)
    rng = generator_for("difference", *contrast, endpoint, without_diverged)
    planned = functools.partial(statistics.compare, statistic="mean", missing="exclude")
    compare = planned if as_planned else statistics.compared
    rows = compare(first, second, rng, environments=ROBOTS)
    for robot, row in rows.items():
        if row.difference is not None and not without_diverged:
            pair = [o for c in contrast.columns if (o := outcomes.find(c, robot)) is not None]
            rows[robot] = dataclasses.replace(row, difference=marked(row.difference, *pair))
    return rows


def change(outcomes: Outcomes, outcome: Outcome, endpoint: str) -> Estimate | None:
    """Return how far a cell of the fourth arm is from its cell of comparison, in means; None where that is missing.

    Example:
        >>> from inbounds.study import StudyFolder, outcomes
        >>> study = outcomes.Outcomes.read(StudyFolder())  # in the project's folder
        >>> plain = study.finished["standard-hopper-ppo-beta"]
        >>> change(study, plain, "final").value.item()  # of a cell from itself
        0.0
    """
    cell = outcome.cell
    plain = outcomes.find(Column(cell.arm, cell.algorithm, cell.family, cell.variant).baseline, cell.robot)
    if plain is None or min(countable(scores(o, endpoint)) for o in (outcome, plain)) < 2:
        return None
    return difference_of(outcome, plain, endpoint)


def difference_of(first: Outcome, second: Outcome, endpoint: str) -> Estimate:
    """Return the first cell's mean minus the second's, with its interval and the count of diverged seeds."""
    return marked(statistics.minus(scores(first, endpoint), scores(second, endpoint)), first, second)


def references(outcomes: Outcomes) -> dict[str, tuple[float, float]]:
    """Return by robot the returns that become 0 and 1; without the robots where that cell is missing.

    Where the second does not exceed the first, no score can be normalised: see `normalized`.

    Example:
        >>> from inbounds.study import StudyFolder, outcomes
        >>> study = outcomes.Outcomes.read(StudyFolder())  # in the project's folder
        >>> untrained, trained = references(study)["HalfCheetah"]
        >>> untrained < 0 < trained
        True
    """
    cells = {robot: outcomes.find(REFERENCE, robot) for robot in ROBOTS}
    return {
        robot: (float(np.nanmean(o.returns[:, 0])), float(np.nanmean(scores(o, "final"))))
        for robot, o in cells.items()
        if o is not None and np.isfinite(o.returns).any()
    }


def normalized(
    outcomes: Outcomes, column: Column, endpoint: str, *, without_diverged: bool = False
) -> dict[str, Floats] | None:
    """Return a column's normalised scores `[S]` by robot, None unless it is complete on all six.

    A robot whose references are not in order is left out, as the protocol says.

    Example:
        >>> from inbounds.study import StudyFolder, analysis, outcomes
        >>> study = outcomes.Outcomes.read(StudyFolder())  # in the project's folder
        >>> normalized(study, analysis.REFERENCE, "final")["Hopper"].mean().round(6).item()
        1.0
    """
    known = references(outcomes)
    raw = _scores_by_robot(outcomes, column, endpoint, without_diverged)
    if not (known.keys() >= set(ROBOTS) and raw.keys() >= set(ROBOTS)):
        return None
    return {
        robot: statistics.normalize_scores(raw[robot], *known[robot])
        for robot in ROBOTS
        if known[robot][1] > known[robot][0]
    }


def aggregate(
    outcomes: Outcomes, column: Column, endpoint: str, *, without_diverged: bool = False
) -> Estimate | None:
    """Return the IQM of a column's normalised scores over all robots, None unless it is complete.

    Example:
        >>> from inbounds.study import StudyFolder, outcomes
        >>> study = outcomes.Outcomes.read(StudyFolder())  # in the project's folder
        >>> bool(aggregate(study, outcomes.Column("standard", "ppo", "beta"), "final").low > 1)
        True
    """
    found = normalized(outcomes, column, endpoint, without_diverged=without_diverged)
    if not found:
        return None
    rng = generator_for("aggregate", *column, endpoint, without_diverged)
    iqm = statistics.aggregate(found, rng, missing="exclude")
    return iqm if without_diverged else marked(iqm, *outcomes.of_column(column, found))


def improvement(
    outcomes: Outcomes, contrast: Contrast, endpoint: str, *, without_diverged: bool = False
) -> Estimate | None:
    """Return the probability of improvement of first over second, None unless both are complete on all six robots.

    Example:
        >>> from inbounds.study import StudyFolder, analysis, outcomes
        >>> study = outcomes.Outcomes.read(StudyFolder())  # in the project's folder
        >>> better = improvement(study, analysis.Contrast("standard", "ppo", "beta", "gaussian"), "final")
        >>> bool(better.low > 0.5)
        True
    """
    first, second = (
        _scores_by_robot(outcomes, column, endpoint, without_diverged) for column in contrast.columns
    )
    if not (first.keys() >= set(ROBOTS) and second.keys() >= set(ROBOTS)):
        return None
    rng = generator_for("improvement", *contrast, endpoint, without_diverged)
    better = statistics.probability_of_improvement(first, second, rng, missing="exclude")
    both = [outcome for column in contrast.columns for outcome in outcomes.of_column(column, ROBOTS)]
    return better if without_diverged else marked(better, *both)


def profile(outcomes: Outcomes, column: Column, endpoint: str, thresholds: ArrayLike) -> Profile | None:
    """Return the performance profile of a column's normalised scores, None unless it is complete.

    Example:
        >>> from inbounds.study import StudyFolder, outcomes
        >>> study = outcomes.Outcomes.read(StudyFolder())  # in the project's folder
        >>> shares = profile(study, outcomes.Column("standard", "ppo", "beta"), "final", [0.0, 1.0]).share
        >>> bool(shares.value[0] > shares.value[1])
        True
    """
    found = normalized(outcomes, column, endpoint)
    if not found:
        return None
    whole = statistics.performance_profile(
        found, thresholds, generator_for("profile", *column, endpoint), missing="exclude"
    )
    return dataclasses.replace(whole, share=marked(whole.share, *outcomes.of_column(column, found)))


def _scores_by_robot(
    outcomes: Outcomes, column: Column, endpoint: str, without_diverged: bool
) -> dict[str, Floats]:
    """Return the robots on which a column is finished and at least two seeds count."""
    found = {}
    for robot in ROBOTS:
        if (outcome := outcomes.find(column, robot)) is not None:
            values = scores(outcome, endpoint, without_diverged=without_diverged)
            if countable(values) >= 2:
                found[robot] = values
    return found


def marked(estimate: Estimate, *outcomes: Outcome) -> Estimate:
    """Return an estimate that says how many of the seeds that count have diverged."""
    diverged = sum(int((o.diverged & np.isfinite(o.returns).all(1)).sum()) for o in outcomes)
    return dataclasses.replace(estimate, diverged=diverged)
