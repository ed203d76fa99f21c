"""How the study is drawn: learning curves, intervals, differences, performance profiles.

Every figure says what its band or bar is and how many seeds it rests on, below its panels or, `noted=False`, in a
caption (`curve_note` and its like); a seed that diverged or was left out is counted beside its curve, and a cell that
was not run, or not finished, keeps its place and is called missing. Data come in as the results of
`inbounds.study.statistics`; nothing here reads a file or computes a statistic::

    curves = {"Hopper-v5": {"beta": Curve(steps, learning_curve(returns, rng)), "logit-normal": None}}
    figures.show(learning_curves(curves), alt="Return against environment steps: ...")
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from inbounds.book.drawing.figures import LOOKS, family_style, use_style
from inbounds.book.report.profile_figures import performance_profiles, profile_note
from inbounds.book.report.study_panels import (
    SMALL,
    families_in,
    family_legend,
    left_out,
    list_gaps,
    lowest,
    note,
    note_of,
    panel_grid,
    without_scale,
)
from inbounds.study.statistics import Comparison, Estimate
from inbounds.study.words import p_equals, verdict

__all__ = [
    "Curve",
    "curve_note",
    "difference_note",
    "difference_panels",
    "interval_note",
    "interval_panels",
    "learning_curves",
    "performance_profiles",
    "profile_note",
]

_QUIET = "#5F6770"
_NOT_PLANNED = "not planned"
SHORT = {"gaussian": "Gaussian", "clipped-gaussian": "CAPG", "beta": "Beta", "logit-normal": "Logit-normal"}
"""Names where there is little room."""


@dataclass(frozen=True)
class Curve:
    """A learning curve over seeds.

    Drawn by `learning_curves`, which has an example.
    """

    steps: NDArray[np.float64]
    """`[E]` environment steps of each seed at the end of each epoch."""
    estimate: Estimate
    """`[E]` return and its band."""


def learning_curves(
    curves: Mapping[str, Mapping[str, Curve | None]],
    *,
    ylabel: str = "return",
    narrow: bool = False,
    noted: bool = True,
) -> Figure:
    """Draw learning curves with bands: a panel per environment, a line per policy family.

    Args:
        curves: per environment and family (a key of `LOOKS`) its curve, or None where the cell is missing.
        ylabel: what the curves show.
        narrow: one panel below the other, for a phone.
        noted: with `curve_note` below the panels.

    Returns:
        The figure; each panel has its own vertical scale, for returns of different robots share no unit.

    Raises:
        ValueError: nothing to draw, an unknown family, or steps and returns of different lengths.

    Example:
        >>> import numpy as np
        >>> from inbounds.book.report.study_figures import Curve
        >>> from inbounds.study.statistics import learning_curve
        >>> steps, rng = 2048.0 * np.arange(1, 6), np.random.default_rng(0)
        >>> curve = Curve(steps, learning_curve(rng.normal(size=(10, 5)), rng))
        >>> fig = learning_curves({"Hopper-v5": {"beta": curve, "logit-normal": None}})
        >>> [text.get_text() for text in fig.axes[0].texts]
        ['Logit-normal: missing']
    """
    families = families_in(curves.values())
    with use_style():
        fig, axes = panel_grid(list(curves), row_height=2.55, narrow=narrow)
        for ax, cells in zip(axes, curves.values(), strict=True):
            for family, curve in cells.items():
                if curve is not None:
                    _curve(ax, family, curve)
            list_gaps(ax, {family: c.estimate if c else None for family, c in cells.items()})
            ax.yaxis.set_major_locator(MaxNLocator(5))
            ax.xaxis.set_major_locator(MaxNLocator(5))
            if not any(cells.values()):
                without_scale(ax, "both")
        fig.supylabel(ylabel, fontsize=13)
        for ax in lowest(axes, narrow=narrow):
            ax.set_xlabel("env steps per seed [millions]", fontsize=SMALL)
        family_legend(fig, families, narrow=narrow)
        if noted:
            note(fig, curve_note(curves), narrow=narrow)
    return fig


def curve_note(curves: Mapping[str, Mapping[str, Curve | None]]) -> str:
    """Say what line and band of learning curves are, and of how many seeds."""
    drawn = [c.estimate for cells in curves.values() for c in cells.values() if c is not None]
    return note_of("Line", "Band", drawn, ", at each epoch by itself")


def _curve(ax: Any, family: str, curve: Curve) -> None:
    """Draw one line and its band; the marker's first place depends on the family, so that none hides another."""
    value = np.asarray(curve.estimate.value)
    if value.ndim != 1 or len(value) != len(curve.steps):
        raise ValueError(
            f"{family}: {len(curve.steps)} steps for returns of shape {value.shape}: expected one return an epoch"
        )
    every = max(1, len(value) // 5)
    style = family_style(family)
    millions = np.asarray(curve.steps) / 1e6
    ax.fill_between(
        millions, curve.estimate.low, curve.estimate.high, color=style["color"], alpha=0.18, linewidth=0
    )
    first = list(LOOKS).index(family) * every // len(LOOKS)
    ax.plot(millions, value, marker=LOOKS[family].marker, markevery=(first, every), linewidth=1.8, **style)


def interval_panels(
    panels: Mapping[str, Mapping[str, Estimate | None]],
    *,
    xlabel: str = "mean return over the last 10 % of epochs",
    reference: float | None = None,
    narrow: bool = False,
    noted: bool = True,
) -> Figure:
    """Draw point estimates with interval bars: a panel per environment (or aggregate), a row per policy family.

    Args:
        panels: per panel and family its estimate, or None where the cell is missing; a family that one panel names
            and another does not keeps its row there, as not planned.
        xlabel: what is estimated, with its unit.
        reference: where to draw a vertical line, such as 0 for differences.
        narrow: one panel below the other, for a phone.
        noted: with `interval_note` below the panels.

    Returns:
        The figure; a hollow marker means that seeds were left out, and the row says how many.

    Raises:
        ValueError: nothing to draw, an unknown family, or an estimate that is an array.

    Example:
        >>> import numpy as np
        >>> from inbounds.study.statistics import bootstrap
        >>> scores = bootstrap([1.0, 2.0, 3.0, 4.0], np.random.default_rng(0))
        >>> fig = interval_panels({"Ant-v5": {"gaussian": scores, "beta": None}})
        >>> [label.get_text() for label in fig.axes[0].get_yticklabels()]
        ['Gaussian, clipped', 'Beta']
    """
    families = families_in(panels.values())
    rows = {f: (SHORT[f] if narrow else LOOKS[f].label, f) for f in families}
    cells = {
        title: {f: _Row(given.get(f), "" if f in given else _NOT_PLANNED) for f in families}
        for title, given in panels.items()
    }
    return _bars(cells, rows, xlabel, reference, interval_note(panels) if noted else "", narrow=narrow)


def interval_note(panels: Mapping[str, Mapping[str, Estimate | None]]) -> str:
    """Say what marker and bar of point estimates are, and of how many seeds."""
    drawn = [estimate for given in panels.values() for estimate in given.values() if estimate]
    return note_of(
        "Marker", "Bar", drawn, "", "Hollow: seeds are left out." if any(e.missing for e in drawn) else ""
    )


def difference_panels(
    panels: Mapping[str, Mapping[tuple[str, str], Comparison]],
    *,
    xlabel: str = "difference of returns",
    narrow: bool = False,
    noted: bool = True,
) -> Figure:
    """Draw differences between families with interval bars: a panel per environment, a row per pair.

    Args:
        panels: per environment and pair (first, second) of families their comparison, first minus second.
        xlabel: what the difference is of, with its unit.
        narrow: one panel below the other, for a phone.
        noted: with `difference_note` below the panels.

    Returns:
        The figure, with a line at zero; right of each row stands the p-value after Holm's correction. A marker is
        filled where the interval leaves out 0 and the corrected test finds the difference, else hollow.

    Raises:
        ValueError: nothing to draw, or an unknown family.

    Example:
        >>> import numpy as np
        >>> from inbounds.study.statistics import compare
        >>> a, b = {"Ant-v5": [5.0, 6.0, 7.0]}, {"Ant-v5": [1.0, 2.0, 4.0]}
        >>> row = compare(a, b, np.random.default_rng(0))["Ant-v5"]
        >>> fig = difference_panels({"Ant-v5": {("beta", "gaussian"): row}})
        >>> fig.axes[0].get_yticklabels()[0].get_text().splitlines()
        ['Beta', '− Gaussian']
    """
    pairs = list(dict.fromkeys(pair for cells in panels.values() for pair in cells))
    for family in {family for pair in pairs for family in pair}:
        family_style(family)
    rows = {pair: (f"{SHORT[pair[0]]}\n− {SHORT[pair[1]]}", pair[0]) for pair in pairs}
    cells = {
        title: {
            pair: _Row(
                row.difference, p_equals(row.p_adjusted), hollow=verdict(row) not in ("higher", "lower")
            )
            if (row := given.get(pair))
            else _Row(None)
            for pair in pairs
        }
        for title, given in panels.items()
    }
    return _bars(cells, rows, xlabel, 0.0, difference_note(panels) if noted else "", narrow=narrow)


def difference_note(panels: Mapping[str, Mapping[tuple[str, str], Comparison]]) -> str:
    """Say what marker and bar of differences are, of how many seeds, and what p is."""
    drawn = [row.difference for given in panels.values() for row in given.values() if row.difference]
    said = (
        "Filled: the interval leaves out 0, and the test finds the difference. Hollow: not. p: permutation test of "
        "the means, after Holm's correction over the robots."
    )
    return note_of("Marker", "Bar", drawn, "", said)


@dataclass(frozen=True)
class _Row:
    """One row of `_bars`."""

    estimate: Estimate | None
    remark: str = ""
    """Right of its panel."""
    hollow: bool = False


def _bars(
    cells: Mapping[str, Mapping[Any, _Row]],
    rows: Mapping[Any, tuple[str, str]],
    xlabel: str,
    reference: float | None,
    below: str,
    *,
    narrow: bool = False,
) -> Figure:
    """Draw interval bars; `rows` gives each row's label and the family whose look it wears, `below` a note."""
    with use_style():
        fig, axes = panel_grid(list(cells), row_height=0.8 + 0.52 * len(rows), sharey=True, narrow=narrow)
        for ax, given in zip(axes, cells.values(), strict=True):
            for place, (key, row) in enumerate(given.items()):
                _bar(ax, place, rows[key][1], row)
            if any(row.estimate for row in given.values()):
                if reference is not None:
                    ax.axvline(reference, color=_QUIET, linewidth=1.2, zorder=1)
            else:
                without_scale(ax, "x")
            ax.set_ylim(len(rows) - 0.4, -0.75)
            ax.set_yticks(range(len(rows)), [label for label, _ in rows.values()])
            ax.tick_params(axis="y", length=0)
            ax.grid(visible=False, axis="y")
            ax.margins(x=0.12)
            ax.xaxis.set_major_locator(MaxNLocator(3))
        # One label for all panels; below them it would lie on the note, which the layout engine places there.
        fig.suptitle(textwrap.fill(xlabel[:1].upper() + xlabel[1:], 32 if narrow else 80), fontsize=13)
        if below:
            note(fig, below, narrow=narrow)
    return fig


def _bar(ax: Any, place: int, family: str, row: _Row) -> None:
    """Draw one row: marker, interval, right of the panel its remark, and in words what is not as it should be."""
    estimate = row.estimate
    beside: dict[str, Any] = {
        "transform": ax.get_yaxis_transform(), "ha": "left", "va": "center", "fontsize": 10,
    }  # fmt: skip
    if estimate is None:
        ax.text(1.02, place, row.remark or "missing", style="italic", color=_QUIET, **beside)
        return
    if row.remark:
        ax.text(1.02, place, row.remark, **beside)
    value, low, high = (np.asarray(x) for x in (estimate.value, estimate.low, estimate.high))
    if value.ndim:
        raise ValueError(f"expected one number a row, got an estimate of shape {value.shape}")
    look = LOOKS[family]
    ax.plot([low, high], [place, place], color=look.color, linewidth=2.2, linestyle="-")
    ax.plot(
        value, place, look.marker, color=look.color, markersize=8, markeredgewidth=1.8,
        markerfacecolor="white" if row.hollow or estimate.missing else look.color,
    )  # fmt: skip
    if words := left_out(estimate):
        ax.text(
            0.99, place - 0.2, words, transform=ax.get_yaxis_transform(), ha="right", va="bottom", fontsize=10,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
        )  # fmt: skip
