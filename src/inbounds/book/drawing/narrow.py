"""The shape in which a phone shows a figure: as wide as the screen, its panels one below the other.

`rearrange` changes a figure that is drawn already, so that no chapter draws its figures twice. Where the result could
not be read (labels on one another, a legend over its panel), it says so, and the page scrolls the wide figure.
"""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import GridSpec, SubplotSpec
    from matplotlib.legend import Legend
    from matplotlib.text import Text

WIDTH = 4.4
"""Width in inches: 440 CSS pixels, of which a phone of 390 shows four fifths."""
TALLEST_PANEL = 3.2
"""Height in inches of one of several panels, with its labels, at most."""
MOST_IN_A_COLUMN = 4
"""More panels than these stand in two columns."""
LONGEST_LINE = 36
"""Characters of a title in one column."""
LARGEST_LEGEND = (0.8, 0.55)
"""Of a panel's width and height: what a legend inside it may take."""


def rearrange(fig: Figure) -> bool:
    """Give a wide figure the shape of a phone, in place; whether it can be read so. Either way the wide shape is lost.

    Example:
        >>> import matplotlib.pyplot as plt
        >>> fig, axes = plt.subplots(1, 3, figsize=(6.8, 3), layout="constrained")
        >>> rearrange(fig), fig.get_size_inches().tolist()
        (True, [4.4, 9.0])
        >>> [ax.get_subplotspec().rowspan.start for ax in axes]
        [0, 1, 2]
        >>> plt.close(fig)
    """
    from matplotlib.gridspec import GridSpec

    panels = _panels(fig)
    if not panels or fig.get_figwidth() <= WIDTH:
        return False
    grid = _spec(panels[0][0]).get_gridspec()
    columns = 1 if len(panels) <= MOST_IN_A_COLUMN else 2
    rows = -(-len(panels) // columns)
    if columns < grid.ncols:
        _regrid(panels, grid, GridSpec(rows, columns, figure=fig))
    height = fig.get_figheight() / grid.nrows
    fig.set_size_inches(WIDTH, height if len(panels) == 1 else rows * min(height, TALLEST_PANEL))
    _wrap(fig.texts, LONGEST_LINE)
    for ax in fig.axes:
        _wrap([ax.title, ax.xaxis.label], LONGEST_LINE // columns)
        _wrap([ax.yaxis.label], LONGEST_LINE * 2 // 3)
    for legend in [*fig.legends]:
        _narrow(fig, legend)
    fig.draw_without_rendering()
    for ax in fig.axes:
        _uncover(fig, ax, alone=len(panels) == 1)
    _wrap([ax.xaxis.label for ax in fig.axes if not within(fig, ax.xaxis.label)], LONGEST_LINE // 2)
    fig.draw_without_rendering()
    return _readable(fig)


def _wrap(texts: Sequence[Text], characters: int) -> None:
    """Break lines anew that are longer."""
    for text in texts:
        if max(map(len, text.get_text().split("\n"))) > characters:
            text.set_text("\n".join(textwrap.wrap(text.get_text(), characters)))


def _panels(fig: Figure) -> list[list[Axes]]:
    """Return the axes of each panel (two, where they are twins) row by row; none, where there is no plain grid."""
    placed = [(ax, spec) for ax in fig.axes if (spec := ax.get_subplotspec()) is not None]
    grids = {id(spec.get_gridspec()) for _, spec in placed}
    if fig.subfigs or len(grids) != 1 or any(spec.num1 != spec.num2 for _, spec in placed):
        return []
    by_place: dict[int, list[Axes]] = {}
    for ax, spec in placed:
        by_place.setdefault(spec.num1, []).append(ax)
    return [by_place[place] for place in sorted(by_place)]


def _spec(ax: Axes) -> SubplotSpec:
    """Return the place of a panel's axes, which have one."""
    spec = ax.get_subplotspec()
    assert spec is not None
    return spec


def _regrid(panels: Sequence[Sequence[Axes]], grid: Any, new: GridSpec) -> None:
    """Put the panels into another grid, each with the title and labels that it shared with a neighbour."""
    leaders = {_spec(ax).rowspan.start: ax for ax, *_ in reversed(panels)}
    titles = {_spec(ax).colspan.start: ax.get_title() for ax, *_ in reversed(panels)}  # of each column's top
    for number, (ax, *twins) in enumerate(panels):
        leader = leaders[_spec(ax).rowspan.start]
        if ax.axison:
            ax.set_title(ax.get_title() or titles[_spec(ax).colspan.start])
        if number % new.ncols == 0 and ax.axison:
            ax.tick_params(labelleft=leader.yaxis.get_tick_params()["labelleft"])
            ax.set_ylabel(ax.get_ylabel() or leader.get_ylabel())
        if grid.nrows > 1 and ax.axison:
            ax.tick_params(labelbottom=True)
        for each in (ax, *twins):
            each.set_subplotspec(new[number // new.ncols, number % new.ncols])


def _narrow(fig: Figure, legend: Any) -> None:
    """Put a legend above or below the panels, in so many columns that the figure is wide enough for it."""
    side = "lower" if legend._outside_loc == "lower" else "upper"
    texts, title = [text.get_text() for text in legend.get_texts()], legend.get_title().get_text()
    bars = {
        each.get_label(): each for ax in fig.axes for each in ax.containers
    }  # whole: a legend keeps parts of them
    handles = [bars.get(text, handle) for text, handle in zip(texts, legend.legend_handles, strict=True)]
    for columns in range(min(legend._ncols, len(texts)) if legend in fig.legends else 2, 0, -1):
        legend.remove()
        legend = fig.legend(handles, texts, loc=f"outside {side} center", ncols=columns, title=title or None)
        fig.draw_without_rendering()
        if legend.get_window_extent().width <= fig.bbox.width:
            return


def _uncover(fig: Figure, ax: Axes, *, alone: bool) -> None:
    """Move a legend that lies on what it explains: within its panel, or above the only one."""
    legend = ax.get_legend()
    if legend is None or not _covers(legend, ax):
        return
    legend.set_loc("best")
    fig.draw_without_rendering()
    if alone and _covers(legend, ax):
        fig.set_figheight(fig.get_figheight() + legend.get_window_extent().height / fig.dpi)
        _narrow(fig, legend)


def _covers(legend: Legend, ax: Axes) -> bool:
    box = legend.get_window_extent()
    lines = (line.get_path().transformed(line.get_transform()) for line in ax.lines if line.get_visible())
    points = (dots.get_offset_transform().transform(dots.get_offsets()) for dots in ax.collections)
    return any(line.intersects_bbox(box, filled=False) for line in lines) or any(
        box.contains(*point) for group in points for point in group
    )


def within(fig: Figure, shown: Artist) -> bool:
    """Whether nothing of a drawn text or legend reaches beyond the figure's edge."""
    box, page = shown.get_window_extent(), fig.bbox
    return page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1


def _readable(fig: Figure) -> bool:
    texts = [*titles_and_labels(fig), *(text for ax in fig.axes for text in ax.texts)]
    inside = all(within(fig, shown) for shown in [*visible(texts), *_legends(fig)])
    ticks = [_boxes(axis.get_ticklabels()) for ax in fig.axes if ax.axison for axis in (ax.xaxis, ax.yaxis)]
    notes = [_boxes(ax.texts) for ax in fig.axes]
    apart = not any(a.overlaps(b) for group in (*ticks, *notes) for a, b in itertools.combinations(group, 2))
    return inside and apart and all(map(_leaves_room, fig.axes))


def _leaves_room(ax: Axes) -> bool:
    """Whether a panel's legend leaves room for what it explains."""
    legend = ax.get_legend()
    if legend is None or not legend.get_visible():
        return True
    box, panel = legend.get_window_extent(), ax.get_window_extent()
    small = box.width <= LARGEST_LEGEND[0] * panel.width and box.height <= LARGEST_LEGEND[1] * panel.height
    return not box.overlaps(panel) or (small and not _covers(legend, ax))


def _legends(fig: Figure) -> list[Legend]:
    return [*fig.legends, *(legend for ax in fig.axes if (legend := ax.get_legend()) is not None)]


def titles_and_labels(fig: Figure) -> list[Text]:
    """Return the titles and labels of a figure's panels, and the texts of the figure itself."""
    return [*(text for ax in fig.axes for text in (ax.title, ax.xaxis.label, ax.yaxis.label)), *fig.texts]


def visible(texts: Iterable[Any]) -> list[Any]:
    """Return those texts that are shown and say something."""
    return [text for text in texts if text.get_visible() and text.get_text().strip()]


def _boxes(texts: Iterable[Any]) -> list[Any]:
    return [text.get_window_extent() for text in visible(texts)]
