"""The sections of the study's report on arms that compare families: curves, endpoints, differences, aggregates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from inbounds.book.drawing.figures import LOOKS
from inbounds.book.report import html
from inbounds.book.report.aggregates import ALGORITHMS, HEADS, aggregates, columns_of
from inbounds.book.report.study_figures import (
    Curve,
    difference_panels,
    interval_panels,
    learning_curves,
)
from inbounds.book.report.words import in_words, p_value, pair_name, spoken, verdict
from inbounds.study import analysis
from inbounds.study.analysis import CONTRASTS, ENDPOINTS
from inbounds.study.grid import ARMS, ROBOTS
from inbounds.study.outcomes import Outcome, Outcomes
from inbounds.study.statistics import Comparison, Estimate
from inbounds.study.statistics.settings import LEVEL
from inbounds.study.words import percent

TITLES: Mapping[str, str] = {
    "standard": "Arm 1: standard practice",
    "printed": "Arm 2: as printed",
    "beyond": "Arm 3: beyond the thesis",
    "mechanisms": "Arm 4: mechanisms",
}


def title_of(arm: str, algorithm: str) -> str:
    """Name an algorithm's part of an arm.

    Example:
        >>> title_of("printed", "ppo")
        'PPO, as printed'
    """
    return f"{algorithm.upper()}, {TITLES[arm].partition(': ')[2]}"


def arm_section(outcomes: Outcomes, arm: str) -> list[str]:
    """Return the section of an arm, as parts of a page; short where none of its cells is finished."""
    parts = [html.heading(TITLES[arm], 2, arm)]
    if not any(cell.id in outcomes.finished for cell in ARMS[arm]):
        return [*parts, html.paragraph("missing: no cell of this arm is finished.", "missing")]
    for algorithm in ALGORITHMS:
        title = title_of(arm, algorithm)
        cells = cells_of(outcomes, arm, algorithm)
        parts.append(html.heading(title, 3))
        if not any_finished(cells):
            parts.append(NONE_FINISHED)
            continue
        parts += curves(title, cells)
        parts += endpoints(title, cells)
        parts += difference_table(outcomes, arm, algorithm)
        parts += without_diverged(outcomes, arm, algorithm, cells)
        parts.append(diagnostics(title, cells))
    parts += aggregates(outcomes, arm, TITLES[arm].partition(": ")[2])
    acted = ways(outcomes, arm)
    return [*parts, html.heading("Ways to act", 3), *acted] if acted else parts


Cells = Mapping[str, Mapping[str, Outcome | None]]
"""By robot and family."""

NONE_FINISHED = html.paragraph("missing: none of these cells is finished.", "missing")
"""What a page shows in place of anything about cells of which `any_finished` is false."""


def cells_of(outcomes: Outcomes, arm: str, algorithm: str) -> Cells:
    """Return the cells that an arm compares under an algorithm."""
    columns = columns_of(arm, algorithm)
    return {robot: {f: outcomes.find(c, robot) for f, c in columns.items()} for robot in ROBOTS}


def any_finished(cells: Cells) -> bool:
    """Say whether at least one of these cells is finished."""
    return any(outcome for row in cells.values() for outcome in row.values())


def begun(cells: Cells) -> Cells:
    """Return the robots of which at least one cell is finished."""
    return {robot: row for robot, row in cells.items() if any(row.values())}


def lacking(robots: Iterable[str]) -> str:
    """Name the robots that have no row, as a sentence of a caption; nothing where none lacks."""
    left = [robot for robot in ROBOTS if robot not in set(robots)]
    return f" Not finished: {', '.join(left)}." if left else ""


def curves(title: str, cells: Cells) -> list[str]:
    """Return the learning curves, a panel per robot, and how many cells are finished where some are not."""
    counts = {robot: (sum(o is not None for o in row.values()), len(row)) for robot, row in cells.items()}
    unfinished = any(done < planned for done, planned in counts.values())
    cells = begun(cells)

    def drawn(outcome: Outcome | None) -> Curve | None:
        band = analysis.curve(outcome) if outcome else None
        return Curve(outcome.steps, band) if outcome and band else None

    fig = learning_curves(
        {robot: {family: drawn(o) for family, o in row.items()} for robot, row in cells.items()},
        ylabel="return of training episodes",
    )
    ends = in_words({r: {f: _final(o) for f, o in row.items()} for r, row in cells.items()})
    alt = f"Learning curves ({title}), a panel per robot, a line per family. Mean final returns: {ends}"
    caption = (
        "Mean undiscounted return of the episodes that ended in an epoch, over seeds; the axis counts the env steps "
        "of one seed, of which ten train. Each robot has its own scale."
    )
    return [html.figure(fig, alt, caption), *([html.progress(counts)] if unfinished else [])]


def _final(outcome: Outcome | None) -> Estimate | None:
    return analysis.estimate(outcome, "final") if outcome else None


def endpoints(title: str, cells: Cells) -> list[str]:
    """Return the final returns as a figure, and all endpoints as a table."""
    cells = begun(cells)
    finals = {robot: {f: _final(o) for f, o in row.items()} for robot, row in cells.items()}
    fig = interval_panels(
        finals, xlabel="final return: mean of training returns over the last 10 % of epochs"
    )
    head = ["robot", "family", "seeds", "diverged"]
    head += [f"{name}, {statistic}" for name in HEADS.values() for statistic in ("mean", "IQM")]
    rows = []
    for robot, row in cells.items():
        for family, outcome in row.items():
            if outcome is None:
                rows.append([robot, LOOKS[family].label, "missing", *[""] * 7])
                continue
            numbers = [spoken(analysis.estimate(outcome, e, s)) for e in ENDPOINTS for s in ("mean", "iqm")]
            counts = [str(len(outcome.diverged)), str(int(outcome.diverged.sum()))]
            rows.append([robot, LOOKS[family].label, *counts, *numbers])
    caption = f"Endpoints ({title}): over ten seeds, in brackets a {percent(LEVEL)} bootstrap interval.{lacking(cells)}"
    alt = f"Final returns ({title}) with intervals, a panel per robot: {in_words(finals)}"
    return [html.figure(fig, alt, ""), html.table(caption, head, rows, words=(0, 1))]


def difference_table(
    outcomes: Outcomes, arm: str, algorithm: str, *, without_diverged: bool = False
) -> list[str]:
    """Return the differences between families: final returns as a figure, all endpoints as a table with tests."""
    contrasts = [c for c in CONTRASTS if (c.arm, c.algorithm) == (arm, algorithm)]
    found = {
        endpoint: {
            c: analysis.differences(outcomes, c, endpoint, without_diverged=without_diverged)
            for c in contrasts
        }
        for endpoint in ENDPOINTS
    }
    known = [robot for robot in ROBOTS if any(found["final"][c][robot].difference for c in contrasts)]
    if not known:
        return [html.paragraph("missing: of no robot are two cells to be compared finished.", "missing")]
    rows = [
        [robot, pair_name(c), *_row([found[endpoint][c][robot] for endpoint in ENDPOINTS])]
        for c in contrasts
        for robot in known
    ]
    head = ["robot", "difference"]
    head += [word for name in HEADS.values() for word in (name, "p, Holm", "")]
    which = ", without seeds that diverged" if without_diverged else ""
    caption = (
        f"Differences of means ({title_of(arm, algorithm)}{which}): in brackets "
        f"a {percent(LEVEL)} bootstrap interval; p of a permutation test, corrected over the six robots (Holm). "
        f"Unresolved: the interval contains 0, which is no evidence of equality.{lacking(known)}"
    )
    told = html.table(caption, head, rows, words=(0, 1, 4, 7, 10))
    if without_diverged:
        return [told]
    finals = {robot: {(c.first, c.second): found["final"][c][robot] for c in contrasts} for robot in known}
    alt = f"Differences of mean final returns ({title_of(arm, algorithm)}), a panel per robot: " + ". ".join(
        f"{pair_name(c)} on {robot}: {_row([found['final'][c][robot]])[0]}"
        for c in contrasts
        for robot in known
    )
    return [html.figure(difference_panels(finals, xlabel="difference of mean final returns"), alt, ""), told]


def _row(comparisons: Sequence[Comparison]) -> list[str]:
    return [
        word
        for c in comparisons
        for word in (spoken(c.difference), p_value(c.p_adjusted) if c.difference else "", verdict(c))
    ]


def without_diverged(outcomes: Outcomes, arm: str, algorithm: str, cells: Cells) -> list[str]:
    """Repeat the analysis without the seeds that diverged, if any did."""
    gone = sum(int(o.diverged.sum()) for row in cells.values() for o in row.values() if o)
    if not gone:
        return [html.paragraph("No seed diverged here: without such seeds every number is the same.")]
    said = f"Seeds that diverged: {gone}. Above they count with their last return; without them:"
    head = ["robot", "family", "seeds", *HEADS.values()]
    rows = []
    for robot, row in cells.items():
        for family, outcome in row.items():
            if outcome is not None and outcome.diverged.any():
                found = [analysis.estimate(outcome, e, without_diverged=True) for e in ENDPOINTS]
                count = str(int((~outcome.diverged).sum()))
                rows.append([robot, LOOKS[family].label, count, *map(spoken, found)])
    means = html.table(
        f"Means of the cells concerned ({title_of(arm, algorithm)}), without seeds that diverged.",
        head,
        rows,
        words=(0, 1),
    )
    return [
        html.paragraph(said),
        means,
        *difference_table(outcomes, arm, algorithm, without_diverged=True),
    ]


_DIAGNOSTICS: Mapping[str, str] = {
    "action_std": "spread of executed actions [half range]",
    "saturation": "saturation",
    "explained_variance": "explained variance",
    "kl": "KL [nats]",
    "entropy": "entropy [nats]",
}


def diagnostics(title: str, cells: Cells) -> str:
    """Return the table of what happened inside."""
    head = ["robot", "family", *_DIAGNOSTICS.values(), "at a clamp"]
    rows = []
    for robot, row in cells.items():
        for family, outcome in row.items():
            if outcome is not None:
                numbers = [_first_and_last(outcome.measured[name]) for name in _DIAGNOSTICS]
                clamps = np.sum([v for name, v in outcome.measured.items() if name.startswith("at_")], 0)
                rows.append([robot, LOOKS[family].label, *numbers, _first_and_last(clamps)])
    caption = (
        f"What happened inside ({title}): medians over seeds, of the first epoch → of the last five "
        "measurements. Spread, saturation and clamps of the first epoch are the untrained policy's: its noise. Later "
        "most of the spread is the policy's own movement. These numbers describe; they decide nothing."
    )
    return html.table(caption, head, rows, words=(0, 1))


def _first_and_last(values: np.ndarray) -> str:
    first, last = values[:, 0], values[:, -5:].mean(1)
    return " → ".join(f"{np.nanmedian(x):.3g}" if np.isfinite(x).any() else "–" for x in (first, last))


def ways(outcomes: Outcomes, arm: str) -> list[str]:
    """Return the table of final policies by way to act; empty where none were kept."""
    kept = [outcomes.finished[c.id] for c in ARMS[arm] if c.id in outcomes.finished]
    kept = [outcome for outcome in kept if outcome.ways]
    if not kept:
        return []
    names = list(dict.fromkeys(way for outcome in kept for way in outcome.ways))
    rows = [
        [o.cell.robot, o.cell.algorithm.upper(), LOOKS[o.cell.family].label]
        + [spoken(analysis.by_way(o).get(way)) for way in names]
        for o in kept
    ]
    caption = (
        f"Final policies by way to act ({TITLES[arm].partition(': ')[2]}): "
        "mean return of ten episodes per seed from the same starts, over seeds."
    )
    return [html.table(caption, ["robot", "algorithm", "family", *names], rows, (0, 1, 2))]
