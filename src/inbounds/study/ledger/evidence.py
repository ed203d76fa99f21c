"""Kinds of evidence: from finished cells to statements for a claim, against it, or open.

Each function takes what it is about and returns what `Claim` wants: a function of the outcomes. Differences of two
families on the six robots carry the protocol's test with Holm's correction, and count only where it agrees with the
interval. Everything else has an interval per statement, uncorrected, as the protocol has it for the fourth arm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from inbounds.study import analysis, statistics, words
from inbounds.study.analysis import Contrast, generator_for
from inbounds.study.grid import ROBOTS, Cell, select
from inbounds.study.ledger.verdicts import Evidence, State, Statement
from inbounds.study.outcomes import Column, Floats, Outcome, Outcomes
from inbounds.study.statistics import Comparison, Estimate, combination

MARGIN = 0.1
"""The smallest difference that matters, as a share of what PPO × gaussian of arm 1 learns on the robot."""
START = "start"
"""The return of the first epoch, which the untrained policy earns; no endpoint of the protocol."""


def seeds_of(outcome: Outcome, endpoint: str) -> Floats:
    """Return an endpoint of `analysis.ENDPOINTS`, or the `START`, of each seed `[S]`; NaN where it is missing."""
    return outcome.returns[:, 0] if endpoint == START else analysis.scores(outcome, endpoint)


def groups_of(outcomes: Outcomes, places: Sequence[tuple[Column, str]], endpoint: str) -> list[Floats] | None:
    """Return an endpoint's seeds of several cells, None unless all are finished and have two seeds that count."""
    cells = [outcomes.find(column, robot) for column, robot in places]
    groups = [seeds_of(cell, endpoint) for cell in cells if cell is not None]
    return groups if len(groups) == len(places) and all(np.isfinite(x).sum() > 1 for x in groups) else None


def side(estimate: Estimate, sign: int = 1, edge: float = 0.0) -> State:
    """Say on which side of an edge an interval lies, for a claim that it is above (sign 1) or below (−1)."""
    states: dict[int, State] = {1: "for", 0: "open", -1: "against"}
    return states[sign * words.side(estimate.low, estimate.high, edge)]


def beats(
    contrast: Contrast, endpoint: str = "final", robots: Sequence[str] = ROBOTS, *, below: Sequence[str] = ()
) -> Evidence:
    """State that the first family is ahead of the second on some robots, and behind on others.

    For: the interval of the difference leaves out 0 on that side, and the test finds it after Holm.
    Against: the same, other side.

    Args:
        contrast: the families.
        endpoint: a key of `analysis.ENDPOINTS`, or `START`.
        robots: on which the claim puts it ahead.
        below: on which the claim puts it behind.
    """

    def find(outcomes: Outcomes) -> list[Statement]:
        rows = _compared(outcomes, contrast, endpoint)
        best = statistics.holm_at_best([rows[robot].p_value for robot in ROBOTS])
        return [
            _of_comparison(_about(contrast, robot), rows[robot], -1 if robot in below else 1, float(p))
            for robot, p in zip(ROBOTS, best, strict=True)
            if robot in (*robots, *below)
        ]

    return find


def _about(contrast: Contrast, robot: str) -> str:
    return f"{robot}, {contrast.algorithm.upper()}, {contrast.first} − {contrast.second}"


def _compared(outcomes: Outcomes, contrast: Contrast, endpoint: str) -> dict[str, Comparison]:
    if endpoint != START:
        return analysis.differences(outcomes, contrast, endpoint)
    first, second = (
        {
            robot: groups[0]
            for robot in ROBOTS
            if (groups := groups_of(outcomes, [(column, robot)], START)) is not None
        }
        for column in contrast.columns
    )
    rng = generator_for("difference", *contrast, START)
    return statistics.compared(first, second, rng, environments=ROBOTS)


def _of_comparison(about: str, row: Comparison, sign: int, best: float) -> Statement:
    """Read a row; `best` is its p after Holm, were the robots that are missing as clear as can be."""
    if row.difference is None:
        return Statement(about, "missing")
    said: Mapping[str, State] = (
        {"higher": "for", "lower": "against"} if sign > 0 else {"higher": "against", "lower": "for"}
    )
    state = said.get(words.verdict(row), "open")
    later = said.get(words.verdict(replace(row, p_adjusted=best)), "open")
    return Statement(
        about, state, row.difference, row.p_adjusted, may_become=() if later == state else (later,)
    )


def margin(outcomes: Outcomes, robot: str) -> float | None:
    """Return the smallest difference that matters on a robot, None while the reference is not finished."""
    known = analysis.references(outcomes).get(robot)
    return None if known is None or known[1] <= known[0] else MARGIN * (known[1] - known[0])


def equals(contrast: Contrast, robots: Sequence[str]) -> Evidence:
    """Two final returns differ by less than the margin. For: all of the interval is within ±margin; against: none."""

    def find(outcomes: Outcomes) -> list[Statement]:
        rows, found = analysis.differences(outcomes, contrast, "final"), []
        for robot in robots:
            about, gap = _about(contrast, robot), rows[robot].difference
            edge = margin(outcomes, robot)
            if gap is None or edge is None:
                found.append(Statement(about, "missing"))
                continue
            apart = gap.low > edge or gap.high < -edge
            within = -edge < gap.low and gap.high < edge
            state: State = "for" if within else "against" if apart else "open"
            found.append(Statement(f"{about} (margin ±{edge:.0f})", state, gap))
        return found

    return find


def changes(patterns: Sequence[str], sign: int, endpoint: str = "final") -> Evidence:
    """State that cells of the fourth arm lie above (sign 1) or below (−1) the cell each is compared with."""

    def find(outcomes: Outcomes) -> list[Statement]:
        found = []
        for cell in select(patterns):
            gap = _change(outcomes, cell, endpoint)
            found.append(
                Statement(_name(cell), side(gap, sign), gap) if gap else Statement(_name(cell), "missing")
            )
        return found

    return find


def costs(patterns: Sequence[str], *, claimed: bool) -> Evidence:
    """State that cells of the fourth arm lose more than the margin (`claimed`), or do not.

    The interval of the change lies below −margin (a loss that matters), above it (none that does), or is open: a loss
    that is clear but may be smaller than the margin decides nothing.
    """

    def find(outcomes: Outcomes) -> list[Statement]:
        found = []
        for cell in select(patterns):
            gap, edge = _change(outcomes, cell, "final"), margin(outcomes, cell.robot)
            if gap is None or edge is None:
                found.append(Statement(_name(cell), "missing"))
                continue
            state = side(gap, -1 if claimed else 1, -edge)
            found.append(Statement(f"{_name(cell)} (margin {edge:.0f})", state, gap))
        return found

    return find


def _change(outcomes: Outcomes, cell: Cell, endpoint: str) -> Estimate | None:
    outcome = outcomes.finished.get(cell.id)
    if outcome is None:
        return None
    if endpoint != START:
        return analysis.change(outcomes, outcome, endpoint)
    column = Column(cell.arm, cell.algorithm, cell.family, cell.variant)
    groups = groups_of(outcomes, [(column, cell.robot), (column.baseline, cell.robot)], START)
    return None if groups is None else combination(groups, [1, -1])


def _name(cell: Cell) -> str:
    variant = f", {cell.variant}" if cell.variant else ""
    return f"{cell.robot}, {cell.algorithm.upper()}, {cell.family}{variant}"


def gaps(pairs: Sequence[tuple[Column, Column]], robot: str) -> Evidence:
    """On one robot the first column of each pair ends above the second."""

    def find(outcomes: Outcomes) -> list[Statement]:
        found = []
        for first, second in pairs:
            about = f"{first.algorithm.upper()}, {first.family} − {second.family}"
            groups = groups_of(outcomes, [(first, robot), (second, robot)], "final")
            if groups is None:
                found.append(Statement(about, "missing"))
                continue
            gap = combination(groups, [1, -1])
            found.append(Statement(about, side(gap), gap))
        return found

    return find


def learns(column: Column, sign: int = 1) -> Evidence:
    """State that a column ends above where it starts, seed by seed; sign −1: the claim is that it does not."""

    def find(outcomes: Outcomes) -> list[Statement]:
        found = []
        for robot in ROBOTS:
            outcome = outcomes.find(column, robot)
            if outcome is None or groups_of(outcomes, [(column, robot)], "final") is None:
                found.append(Statement(robot, "missing"))
                continue
            rise = seeds_of(outcome, "final") - seeds_of(outcome, START)
            gap = combination([rise], [1])
            found.append(Statement(robot, side(gap) if sign > 0 else _opposite(side(gap)), gap))
        return found

    return find


def _opposite(state: State) -> State:
    swapped: Mapping[State, State] = {"for": "against", "against": "for"}
    return swapped.get(state, state)


def exceeds(patterns: Sequence[str], measure: Sequence[str], edge: float, digits: int) -> Evidence:
    """State that a measured quantity, summed over its columns, ends above an edge (mean of the last five)."""

    def find(outcomes: Outcomes) -> list[Statement]:
        found = []
        for cell in select(patterns):
            outcome = outcomes.finished.get(cell.id)
            if outcome is None:
                found.append(Statement(_name(cell), "missing"))
                continue
            last = np.sum([outcome.measured[name] for name in measure], 0)[
                :, -statistics.settings.LAST_EVALUATIONS :
            ]
            if np.isfinite(last.mean(1)).sum() < 2:
                found.append(Statement(_name(cell), "missing"))
                continue
            level = combination([last.mean(1)], [1])
            found.append(Statement(_name(cell), side(level, 1, edge), level, digits=digits))
        return found

    return find


def improves(contrasts: Sequence[Contrast]) -> Evidence:
    """State that a random run of the first family does better than one of the second in more than half of all pairs."""

    def find(outcomes: Outcomes) -> list[Statement]:
        found = []
        for contrast in contrasts:
            chance, about = analysis.improvement(outcomes, contrast, "final"), contrast.algorithm.upper()
            found.append(
                Statement(about, side(chance, 1, 0.5), chance, digits=2)
                if chance
                else Statement(about, "missing")
            )
        return found

    return find


def together(*parts: Evidence) -> Evidence:
    """Return all statements of several kinds of evidence."""
    return lambda outcomes: [statement for part in parts for statement in part(outcomes)]
