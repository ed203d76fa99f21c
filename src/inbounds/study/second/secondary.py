"""The secondary comparisons of the second study: σ free or of the state, a quiet start, TRPO, other noise, other steps.

Holm's correction is over the robots of one comparison and endpoint; beside it stands the same over every test of this
page. Nothing here is called confirmed or refuted: a verdict word is the robots' own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from inbounds.study import statistics
from inbounds.study.analysis import scores
from inbounds.study.cell import ROBOTS
from inbounds.study.grid import COMPARED, FREE
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.second.primary import gap
from inbounds.study.second.yardsticks import ENDPOINTS, MARGINS
from inbounds.study.statistics import Comparison, Equivalence
from inbounds.study.statistics.settings import SIGNIFICANCE

_GAUSSIAN, _FREE = ("gaussian", ""), ("gaussian", FREE)
_BETA, _LOGIT, _LOGIT_FREE = ("beta", ""), ("logit-normal", ""), ("logit-normal", FREE)


@dataclass(frozen=True)
class Pair:
    """Two columns that are compared on some robots: first minus second.

    Example:
        >>> PAIRS["law, σ of the state"][0]
        Pair(first=Column(arm='equal', algorithm='ppo', family='logit-normal', variant=''), \
second=Column(arm='equal', algorithm='ppo', family='gaussian', variant=''), robots=('HalfCheetah', 'Hopper', \
'Swimmer', 'Walker2d', 'Ant', 'Humanoid'))
    """

    first: Column
    """A column of the second study."""
    second: Column
    """What it is compared with."""
    robots: tuple[str, ...] = ROBOTS
    """On which both are planned."""


def _equal(algorithm: str, *pairs: tuple[tuple[str, str], tuple[str, str]]) -> tuple[Pair, ...]:
    return tuple(
        Pair(Column("equal", algorithm, *first), Column("equal", algorithm, *second))
        for first, second in pairs
    )


def _within(arm: str, variants: tuple[str, ...], robots: tuple[str, ...]) -> tuple[Pair, ...]:
    return tuple(
        Pair(Column(arm, "ppo", family, variant), Column(arm, "ppo", "gaussian", variant), robots)
        for variant in variants
        for family in ("logit-normal", "beta")
    )


PAIRS: Mapping[str, tuple[Pair, ...]] = MappingProxyType(
    {
        "law, σ of the state": _equal("ppo", (_LOGIT, _GAUSSIAN), (_BETA, _GAUSSIAN)),
        "law, σ free": _equal("ppo", (_LOGIT_FREE, _FREE)),
        "σ free or of the state": _equal("ppo", (_FREE, _GAUSSIAN), (_LOGIT_FREE, _LOGIT)),
        "the bounded laws": _equal("ppo", (_LOGIT, _BETA)),
        "TRPO": _equal(
            "trpo", (_LOGIT, _FREE), (_BETA, _FREE), (_LOGIT, _GAUSSIAN), (_BETA, _GAUSSIAN), (_LOGIT, _BETA)
        ),
        "a quiet start": (
            Pair(Column("equal", "ppo", *_FREE), Column("as-they-come", "ppo", *_FREE)),
            Pair(Column("equal", "ppo", *_GAUSSIAN), Column("as-they-come", "ppo", *_FREE)),
        ),
        "other noise": _within("noise", ("noise-0.2", "noise-0.55"), ("HalfCheetah", "Hopper", "Ant")),
        "other step sizes": _within("steps", ("rate-0.0001", "rate-0.001"), ("HalfCheetah", "Hopper")),
    }
)
"""By what they ask, in the protocol's order."""


@dataclass(frozen=True)
class SecondaryRow:
    """One secondary test.

    Made by `secondary`, which has an example.
    """

    question: str
    """A key of `PAIRS`."""
    pair: Pair
    """What is compared."""
    endpoint: str
    """final or area."""
    robot: str
    """Where."""
    comparison: Comparison
    """Difference, p-value, p-value after Holm over the pair's robots."""
    p_over_everything: float
    """The same after Holm over every secondary test."""


def compared(outcomes: Outcomes, pair: Pair, endpoint: str) -> dict[str, Comparison]:
    """Return the tests of one pair, robot by robot, with Holm's correction over them.

    Args:
        outcomes: of the second study, as far as it has come.
        pair: what is compared.
        endpoint: final or area.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study import StudyFolder
        >>> nothing = Outcomes.read(StudyFolder(Path("no/results")))
        >>> compared(nothing, PAIRS["other step sizes"][0], "final")["Hopper"].difference is None
        True
    """
    gaps = [gap(outcomes, pair.first, pair.second, robot, endpoint) for robot in pair.robots]
    adjusted = statistics.holm([each.p_value for each in gaps])
    return {
        robot: Comparison(each.difference, each.p_value, float(p))
        for robot, each, p in zip(pair.robots, gaps, adjusted, strict=True)
    }


def secondary(outcomes: Outcomes) -> list[SecondaryRow]:
    """Return every secondary test, those of missing cells included.

    Args:
        outcomes: of the second study, as far as it has come.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study import StudyFolder
        >>> rows = secondary(Outcomes.read(StudyFolder(Path("no/results"))))
        >>> len(rows), {row.comparison.difference for row in rows}
        (196, {None})
    """
    found = [
        (question, pair, endpoint, robot, comparison)
        for question, pairs in PAIRS.items()
        for pair in pairs
        for endpoint in ENDPOINTS
        for robot, comparison in compared(outcomes, pair, endpoint).items()
    ]
    everything = statistics.holm([comparison.p_value for *_, comparison in found])
    return [SecondaryRow(*row, float(over)) for row, over in zip(found, everything, strict=True)]


def starts(outcomes: Outcomes, column: Column, robot: str) -> dict[str, float] | None:
    """Return what a column does before training, mean over its seeds: the check that the start is equal.

    Args:
        outcomes: of the second study.
        column: of it.
        robot: where.

    Returns:
        `action_std` (standard deviation of the executed actions, in units of half the range), `saturation` (share of
        executed components at a bound) and `return` of the first epoch; None where the cell is missing.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study import StudyFolder
        >>> nothing = Outcomes.read(StudyFolder(Path("no/results")))
        >>> starts(nothing, Column("equal", "ppo", "beta"), "Hopper") is None
        True
    """
    outcome = outcomes.find(column, robot)
    if outcome is None:
        return None
    first = {name: float(outcome.measured[name][:, 0].mean()) for name in ("action_std", "saturation")}
    return first | {"return": float(np.nanmean(outcome.returns[:, 0]))}


TWINS = tuple(
    (Column("equal", "ppo", family), Column("mechanisms", "ppo", family, "matched-noise"), robot)
    for family in COMPARED
    for robot in ("HalfCheetah", "Hopper")
)
"""Cells of both studies that differ by engine and seeds alone."""


def engines_agree(outcomes: Outcomes, level: float = SIGNIFICANCE) -> dict[tuple[str, str, str], Equivalence]:
    """Test whether the compiled engine's returns are those of autograd, by cells that both studies have.

    Two one-sided tests (`inbounds.study.statistics.equivalence`) within `MARGINS`, ten seeds a side.

    Args:
        outcomes: of both studies.
        level: of each test; at half of it the interval is that of 95 %.

    Returns:
        By family, robot and endpoint; without those whose cells are missing.

    Example:
        >>> from pathlib import Path
        >>> from inbounds.study import StudyFolder
        >>> engines_agree(Outcomes.read(StudyFolder(Path("no/results"))))
        {}
    """
    found = {}
    for ours, theirs, robot in TWINS:
        compiled, autograd = outcomes.find(ours, robot), outcomes.find(theirs, robot)
        if compiled is None or autograd is None:
            continue
        for endpoint in ENDPOINTS:
            found[ours.family, robot, endpoint] = statistics.equivalence(
                scores(compiled, endpoint),
                scores(autograd, endpoint),
                MARGINS[endpoint][robot],
                level=level,
                missing="exclude",
            )
    return found
