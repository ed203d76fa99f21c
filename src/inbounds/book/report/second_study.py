"""The second study's views: an equal start, a Gaussian with a free σ, fresh seeds (`results/PROTOCOL-2.md`).

Each reads the cells of the second study from wherever the first study's outcomes came from.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from inbounds.book.report import html, secondary_tests
from inbounds.book.report.equal_start import with_second
from inbounds.book.report.forests import Bar, of_robots
from inbounds.book.report.html import NONE_FINISHED, Shown
from inbounds.book.report.study_figures import SHORT
from inbounds.book.report.study_panels import left_out
from inbounds.book.report.words import HEADS, WAITS, column_name
from inbounds.study.analysis import estimate
from inbounds.study.cell import Cell
from inbounds.study.grid import ROBOTS, SECOND, second_cells
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.second import (
    GAUSSIAN,
    MARGINS,
    PrimaryRow,
    aggregate,
    engines_agree,
    improvement,
    primary,
    starts,
)
from inbounds.study.second.primary import BOUNDED
from inbounds.study.second.yardsticks import ENDPOINTS
from inbounds.study.statistics import Estimate
from inbounds.study.statistics.settings import SIGNIFICANCE
from inbounds.study.words import p_value, percent, spoken

BLOCKS = {
    "B": "B: equal start, PPO",
    "B, more seeds": "B: ten more seeds of the primary columns",
    "C": "C: equal start, TRPO",
    "D": "D: the Gaussian with a free σ, usual start",
    "E": "E: other noise",
    "F": "F: other step sizes",
}
"""Block → what it is called."""
FOUND = ("confirmed", "contradicted")
"""Findings of the primary comparison that say on which side of 0 a difference lies."""
TOLERANCE = 0.02  # of the executed noise, before the start counts as unequal


def progress(outcomes: Outcomes) -> Shown:
    """Return how many cells of each block are finished."""
    states = with_second(outcomes).states
    counts = {
        BLOCKS[block]: (sum(states[cell.id] == "finished" for cell in cells), len(cells))
        for block, cells in SECOND.items()
    }
    return html.of_study("the second study, finished cells", html.progress(counts))


def primary_comparison(outcomes: Outcomes) -> Shown:
    """Return the primary comparison: a forest of differences in units of the margin, and the 24 tests as a table."""
    rows = primary(with_second(outcomes))
    known = [row for row in rows if row.difference is not None]
    if not known:
        return html.of_study("the primary comparison", NONE_FINISHED)
    words = Counter(row.finding or "waiting for seeds" for row in known)
    alt = (
        "Bounded law minus Gaussian with a free σ, in units of the margin, a row per robot, a panel per endpoint. "
        + ". ".join(
            f"{SHORT[row.law]}, {ENDPOINTS[row.endpoint]}, {row.robot}: {spoken(row.difference)}"
            for row in known
        )
    )
    head = ["robot", "law", "endpoint", "difference", "finding", "margin", "p", "p, Holm over 24", "seeds"]
    table = [
        [
            row.robot,
            SHORT[row.law],
            HEADS[row.endpoint],
            spoken(row.difference),
            row.finding or ("missing" if row.difference is None else WAITS),
            f"±{row.margin:g}",
            p_value(row.p_value),
            p_value(row.p_adjusted),
            _seeds(row.difference),
        ]
        for row in rows
    ]
    caption = (
        "Primary comparison: bounded law minus Gaussian with a free σ, PPO, executed noise 0.4 at the start. "
        "Refuted: the whole interval lies within the margin, with 0 in it or not. Confirmed or contradicted: "
        f"p < {SIGNIFICANCE} after Holm over the 24, not refuted, and the difference above or below 0. "
        "Undecided: all else. A finding waits until twenty seeds a side are there. "
        f"Of {len(rows)}: {', '.join(f'{count} {word}' for word, count in words.items())}."
    )
    return html.of_study(
        "the primary comparison",
        html.figure_of(of_robots(_bars(known)), alt, _caption(known)),
        html.table(caption, head, table, words=(0, 1, 2, 4)),
        *_without_diverged(with_second(outcomes), rows),
    )


def _caption(rows: Sequence[PrimaryRow]) -> str:
    """Return what the forest draws."""
    (level,) = {row.difference.level for row in rows if row.difference is not None}
    said = [
        "Primary comparison: bounded law minus Gaussian with a free σ, PPO, both with executed noise 0.4 at the start, "
        f"a panel per endpoint. Bars: {percent(level)} bootstrap intervals of a difference of means. Filled: found, "
        "which is confirmed or contradicted in the table below. Hollow: not. Grey: within the margin."
    ]
    waiting = [row for row in rows if not row.whole]
    robots = [robot for robot in ROBOTS if any(row.robot == robot for row in waiting)]
    return " ".join([*said, *([f"Seeds are still to be run: {', '.join(robots)}."] if robots else [])])


def _seeds(difference: Estimate | None) -> str:
    """Return how many seeds of a side count, and how many diverged or are left out."""
    return (left_out(difference) or str(difference.n)) if difference else ""


def _without_diverged(outcomes: Outcomes, rows: Sequence[PrimaryRow]) -> Iterator[str]:
    """Yield the primary findings without diverged seeds, if any seed diverged; those that count are with them."""
    with_them = {(r.law, r.endpoint, r.robot): r for r in rows}
    if not any(row.difference is not None and row.difference.diverged for row in with_them.values()):
        return
    table = [
        [
            row.robot,
            SHORT[row.law],
            HEADS[row.endpoint],
            spoken(row.difference),
            row.finding or WAITS,
            with_them[row.law, row.endpoint, row.robot].finding or WAITS,
        ]
        for row in primary(outcomes, without_diverged=True)
        if row.difference is not None
    ]
    caption = (
        "The primary comparison without the seeds that diverged. The findings that count are those with them."
    )
    head = ["robot", "law", "endpoint", "difference", "finding", "with them"]
    yield html.table(caption, head, table, words=(0, 1, 2, 4, 5))


def _bars(rows: Sequence[PrimaryRow]) -> dict[str, list[Bar]]:
    """Return the differences by endpoint, as bars in units of the margin; hollow where none is found."""
    return {
        name: [
            Bar(row.robot, row.law, row.difference, row.margin, hollow=row.finding not in FOUND)
            for row in rows
            if row.endpoint == endpoint and row.difference is not None
        ]
        for endpoint, name in ENDPOINTS.items()
    }


def over_robots(outcomes: Outcomes) -> Shown:
    """Return the primary columns over all robots, where they are complete."""
    found, rows = with_second(outcomes), []
    for law in ("gaussian", *BOUNDED):
        column = GAUSSIAN if law == "gaussian" else Column("equal", "ppo", law)
        for endpoint, name in ENDPOINTS.items():
            if (iqm := aggregate(found, column, endpoint)) is not None:
                beats = "" if law == "gaussian" else spoken(improvement(found, column, endpoint), 2)
                rows.append([column_name(column), name, spoken(iqm, 2), beats])
    if not rows:
        missing = html.missing("missing: no primary column is complete on all six robots.")
        return html.of_study("the primary columns over all robots", missing)
    head = ["column", "endpoint", "IQM", "probability of beating the Gaussian"]
    caption = "Over all robots: doing nothing scores 0, the first study's best final return 1."
    return html.of_study("the primary columns over all robots", html.table(caption, head, rows, words=(0, 1)))


def cells(outcomes: Outcomes) -> Shown:
    """Return what each finished cell earned: final return, area, and the greedy return, which decides nothing."""
    found = with_second(outcomes)
    rows = [
        [
            cell.robot,
            f"{cell.algorithm.upper()}: {_name(found, cell)}",
            *(spoken(estimate(outcome, endpoint)) for endpoint in (*ENDPOINTS, "greedy")),
            f"{cell.seeds[0]}–{cell.seeds[-1]}{', ' * bool(diverged)}{diverged}",
        ]
        for cell in second_cells()
        if (outcome := found.finished.get(cell.id))
        for diverged in [f"{outcome.diverged.sum()} diverged" if outcome.diverged.any() else ""]
    ]
    if not rows:
        return html.of_study("the second study's cells", NONE_FINISHED)
    caption = "Every finished cell. Greedy: by the median, the last five evaluations of the training."
    head = ["robot", "column", "final return", "area", "greedy return", "seeds"]
    return html.of_study("the second study's cells", html.table(caption, head, rows, words=(0, 1, 5)))


def _column_of(cell: Cell) -> Column:
    return Column(cell.arm, cell.algorithm, cell.family, cell.variant)


def _name(found: Outcomes, cell: Cell) -> str:
    """Return what a cell's column is called, and whether its start failed the manipulation check."""
    failed = _failed(cell, starts(found, _column_of(cell), cell.robot))
    return column_name(_column_of(cell)) + (", start failed" if failed else "")


def _failed(cell: Cell, start: Mapping[str, float] | None) -> bool:
    """Return whether a column executes other noise before training than it was asked for."""
    asked = cell.config.policy.initial_std
    return start is not None and asked is not None and abs(start["action_std"] - asked) > TOLERANCE


def equal_starts(outcomes: Outcomes) -> Shown:
    """Return the manipulation check: what each column does before training, and whether the start is equal."""
    found = with_second(outcomes)
    rows = []
    for cell in second_cells():
        column = _column_of(cell)
        if (start := starts(found, column, cell.robot)) is None:
            continue
        asked, failed = cell.config.policy.initial_std, _failed(cell, start)
        rows.append(
            [
                cell.robot,
                f"{cell.algorithm.upper()}: {column_name(column)}",
                f"{start['action_std']:.3f}",
                "usual" if asked is None else f"{asked:g}{', failed' if failed else ''}",
                percent(start["saturation"], 1),
                f"{start['return']:.0f}".replace("-", "−"),
                f"{cell.seeds[0]}–{cell.seeds[-1]}",
            ]
        )
    if not rows:
        return html.of_study("the manipulation check", NONE_FINISHED)
    head = ["robot", "column", "executed noise", "asked for", "at a bound", "first return", "seeds"]
    caption = "Manipulation check: the untrained policies, means over seeds of the first epoch."
    return html.of_study("the manipulation check", html.table(caption, head, rows, words=(0, 1, 6)))


def engine_check(outcomes: Outcomes) -> Shown:
    """Return whether the compiled engine's cells are equivalent to their twins of the first study."""
    agreed, wider = engines_agree(with_second(outcomes)), engines_agree(with_second(outcomes), level=0.025)
    if not agreed:
        return html.of_study("the two engines", NONE_FINISHED)

    def found(key: tuple[str, str, str]) -> str:
        """The protocol stops the study where the whole 95 % interval lies outside the margin."""
        _, robot, endpoint = key
        margin = MARGINS[endpoint][robot]
        outside = wider[key].low > margin or wider[key].high < -margin
        return "equivalent" if agreed[key].equivalent else "outside the margin" if outside else "undecided"

    rows = [
        [
            robot,
            SHORT[family],
            HEADS[endpoint],
            f"{e.difference:.0f} [{e.low:.0f}, {e.high:.0f}]".replace("-", "−"),
            found((family, robot, endpoint)),
            p_value(e.p_value),
        ]
        for (family, robot, endpoint), e in agreed.items()
    ]
    caption = (
        "Compiled minus autograd, PPO, equal start: two one-sided tests within the margins; 90 % intervals."
    )
    head = ["robot", "family", "endpoint", "difference", "", "p"]
    return html.of_study("the two engines", html.table(caption, head, rows, words=(0, 1, 2, 4)))


def second_study(outcomes: Outcomes) -> Iterator[str]:
    """Yield the parts of the report's section."""
    yield html.paragraph(
        "Which law, all else equal? Every law starts with the same executed noise, the Gaussian has a free σ, the "
        "seeds are fresh. results/PROTOCOL-2.md fixed it before its first run."
    )
    for title, view in (
        ("Finished cells", progress),
        ("Primary comparison", primary_comparison),
        ("Every cell", cells),
        ("Over all robots", over_robots),
        ("Before training", equal_starts),
        ("The two engines", engine_check),
        ("Secondary comparisons", secondary_tests.comparisons),
    ):
        yield html.heading(title, 3)
        yield from view(outcomes).parts
