"""The second study's secondary tests: their table, and what one of them finds, in words.

Nothing here is confirmed or refuted (`results/PROTOCOL-2.md`).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from inbounds.book.report import html
from inbounds.book.report.equal_start import with_second
from inbounds.book.report.html import NONE_FINISHED, Shown
from inbounds.book.report.words import HEADS, WAITS, by_robot, column_name, graded
from inbounds.study.outcomes import Outcomes
from inbounds.study.second import PAIRS, Pair, SecondaryRow, compared, pooled_difference, secondary
from inbounds.study.statistics import Comparison, Estimate
from inbounds.study.words import p_value, spoken, verdict


def comparisons(outcomes: Outcomes) -> Shown:
    """Return the secondary tests whose cells are finished, as a table."""
    rows = [
        [
            _named(row.pair),
            row.robot,
            HEADS[row.endpoint],
            spoken(row.comparison.difference),
            _verdict(row.comparison),
            p_value(row.comparison.p_adjusted),
            p_value(row.p_over_everything),
            row.question,
        ]
        for row in secondary(with_second(outcomes))
        if row.comparison.difference is not None
    ]
    if not rows:
        return html.of_study("the secondary comparisons", NONE_FINISHED)
    head = [
        "difference",
        "robot",
        "endpoint",
        "estimate",
        "verdict",
        "p, Holm over robots",
        "over everything",
        "question",
    ]
    caption = "Secondary comparisons of the second study: differences of means; nothing here is confirmed or refuted."
    return html.of_study("the secondary comparisons", html.table(caption, head, rows, words=(0, 1, 2, 4, 7)))


def _named(pair: Pair) -> str:
    """Return what is compared, as a difference; the start is said of both sides where they differ in it."""
    quiet = ", quiet start" if pair.first.arm != pair.second.arm else ""
    first = f"{column_name(pair.first)}{quiet}"
    return f"{pair.first.algorithm.upper()}: {first} − {column_name(pair.second)}"


def verdicts(outcomes: Outcomes, question: str, family: str, endpoint: str = "final") -> str:
    """Return on which robots a secondary comparison finds its first side above the second, and below.

    Args:
        outcomes: of either study.
        question: a key of `inbounds.study.second.PAIRS`.
        family: of the first side, to which the question is put once.
        endpoint: final or area.
    """
    rows = _asked(outcomes, question, family, endpoint)
    return by_robot([(robot, _graded(comparison)) for robot, comparison in rows.items()])


def difference(
    outcomes: Outcomes, question: str, family: str, robot: str, endpoint: str = "final"
) -> Estimate:
    """Return the difference of a secondary comparison on a robot.

    Args:
        outcomes: of either study.
        question: as for `verdicts`.
        family: of the first side.
        robot: whose cells are finished on both sides.
        endpoint: final or area.
    """
    pair = _pair(question, family)
    found = pooled_difference(with_second(outcomes), pair.first, pair.second, robot, endpoint)
    assert found is not None, robot
    return found


def findings(outcomes: Outcomes, asked: Iterable[tuple[str, str]]) -> list[SecondaryRow]:
    """Return what is found of the final return, each test corrected over its robots.

    It stays, were all secondary tests corrected together, where `p_over_everything` is below `SIGNIFICANCE`.

    Args:
        outcomes: of either study.
        asked: question and family of each comparison; a question may be put to a family more than once.
    """
    wanted = {(question, family, "final") for question, family in asked}
    return [
        row
        for row in secondary(with_second(outcomes))
        if (row.question, row.pair.first.family, row.endpoint) in wanted
        and row.comparison.difference is not None
        and _verdict(row.comparison) in ("higher", "lower")
    ]


def _pair(question: str, family: str) -> Pair:
    found = [pair for pair in PAIRS[question] if pair.first.family == family]
    if len(found) != 1:
        raise ValueError(f"{question!r} is put to {family} {len(found)} times: ask one that is put once")
    return found[0]


def _asked(outcomes: Outcomes, question: str, family: str, endpoint: str) -> dict[str, Comparison]:
    """Return what is finished of a question that is put to a family once, by robot."""
    found = compared(with_second(outcomes), _pair(question, family), endpoint)
    return {robot: comparison for robot, comparison in found.items() if comparison.difference is not None}


def _graded(comparison: Comparison) -> str:
    assert comparison.difference is not None  # `_asked` leaves such rows out
    return graded(_verdict(comparison), comparison.difference)


def _verdict(comparison: Comparison) -> str:
    """Return a verdict, which waits where seeds of a side are still to be run."""
    return verdict(comparison) if np.isfinite(comparison.p_value) else WAITS
