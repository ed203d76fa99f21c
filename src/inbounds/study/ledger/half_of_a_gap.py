"""Evidence on causes: is half of a gap left where something else has been changed?"""

from __future__ import annotations

from collections.abc import Sequence

from inbounds.study.ledger.evidence import groups_of, side
from inbounds.study.ledger.verdicts import Evidence, Statement
from inbounds.study.outcomes import Column, Floats, Outcomes
from inbounds.study.statistics import combination


def half_remains(
    now: tuple[Column, Column],
    before: tuple[Column, Column],
    robots: Sequence[str],
    endpoint: str,
    *,
    claimed: bool = True,
) -> Evidence:
    """Of a gap between two columns, at least half is left where something else has been changed; see `half_left`.

    `claimed`: the claim is that so much is left, else that less is.
    """

    def find(outcomes: Outcomes) -> list[Statement]:
        found = []
        for robot in robots:
            left, gap = (
                groups_of(outcomes, [(column, robot) for column in pair], endpoint) for pair in (now, before)
            )
            found.append(half_left(robot, left, gap, claimed=claimed, one_base=now[1] == before[1]))
        return found

    return find


def half_left(
    about: str,
    now: Sequence[Floats] | None,
    before: Sequence[Floats] | None,
    *,
    claimed: bool,
    one_base: bool = False,
) -> Statement:
    """Say whether half of a gap is left: (a − b) − ½ (c − d) for the means of four groups.

    For: above 0, or below where that is claimed. Moot: the gap c − d is not clearly above 0, whatever a and b are; the
    statement then tells the gap. Missing: it needs groups that are not there.

    Testing this linear form instead of the ratio (a − b)/(c − d) is Fieller's way: the ratio has no mean. A statement
    that is not moot has an overestimated gap c − d, on average, and so leans to "less than half". It is both clear and
    wrongly against with a probability of 2.5 % at most, as any other; among the clear ones the share may be larger.

    Args:
        about: of the statement.
        now: a and b, `[S]` each; None where they are missing.
        before: c and d, likewise.
        claimed: whether the claim is that so much is left.
        one_base: b and d are one group, whose seeds are drawn once.
    """
    if before is None:
        return Statement(about, "missing")
    gap = combination(before, [1, -1])
    if not gap.low > 0:
        return Statement(f"{about} (gap)", "moot", gap)
    if now is None:
        return Statement(about, "missing")
    (a, b), (c, d) = now, before
    parts, weights = ([a, b, c], [1, -0.5, -0.5]) if one_base else ([a, b, c, d], [1, -1, -0.5, 0.5])
    rest = combination(parts, weights)
    return Statement(about, side(rest, 1 if claimed else -1), rest)
