"""The first study's comparisons of two families, as a forest: what its protocol finds, and what of it is fragile.

The protocol corrects each comparison over the six robots, with 5 000 resamples an interval. What is printed has
100 000, so that the generator's luck does not move an end across 0 (`results/HISTORY.md` has the date and what
changed), and a finding that Holm's correction over *all* tests of an arm and endpoint would not make is called fragile.

    rows = compared(study_pages.shipped(), "standard")
    told(of(rows, contrast=Contrast("standard", "ppo", "beta", "gaussian"), endpoint="final"))
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inbounds.book.report import html
from inbounds.book.report.forests import SERIES, Bar, in_words, of_robots
from inbounds.book.report.html import Shown
from inbounds.book.report.rows import of as of
from inbounds.book.report.words import by_robot, graded, pair_name, title_of
from inbounds.study import analysis, statistics
from inbounds.study.analysis import CONTRASTS, Contrast
from inbounds.study.grid import ROBOTS
from inbounds.study.outcomes import Outcomes
from inbounds.study.second import MARGINS
from inbounds.study.second.yardsticks import ENDPOINTS
from inbounds.study.statistics import Comparison, Estimate
from inbounds.study.statistics.settings import SIGNIFICANCE
from inbounds.study.words import verdict


@dataclass(frozen=True)
class Compared:
    """A difference of two families on a robot, with its test.

    Made by `compared`, which has an example.
    """

    contrast: Contrast
    """What is compared."""
    endpoint: str
    """final or area."""
    robot: str
    """Where."""
    difference: Estimate
    """Of the means, 100 000 resamples."""
    protocols: Comparison
    """The protocol's own numbers."""
    p_over_all: float
    """After Holm's correction over all tests of the arm and endpoint."""

    @property
    def word(self) -> str:
        """higher, lower, not after Holm or unresolved."""
        return verdict(Comparison(self.difference, self.protocols.p_value, self.protocols.p_adjusted))

    @property
    def found(self) -> bool:
        """Whether the interval leaves out 0 and the protocol's corrected test agrees."""
        return self.word in ("higher", "lower")

    @property
    def fragile(self) -> bool:
        """Whether it is found, and would not be if all tests of the arm and endpoint were corrected together."""
        return self.found and not self.p_over_all < SIGNIFICANCE

    @property
    def changed(self) -> bool:
        """Whether the protocol's own interval gives another word."""
        return self.word != verdict(self.protocols)


def compared(outcomes: Outcomes, arm: str, endpoints: Sequence[str] = tuple(ENDPOINTS)) -> list[Compared]:
    """Return all differences of an arm whose cells are finished, in the protocol's order.

    Args:
        outcomes: of the first study.
        arm: standard, printed or beyond.
        endpoints: which.

    Example:
        >>> from inbounds.study import StudyFolder, select
        >>> cells = select(["standard-ant-ppo-beta", "standard-ant-ppo-gaussian"])
        >>> (row,) = compared(Outcomes.read(StudyFolder(), cells), "standard", ["final"])  # in the project's folder
        >>> row.robot, row.word
        ('Ant', 'higher')
    """
    contrasts = [each for each in CONTRASTS if each.arm == arm]
    rows = []
    for endpoint in endpoints:
        planned = {c: analysis.differences(outcomes, c, endpoint, as_planned=True) for c in contrasts}
        printed = {c: analysis.differences(outcomes, c, endpoint) for c in contrasts}
        places = [(c, robot) for c in contrasts for robot in ROBOTS]
        together = statistics.holm([planned[c][robot].p_value for c, robot in places])
        for (contrast, robot), p in zip(places, together, strict=True):
            if (gap := printed[contrast][robot].difference) is not None:
                rows.append(Compared(contrast, endpoint, robot, gap, planned[contrast][robot], float(p)))
    return rows


def told(rows: Sequence[Compared]) -> str:
    """Return on which robots the first family is found above the second, and below; fragile findings have a dagger.

    Example:
        >>> told([])
        'not run yet'
    """
    return by_robot(
        [(f"{row.robot}{'†' if row.fragile else ''}", graded(row.word, row.difference)) for row in rows]
    )


def comparisons(rows: Sequence[Compared], arm: str, algorithm: str) -> Shown:
    """Return a forest of an arm's differences under an algorithm: a panel an endpoint.

    Args:
        rows: of `compared`.
        arm: standard, printed or beyond.
        algorithm: ppo or trpo.
    """
    what = f"differences, {title_of(arm, algorithm)}"
    here = [row for row in rows if (row.contrast.arm, row.contrast.algorithm) == (arm, algorithm)]
    if not here:
        return html.of_study(what, html.NONE_FINISHED)
    panels = {name: [_bar(row) for row in of(here, endpoint=e)] for e, name in ENDPOINTS.items()}
    alt = f"Differences with 95 percent intervals ({title_of(arm, algorithm)}). {in_words(panels)}"
    caption = (
        f"{title_of(arm, algorithm)}. Bars: 95 % bootstrap intervals of a difference of means, ten seeds a side. "
        "Filled: found after Holm's correction over the robots; hollow: not. Grey: too small to choose by, a fifth of "
        "what training adds."
    )
    return html.of_study(
        what, html.figure_of(of_robots(panels), alt, caption), *_missing(arm, algorithm, here)
    )


def _bar(row: Compared) -> Bar:
    first, second = row.contrast.first, row.contrast.second
    name = first if second == "gaussian" else f"{first}, {second}"
    assert name in SERIES
    return Bar(row.robot, name, row.difference, MARGINS[row.endpoint][row.robot], hollow=not row.found)


def _missing(arm: str, algorithm: str, rows: Sequence[Compared]) -> list[str]:
    """Return one strip that names the robots and pairs that are not finished, and one for the fragile findings."""
    lacking = []
    for contrast in [c for c in CONTRASTS if (c.arm, c.algorithm) == (arm, algorithm)]:
        there = {row.robot for row in rows if row.contrast == contrast}
        if robots := [robot for robot in ROBOTS if robot not in there]:
            lacking.append(f"{pair_name(contrast)}: {', '.join(robots)}")
    strips = [html.missing(f"Not finished. {'; '.join(lacking)}.")] if lacking else []
    fragile = [
        f"{row.robot}, {pair_name(row.contrast)}, {ENDPOINTS[row.endpoint]}" for row in rows if row.fragile
    ]
    if fragile:
        strips.append(
            html.missing(
                f"Fragile, not found if all of the arm's tests are corrected together: {'; '.join(fragile)}."
            )
        )
    return strips


def changed_words(rows: Sequence[Compared]) -> list[str]:
    """Return each verdict that more resamples change.

    Example:
        >>> changed_words([])
        []
    """
    return [
        f"{title_of(row.contrast.arm, row.contrast.algorithm)}, {pair_name(row.contrast)}, {row.robot}, "
        f"{ENDPOINTS[row.endpoint]}: {verdict(row.protocols)} → {row.word}"
        for row in rows
        if row.changed
    ]


def worst_end(rows: Sequence[Compared]) -> float:
    """Return how far more resamples move an interval's end, at most, as a share of the interval's width.

    Example:
        >>> worst_end([])
        0.0
    """
    moves = [0.0]
    for row in rows:
        before = row.protocols.difference
        assert before is not None
        width = float(row.difference.high - row.difference.low)
        moves += [
            abs(float(np.subtract(*ends))) / width
            for ends in ((row.difference.low, before.low), (row.difference.high, before.high))
        ]
    return max(moves)
