"""How the study is drawn: learning curves, intervals, differences, performance profiles.

Every figure says what its band or bar is and how many seeds it rests on; a seed that was left out is counted beside
its curve, and a cell that was not run, or not finished, keeps its place and is called missing. Data come in as the
results of `inbounds.study.statistics`; nothing here reads a file or computes a statistic::

    curves = {"Hopper-v5": {"beta": Curve(steps, learning_curve(returns, rng)), "logit-normal": None}}
    figures.show(learning_curves(curves), alt="Return against environment steps: ...")
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter
from numpy.typing import NDArray

from inbounds.book.figures import FAMILIES, WIDTH, family_style, use_style
from inbounds.study.statistics import Comparison, Estimate, Profile

__all__ = ["Curve", "difference_panels", "interval_panels", "learning_curves", "performance_profiles"]

_QUIET = "#5F6770"
_SMALL = 11.0  # font size of notes, in points
_SHORT = {"gaussian": "Gaussian", "clipped-gaussian": "CAPG", "beta": "Beta", "logit-normal": "Logit-normal"}


@dataclass(frozen=True)
class Curve:
    """A learning curve over seeds."""

    steps: NDArray[np.float64]
    """`[E]` environment steps of each seed at the end of each epoch."""
    estimate: Estimate
    """`[E]` return and its band."""


def learning_curves(curves: Mapping[str, Mapping[str, Curve | None]], *, ylabel: str = "return") -> Figure:
    """Learning curves with bands: a panel per environment, a line per policy family.

    Args:
        curves: per environment and family (a key of `FAMILIES`) its curve, or None where the cell is missing.
        ylabel: what the curves show.

    Returns:
        The figure; each panel has its own vertical scale, for returns of different robots share no unit.

    Raises:
        ValueError: nothing to draw, an unknown family, or steps and returns of different lengths.

    Example:
        >>> from inbounds.study.statistics import learning_curve
        >>> steps, rng = 2048.0 * np.arange(1, 6), np.random.default_rng(0)
        >>> curve = Curve(steps, learning_curve(rng.normal(size=(10, 5)), rng))
        >>> fig = learning_curves({"Hopper-v5": {"beta": curve, "logit-normal": None}})
        >>> [text.get_text() for text in fig.axes[0].texts]
        ['Logit-normal: missing']
    """
    families = _families(curves.values())
    with use_style():
        fig, axes = _grid(list(curves), row_height=2.55)
        for ax, cells in zip(axes, curves.values(), strict=True):
            for family, curve in cells.items():
                if curve is not None:
                    _curve(ax, family, curve)
            _list_gaps(ax, {family: c.estimate if c else None for family, c in cells.items()})
            ax.yaxis.set_major_locator(MaxNLocator(5))
            ax.xaxis.set_major_locator(MaxNLocator(5))
        fig.supylabel(ylabel, fontsize=13)
        for ax in _lowest(axes):
            ax.set_xlabel("environment steps [millions]")
        _legend(fig, families)
        drawn = [c.estimate for cells in curves.values() for c in cells.values() if c is not None]
        _note(fig, "Line", "Band", drawn, ", at each epoch by itself")
    return fig


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
    first = list(FAMILIES).index(family) * every // len(FAMILIES)
    ax.plot(millions, value, marker=FAMILIES[family].marker, markevery=(first, every), linewidth=1.8, **style)


def interval_panels(
    panels: Mapping[str, Mapping[str, Estimate | None]],
    *,
    xlabel: str = "mean return over the last 10 % of epochs",
    reference: float | None = None,
) -> Figure:
    """Point estimates with interval bars: a panel per environment (or aggregate), a row per policy family.

    Args:
        panels: per panel and family its estimate, or None where the cell is missing.
        xlabel: what is estimated, with its unit.
        reference: where to draw a vertical line, such as 0 for differences.

    Returns:
        The figure; a hollow marker means that seeds were left out, and the row says how many.

    Raises:
        ValueError: nothing to draw, an unknown family, or an estimate that is an array.

    Example:
        >>> from inbounds.study.statistics import bootstrap
        >>> scores = bootstrap([1.0, 2.0, 3.0, 4.0], np.random.default_rng(0))
        >>> fig = interval_panels({"Ant-v5": {"gaussian": scores, "beta": None}})
        >>> [label.get_text() for label in fig.axes[0].get_yticklabels()]
        ['Gaussian, clipped', 'Beta']
    """
    families = _families(panels.values())
    rows = {family: (FAMILIES[family].label, family) for family in families}
    cells = {title: {f: (rows_of.get(f), "") for f in families} for title, rows_of in panels.items()}
    return _bars(cells, rows, xlabel, reference)


def difference_panels(
    panels: Mapping[str, Mapping[tuple[str, str], Comparison]],
    *,
    xlabel: str = "difference of returns",
) -> Figure:
    """Differences between families with interval bars: a panel per environment, a row per pair.

    Args:
        panels: per environment and pair (first, second) of families their comparison, first minus second.
        xlabel: what the difference is of, with its unit.

    Returns:
        The figure, with a line at zero; beside each bar stands the p-value after Holm's correction.

    Raises:
        ValueError: nothing to draw, or an unknown family.

    Example:
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
    rows = {pair: (f"{_SHORT[pair[0]]}\n− {_SHORT[pair[1]]}", pair[0]) for pair in pairs}
    cells = {
        title: {
            pair: (row.difference, _p_value(row.p_adjusted)) if (row := given.get(pair)) else (None, "")
            for pair in pairs
        }
        for title, given in panels.items()
    }
    return _bars(
        cells,
        rows,
        xlabel,
        reference=0.0,
        remark="p: permutation test of the means, after Holm's correction over environments.",
    )


def _p_value(p: float) -> str:
    return "" if np.isnan(p) else "p < 0.001" if p < 0.001 else f"p = {p:.3f}" if p < 0.1 else f"p = {p:.2f}"


def _bars(
    cells: Mapping[str, Mapping[Any, tuple[Estimate | None, str]]],
    rows: Mapping[Any, tuple[str, str]],
    xlabel: str,
    reference: float | None,
    remark: str = "",
) -> Figure:
    """Draw interval bars; `rows` gives each row's label and the family whose look it wears."""
    with use_style():
        fig, axes = _grid(list(cells), row_height=0.8 + 0.52 * len(rows), sharey=True)
        for ax, given in zip(axes, cells.values(), strict=True):
            for place, (key, (estimate, remark_here)) in enumerate(given.items()):
                _bar(ax, place, rows[key][1], estimate, remark_here)
            if reference is not None:
                ax.axvline(reference, color=_QUIET, linewidth=1.2, zorder=1)
            ax.set_ylim(len(rows) - 0.4, -0.75)
            ax.set_yticks(range(len(rows)), [label for label, _ in rows.values()])
            ax.tick_params(axis="y", length=0)
            ax.grid(visible=False, axis="y")
            ax.margins(x=0.12)
            ax.xaxis.set_major_locator(MaxNLocator(3))
        # One label for all panels; below them it would lie on the note, which the layout engine places there.
        fig.suptitle(xlabel[:1].upper() + xlabel[1:], fontsize=13)
        drawn = [estimate for given in cells.values() for estimate, _ in given.values() if estimate]
        _note(fig, "Marker", "Bar", drawn, "", remark)
    return fig


def _bar(ax: Any, place: int, family: str, estimate: Estimate | None, remark: str) -> None:
    """Draw one row: marker, interval, and in words what is not as it should be."""
    if estimate is None:
        ax.text(
            0.5, place, "missing", transform=ax.get_yaxis_transform(), ha="center", va="center",
            style="italic", color=_QUIET, fontsize=_SMALL,
        )  # fmt: skip
        return
    value, low, high = (np.asarray(x) for x in (estimate.value, estimate.low, estimate.high))
    if value.ndim:
        raise ValueError(f"expected one number a row, got an estimate of shape {value.shape}")
    look = FAMILIES[family]
    ax.plot([low, high], [place, place], color=look.color, linewidth=2.2, linestyle="-")
    ax.plot(
        value, place, look.marker, color=look.color, markersize=8, markeredgewidth=1.8,
        markerfacecolor="white" if estimate.missing else look.color,
    )  # fmt: skip
    words = ", ".join(filter(None, [remark, _left_out(estimate)]))
    if words:
        ax.text(
            0.5, place - 0.2, words, transform=ax.get_yaxis_transform(), ha="center", va="bottom", fontsize=10,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
        )  # fmt: skip


def performance_profiles(
    profiles: Mapping[str, Profile | None], *, xlabel: str = "normalised score τ"
) -> Figure:
    """Performance profiles with bands: the share of runs that score more than τ, a line per policy family.

    Args:
        profiles: per family its profile, or None where it is missing.
        xlabel: what τ is, and how it is normalised.

    Returns:
        The figure.

    Raises:
        ValueError: nothing to draw, or an unknown family.

    Example:
        >>> from inbounds.study.statistics import performance_profile
        >>> taus, rng = np.linspace(0, 1, 5), np.random.default_rng(0)
        >>> fig = performance_profiles({"beta": performance_profile({"Ant-v5": rng.random(10)}, taus, rng)})
        >>> fig.axes[0].get_xlabel()
        'normalised score τ'
    """
    families = _families([profiles])
    with use_style():
        fig, ax = plt.subplots(figsize=(WIDTH, 4.6))
        for family, profile in profiles.items():
            if profile is not None:
                style = family_style(family)
                tau, share = profile.thresholds, profile.share
                ax.fill_between(tau, share.low, share.high, color=style["color"], alpha=0.18, linewidth=0)
                every = max(1, len(tau) // 5)
                first = list(FAMILIES).index(family) * every // len(FAMILIES)
                ax.plot(
                    tau,
                    share.value,
                    marker=FAMILIES[family].marker,
                    markevery=(first, every),
                    linewidth=1.8,
                    **style,
                )
        _list_gaps(ax, {family: p.share if p else None for family, p in profiles.items()}, at_left=False)
        ax.set(xlabel=xlabel, ylabel="share of runs above τ", ylim=(-0.02, 1.02))
        ax.yaxis.set_major_formatter(PercentFormatter(xmax=1.0, decimals=0))
        _legend(fig, families)
        _note(fig, "Line", "Band", [p.share for p in profiles.values() if p], ", at each τ by itself")
    return fig


# --- what the figures share --------------------------------------------------------------------------------------


def _families(panels: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return the families of all panels in the book's order, or say that one is unknown."""
    named = {family for cells in panels for family in cells}
    for family in named:
        family_style(family)
    if not named:
        raise ValueError("nothing to draw: pass at least one policy family, None where it is missing")
    return [family for family in FAMILIES if family in named]


def _grid(titles: list[str], row_height: float, *, sharey: bool = False) -> tuple[Figure, list[Any]]:
    """Return a figure of titled panels, two a row (one where there is one), without empty ones."""
    if not titles:
        raise ValueError("nothing to draw: pass at least one panel")
    columns = min(2, len(titles))
    rows = -(-len(titles) // columns)
    fig, axes = plt.subplots(
        rows, columns, squeeze=False, sharey=sharey, figsize=(WIDTH, 1.3 + row_height * rows)
    )
    panels = list(axes.flat)
    for ax in panels[len(titles) :]:
        ax.remove()
    for ax, title in zip(panels, titles, strict=False):
        ax.set_title(title)
    return fig, panels[: len(titles)]


def _lowest(axes: list[Any]) -> list[Any]:
    """Return the panels with none below them."""
    return axes[-2:] if len(axes) > 1 else axes


def _left_out(estimate: Estimate) -> str:
    return f"n = {estimate.n}, {estimate.missing} left out" if estimate.missing else ""


def _list_gaps(ax: Any, cells: Mapping[str, Estimate | None], *, at_left: bool = True) -> None:
    """Write into a panel which families are missing, and which lost seeds: at the left on room made for it."""
    lines = [
        f"{FAMILIES[family].label}: {_left_out(estimate) if estimate else 'missing'}"
        for family, estimate in cells.items()
        if estimate is None or estimate.missing
    ]
    if lines:
        ax.text(
            0.03 if at_left else 0.98, 0.98, "\n".join(lines), transform=ax.transAxes, va="top",
            ha="left" if at_left else "right", fontsize=10, style="italic",
        )  # fmt: skip
    if lines and at_left:
        bottom, top = ax.get_ylim()
        ax.set_ylim(bottom, top + 0.12 * len(lines) * (top - bottom))


def _legend(fig: Figure, families: list[str]) -> None:
    """One legend above all panels, of every family that has a place in the figure."""
    handles = [
        plt.Line2D([], [], marker=FAMILIES[family].marker, **family_style(family)) for family in families
    ]
    fig.legend(handles=handles, loc="outside upper center", ncols=2 if len(families) in (2, 4) else 3)


def _note(fig: Figure, mark: str, band: str, drawn: list[Estimate], where: str, remark: str = "") -> None:
    """Say below the panels what is drawn, what the interval is, and of how many seeds: one kind a figure."""
    kinds = sorted({(estimate.statistic, estimate.level) for estimate in drawn})
    if len(kinds) > 1:
        raise ValueError(f"one figure, one statistic and one level; got {kinds}: draw them apart")
    text = "No cell is complete yet."
    for statistic, level in kinds:
        whole = sorted({estimate.n for estimate in drawn if not estimate.missing})
        seeds = " to ".join(map(str, dict.fromkeys([whole[0], whole[-1]]))) if whole else ""
        count = (
            f" n = {seeds} seeds{' unless noted' if any(e.missing for e in drawn) else ''}." if seeds else ""
        )
        text = f"{mark}: {statistic}. {band}: {level:.0%} bootstrap interval{where}.{count} {remark}"
    # A legend of nothing but its title: the layout engine keeps room for it below the panels.
    fig.legend(
        handles=[], title=textwrap.fill(text.strip(), 88), title_fontsize=_SMALL, loc="outside lower left"
    )
