"""An arm that compares families, under one algorithm: learning curves, endpoints, differences, what happened inside."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np
from matplotlib.figure import Figure

from inbounds.book.drawing.figures import LOOKS
from inbounds.book.report import html
from inbounds.book.report.html import Shown
from inbounds.book.report.study_figures import (
    Curve,
    curve_note,
    difference_note,
    difference_panels,
    interval_note,
    interval_panels,
    learning_curves,
)
from inbounds.book.report.words import ARM_NAMES, HEADS, in_words, pair_name, title_of
from inbounds.study import analysis
from inbounds.study.analysis import CONTRASTS, ENDPOINTS, Contrast
from inbounds.study.grid import ARMS, ROBOTS
from inbounds.study.outcomes import Column, Outcome, Outcomes
from inbounds.study.statistics import Comparison, Estimate
from inbounds.study.statistics.settings import LAST_EVALUATIONS, LEVEL
from inbounds.study.words import p_value, percent, spoken, verdict


def columns_of(arm: str, algorithm: str) -> dict[str, Column]:
    """Return by family, in the book's order, the columns that an arm compares; arm 3's stand beside arm 1's."""
    arms = ("standard", "beyond") if arm == "beyond" else (arm,)
    planned = {cell.family for a in arms for cell in ARMS[a] if cell.algorithm == algorithm}
    return {family: Column.within(arm, algorithm, family) for family in LOOKS if family in planned}


@dataclass(frozen=True)
class Part:
    """The cells that an arm compares under an algorithm."""

    title: str
    """Of the part."""
    cells: Mapping[str, Mapping[str, Outcome | None]]
    """By robot and family."""

    @classmethod
    def of(cls, outcomes: Outcomes, arm: str, algorithm: str) -> Part:
        """Return the cells, None in place of each that is not finished."""
        columns = columns_of(arm, algorithm)
        cells = {robot: {f: outcomes.find(c, robot) for f, c in columns.items()} for robot in ROBOTS}
        return cls(title_of(arm, algorithm), cells)

    @property
    def begun(self) -> dict[str, Mapping[str, Outcome | None]]:
        """The robots of which at least one cell is finished."""
        return {robot: row for robot, row in self.cells.items() if any(row.values())}

    def finished(self) -> Iterator[tuple[str, str, Outcome]]:
        """Yield robot, label of the family and outcome of each finished cell."""
        for robot, row in self.cells.items():
            for family, outcome in row.items():
                if outcome is not None:
                    yield robot, LOOKS[family].label, outcome

    def shown(self, what: str, *parts: str) -> Shown:
        """Return a view of this part."""
        return html.of_study(f"{what}, {self.title}", *parts)

    def missing(self, what: str) -> Shown:
        """Return what a page shows where none of these cells is finished."""
        return self.shown(what, html.missing(f"missing ({what}): no cell of “{self.title}” is finished."))


def _unfinished(robots: Iterable[str]) -> str:
    """Name the robots that have no row, as a sentence of a caption; nothing where none lacks."""
    left = [robot for robot in ROBOTS if robot not in set(robots)]
    return f" Not finished: {', '.join(left)}." if left else ""


def curves(outcomes: Outcomes, arm: str, algorithm: str) -> Shown:
    """Return the learning curves, a panel per robot, and how many cells are finished where some are not."""
    part = Part.of(outcomes, arm, algorithm)
    if not part.begun:
        return part.missing("learning curves")

    def drawn(outcome: Outcome | None) -> Curve | None:
        band = analysis.curve(outcome) if outcome else None
        return Curve(outcome.steps, band) if outcome and band else None

    panels = {robot: {family: drawn(o) for family, o in row.items()} for robot, row in part.begun.items()}
    draw = partial(_curves_of, panels)
    alt = (
        f"Learning curves ({part.title}), a panel per robot, a line per family. "
        f"Mean final returns: {in_words(_finals(part))}"
    )
    caption = (
        f"Learning curves ({part.title}): mean undiscounted return of the episodes that ended in an epoch, over seeds; "
        "the axis counts the env steps of one seed, of which ten train. Each robot has its own scale. "
        f"{curve_note(panels)}"
    )
    counts = {robot: (sum(map(bool, row.values())), len(row)) for robot, row in part.cells.items()}
    unfinished = any(done < planned for done, planned in counts.values())
    strip = [html.progress(counts)] if unfinished else []
    return part.shown("learning curves", html.figure_of(draw, alt, caption), *strip)


def _curves_of(panels: Mapping[str, Mapping[str, Curve | None]], narrow: bool) -> Figure:
    return learning_curves(panels, ylabel="return of training episodes", narrow=narrow, noted=False)


def _finals(part: Part) -> dict[str, dict[str, Estimate | None]]:
    return {
        robot: {family: analysis.estimate(o, "final") if o else None for family, o in row.items()}
        for robot, row in part.begun.items()
    }


def endpoints(outcomes: Outcomes, arm: str, algorithm: str) -> Shown:
    """Return the final returns as a figure, and all endpoints as a table."""
    part = Part.of(outcomes, arm, algorithm)
    if not part.begun:
        return part.missing("endpoints")
    finals = _finals(part)

    def draw(narrow: bool) -> Figure:
        return interval_panels(finals, xlabel="final return", narrow=narrow, noted=False)

    alt = f"Final returns ({part.title}) with intervals, a panel per robot: {in_words(finals)}"
    drawn = (
        f"Final returns ({part.title}), a panel per robot: training returns of the last 10 % of epochs. "
        f"{interval_note(finals)}"
    )
    measures = [f"{name}, {statistic}" for name in HEADS.values() for statistic in ("mean", "IQM")]
    head = ["robot", "family", *measures, "seeds", "diverged"]
    rows = []
    for robot, row in part.begun.items():
        for family, outcome in row.items():
            if outcome is None:
                rows.append([robot, LOOKS[family].label, "missing", *[""] * 7])
                continue
            numbers = [spoken(analysis.estimate(outcome, e, s)) for e in ENDPOINTS for s in ("mean", "iqm")]
            counts = [str(len(outcome.diverged)), str(int(outcome.diverged.sum()))]
            rows.append([robot, LOOKS[family].label, *numbers, *counts])
    caption = (
        f"Endpoints ({part.title}): over ten seeds, in brackets a {percent(LEVEL)} bootstrap interval."
        f"{_unfinished(part.begun)}"
    )
    table = html.table(caption, head, rows, words=(0, 1))
    return part.shown("endpoints", html.figure_of(draw, alt, drawn), table)


def difference_table(outcomes: Outcomes, arm: str, algorithm: str) -> Shown:
    """Return the differences between families: final returns as a figure, all endpoints as a table with tests.

    Where seeds diverged, everything is repeated without them.
    """
    part = Part.of(outcomes, arm, algorithm)
    if not part.begun:
        return part.missing("differences")
    contrasts = [c for c in CONTRASTS if (c.arm, c.algorithm) == (arm, algorithm)]
    found = {c: [analysis.differences(outcomes, c, e) for e in ENDPOINTS] for c in contrasts}
    parts = [_tests(part.title, found)]
    if known := _compared(found):
        finals = {robot: {(c.first, c.second): found[c][0][robot] for c in contrasts} for robot in known}

        def draw(narrow: bool) -> Figure:
            label = "difference of mean final returns"
            return difference_panels(finals, xlabel=label, narrow=narrow, noted=False)

        alt = f"Differences of mean final returns ({part.title}), a panel per robot: " + ". ".join(
            f"{pair_name(c)} on {robot}: {spoken(found[c][0][robot].difference)}"
            for c in contrasts
            for robot in known
        )
        caption = (
            f"Differences of mean final returns ({part.title}), a panel per robot. {difference_note(finals)}"
        )
        parts = [html.figure_of(draw, alt, caption), *parts]
    gone = sum(int(outcome.diverged.sum()) for _, _, outcome in part.finished())
    if not gone:
        said = html.paragraph("No seed diverged here, so leaving such seeds out changes no number.")
        return part.shown("differences", *parts, said)
    fewer = {
        c: [analysis.differences(outcomes, c, e, without_diverged=True) for e in ENDPOINTS] for c in contrasts
    }
    return part.shown(
        "differences",
        *parts,
        html.paragraph(
            f"Seeds that diverged: {gone}. Above they count with their last return; without them:"
        ),
        _means_without_diverged(part),
        _tests(f"{part.title}, without seeds that diverged", fewer),
    )


Differences: TypeAlias = Mapping[Contrast, Sequence[Mapping[str, Comparison]]]
"""By contrast: for each of `ENDPOINTS`, the final return first, the comparison on each robot."""


def _compared(found: Differences) -> list[str]:
    """Return the robots of which at least two cells to be compared are finished."""
    return [robot for robot in ROBOTS if any(by[0][robot].difference for by in found.values())]


def _tests(title: str, found: Differences) -> str:
    """Return the table of differences."""
    known = _compared(found)
    if not known:
        return html.missing("missing: of no robot are two cells to be compared finished.")
    rows = [
        [robot, pair_name(c), *(word for by_robot in by for word in _told(by_robot[robot]))]
        for c, by in found.items()
        for robot in known
    ]
    head = [
        "robot",
        "difference",
        *(word for name in HEADS.values() for word in (name, "verdict", "p, Holm")),
    ]
    caption = (
        f"Differences of means ({title}): in brackets "
        f"a {percent(LEVEL)} bootstrap interval; p of a permutation test, corrected over the six robots (Holm). "
        f"Unresolved: the interval contains 0, which is no evidence of equality.{_unfinished(known)}"
    )
    return html.table(caption, head, rows, words=(0, 1, 3, 6, 9))


def _told(comparison: Comparison) -> tuple[str, str, str]:
    p = p_value(comparison.p_adjusted) if comparison.difference else ""
    return spoken(comparison.difference), verdict(comparison), p


def _means_without_diverged(part: Part) -> str:
    """Return the table of the cells in which seeds diverged, without those seeds."""
    rows = []
    for robot, label, outcome in part.finished():
        if outcome.diverged.any():
            found = [analysis.estimate(outcome, e, without_diverged=True) for e in ENDPOINTS]
            rows.append([robot, label, *map(spoken, found), str(int((~outcome.diverged).sum()))])
    caption = f"Means of the cells concerned ({part.title}), without seeds that diverged."
    return html.table(caption, ["robot", "family", *HEADS.values(), "seeds"], rows, words=(0, 1))


_DIAGNOSTICS: Mapping[str, str] = {
    "action_std": "spread of executed actions [half range]",
    "saturation": "saturation",
    "explained_variance": "explained variance",
    "kl": "KL [nats]",
    "entropy": "entropy [nats]",
}


def inside(outcomes: Outcomes, arm: str, algorithm: str) -> Shown:
    """Return the table of what happened inside: noise, saturation, clamps, KL, entropy."""
    part = Part.of(outcomes, arm, algorithm)
    if not part.begun:
        return part.missing("inside")
    head = ["robot", "family", *_DIAGNOSTICS.values(), "at a clamp"]
    rows = []
    for robot, label, outcome in part.finished():
        numbers = [_first_and_last(outcome.measured[name]) for name in _DIAGNOSTICS]
        rows.append([robot, label, *numbers, _first_and_last(_share_at_a_clamp(outcome.measured))])
    caption = (
        f"What happened inside ({part.title}): medians over seeds, of the first epoch → of the last five "
        "measurements. Spread, saturation and clamps of the first epoch are the untrained policy's: its noise. Later "
        "most of the spread is the policy's own movement. These numbers describe; they decide nothing."
    )
    return part.shown("inside", html.table(caption, head, rows, words=(0, 1)))


def _share_at_a_clamp(measured: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the share of a law's clamped parameters that stand at a clamp: of log σ, or of α and β together."""
    shares: dict[str, np.ndarray] = {}
    for name, share in measured.items():
        if name.startswith("at_"):
            parameter = name.removesuffix("_min").removesuffix("_max")
            shares[parameter] = shares.get(parameter, 0.0) + share
    return np.mean(list(shares.values()), axis=0)


def _first_and_last(values: np.ndarray) -> str:
    first, last = values[:, 0], values[:, -LAST_EVALUATIONS:].mean(1)
    return " → ".join(f"{np.nanmedian(x):.3g}" if np.isfinite(x).any() else "–" for x in (first, last))


def ways(outcomes: Outcomes, arm: str = "standard") -> Shown:
    """Return the returns of an arm's final policies by way to act, where they were kept."""
    finished = [outcomes.finished[cell.id] for cell in ARMS[arm] if cell.id in outcomes.finished]
    kept = [outcome for outcome in finished if outcome.ways]
    if not kept:
        return html.of_study("ways to act", html.missing("missing: no cell is finished."))
    names = list(dict.fromkeys(way for outcome in kept for way in outcome.ways))
    rows = [
        [o.cell.robot, o.cell.algorithm.upper(), LOOKS[o.cell.family].label]
        + [spoken(analysis.by_way(o).get(way)) for way in names]
        for o in kept
    ]
    caption = (
        f"Final policies by way to act ({ARM_NAMES[arm]}): "
        "mean return of ten episodes per seed from the same starts, over seeds."
    )
    return html.of_study(
        "ways to act", html.table(caption, ["robot", "algorithm", "family", *names], rows, (0, 1, 2))
    )
