"""What the study's figures share: panels, one legend, the note below, and words for what is missing."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from inbounds.book.drawing.figures import LOOKS, WIDTH, family_style
from inbounds.study.statistics import Estimate
from inbounds.study.words import percent

NARROW = 3.4
"""Width of a figure on a phone in inches: 340 CSS pixels, which a page of 360 shows a little smaller."""
SMALL = 11.0
"""Font size of notes, in points."""


def families_in(panels: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return the families of all panels in the book's order, or say that one is unknown."""
    named = {family for cells in panels for family in cells}
    for family in named:
        family_style(family)
    if not named:
        raise ValueError("nothing to draw: pass at least one policy family, None where it is missing")
    return [family for family in LOOKS if family in named]


def panel_grid(
    titles: list[str], row_height: float, *, sharey: bool = False, narrow: bool = False
) -> tuple[Figure, list[Any]]:
    """Return a figure of titled panels, two a row (one where there is one, or on a phone), without empty ones."""
    if not titles:
        raise ValueError("nothing to draw: pass at least one panel")
    columns = 1 if narrow else min(2, len(titles))
    rows = -(-len(titles) // columns)
    fig, axes = plt.subplots(
        rows,
        columns,
        squeeze=False,
        sharey=sharey,
        figsize=(NARROW if narrow else WIDTH, 1.3 + row_height * rows),
    )
    panels = list(axes.flat)
    for ax in panels[len(titles) :]:
        ax.remove()
    for ax, title in zip(panels, titles, strict=False):
        ax.set_title(title)
    return fig, panels[: len(titles)]


def lowest(axes: list[Any], *, narrow: bool = False) -> list[Any]:
    """Return the panels with none below them."""
    return axes[-1:] if narrow else axes[-2:]


def left_out(estimate: Estimate) -> str:
    """Say how many seeds count, how many of them diverged and how many do not count; nothing where all is well."""
    remarks = [
        f"{estimate.diverged} diverged" if estimate.diverged else "",
        f"{estimate.missing} left out" if estimate.missing else "",
    ]
    return ", ".join(filter(None, [f"n = {estimate.n}", *remarks])) if any(remarks) else ""


def list_gaps(ax: Any, cells: Mapping[str, Estimate | None], *, at_left: bool = True) -> None:
    """Write into a panel which families are missing, and which lost seeds: at the left on room made for it."""
    lines = [
        f"{LOOKS[family].label}: {left_out(estimate) if estimate else 'missing'}"
        for family, estimate in cells.items()
        if estimate is None or left_out(estimate)
    ]
    if lines:
        ax.text(
            0.03 if at_left else 0.98, 0.98, "\n".join(lines), transform=ax.transAxes, va="top",
            ha="left" if at_left else "right", fontsize=10, style="italic",
        )  # fmt: skip
    if lines and at_left:
        bottom, top = ax.get_ylim()
        ax.set_ylim(bottom, top + 0.12 * len(lines) * (top - bottom))


def without_scale(ax: Any, axis: Literal["x", "both"]) -> None:
    """Take the numbers off a panel that has nothing to be read against them."""
    ax.tick_params(axis=axis, length=0, labelbottom=False, labelleft=False)
    ax.grid(visible=False, axis=axis)


def family_legend(fig: Figure, families: list[str], *, narrow: bool = False) -> None:
    """Put one legend above all panels, of every family that has a place in the figure."""
    handles = [plt.Line2D([], [], marker=LOOKS[family].marker, **family_style(family)) for family in families]
    fig.legend(
        handles=handles,
        loc="outside upper center",
        ncols=1 if narrow else 2 if len(families) in (2, 4) else 3,
    )


def note_of(mark: str, band: str, drawn: Sequence[Estimate], where: str, remark: str = "") -> str:
    """Say what is drawn, what the interval is, and of how many seeds: one kind a figure."""
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
        short = min((estimate.ceiling for estimate in drawn), default=1.0)
        limit = f" (so few seeds cover {percent(short, 1)} at most)" if short < level else ""
        text = (
            f"{mark}: {statistic}. {band}: {percent(level)} bootstrap interval{where}{limit}.{count} {remark}"
        )
    return text.strip()


def note(fig: Figure, text: str, *, narrow: bool = False) -> None:
    """Write below the panels what is drawn."""
    # A legend of nothing but its title: the layout engine keeps room for it below the panels.
    fig.legend(
        handles=[],
        title=textwrap.fill(text, 40 if narrow else 80),
        title_fontsize=SMALL,
        loc="outside lower left",
    )
