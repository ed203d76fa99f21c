"""A forest: differences with their intervals, one group of rows a robot, in place of a wide table.

Differences of several robots share an axis in units of what matters on each (`inbounds.study.second.MARGINS`): within
the grey band a difference is too small to choose by.

    show(forest({"final return": bars}, xlabel="difference, in margins"))
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from inbounds.book.drawing.figures import LOOKS, SHADES, WIDTH, use_style
from inbounds.book.report.study_panels import NARROW
from inbounds.study.grid import ROBOTS
from inbounds.study.statistics import Estimate
from inbounds.study.words import spoken

MARGINS_AS_UNIT = "difference, in fifths of what training adds on the robot"
"""The label of an axis whose unit is the second protocol's margin."""
_QUIET, _BAND = "#5F6770", "#DFE3E8"


@dataclass(frozen=True)
class Series:
    """What one kind of bar looks like, the same in every group.

    Example:
        >>> SERIES["beta"].label
        'Beta − Gaussian'
    """

    label: str
    """In the legend."""
    color: str
    """Of marker and bar."""
    marker: str
    """Of Matplotlib."""


SERIES: Mapping[str, Series] = MappingProxyType(
    {
        **{
            family: Series(f"{name} − Gaussian", LOOKS[family].color, LOOKS[family].marker)
            for family, name in (
                ("beta", "Beta"),
                ("logit-normal", "Logit-normal"),
                ("clipped-gaussian", "CAPG"),
            )
        },
        "gaussian": Series(
            "Gaussian, quiet − usual start", LOOKS["gaussian"].color, LOOKS["gaussian"].marker
        ),
        "logit-normal, beta": Series("Logit-normal − Beta", SHADES[2], "v"),
        "logit-normal, clipped-gaussian": Series(  # in no figure beside the logit-normal minus Gaussian
            "Logit-normal − CAPG", LOOKS["logit-normal"].color, LOOKS["logit-normal"].marker
        ),
        "usual starts": Series("usual starts", SHADES[0], "s"),
        "both quiet": Series("both quiet", SHADES[3], "X"),
        "both loud": Series("both loud", SHADES[1], "D"),
    }
)
"""The differences that the book's forests show, by name."""


@dataclass(frozen=True)
class Bar:
    """One difference.

    Drawn by `forest`, which has an example.
    """

    group: str
    """Where it stands: a robot."""
    series: str
    """A key of `SERIES`."""
    difference: Estimate
    """With its interval."""
    unit: float
    """By which it is divided: the smallest difference that matters there."""
    hollow: bool = False
    """Drawn with an empty marker; the caption says what that means."""

    @property
    def ends(self) -> tuple[float, float, float]:
        """Lower end, value and upper end in its unit."""
        low, value, high = (
            float(x) / self.unit for x in (self.difference.low, self.difference.value, self.difference.high)
        )
        return low, value, high


def forest(
    panels: Mapping[str, Sequence[Bar]],
    *,
    xlabel: str,
    order: Sequence[str] = (),
    narrow: bool = False,
) -> Figure:
    """Draw differences with their intervals, in panels that share their groups.

    Args:
        panels: title → its bars; a group that one panel has, all show.
        xlabel: what the differences are measured in.
        order: of the groups; others follow as they come.
        narrow: one panel below the other, for a phone, in place of side by side.

    Returns:
        The figure, a row a bar, under the names of the groups.

    Raises:
        ValueError: there is nothing to draw.

    Example:
        >>> import numpy as np
        >>> gap = Estimate(np.array(5.0), np.array(2.0), np.array(8.0), 10, 0, 0.95, "difference of means")
        >>> fig = forest({"final return": [Bar("Ant", "beta", gap, unit=2.0)]}, xlabel="in margins")
        >>> [label.get_text() for label in fig.axes[0].get_yticklabels()]
        ['Ant']
        >>> plt.close(fig)
    """
    bars = [bar for found in panels.values() for bar in found]
    if not bars:
        raise ValueError("nothing to draw: pass at least one bar")
    known = dict.fromkeys(bar.group for bar in bars)
    groups = [group for group in dict.fromkeys((*order, *known)) if group in known]
    kinds = [name for name in SERIES if any(bar.series == name for bar in bars)]
    with use_style():
        height = len(groups) * (0.24 + 0.17 * len(kinds))
        size = (NARROW, 2.0 + len(panels) * (0.4 + height)) if narrow else (WIDTH, 1.5 + height)
        shape = (len(panels), 1) if narrow else (1, len(panels))
        fig, axes = plt.subplots(*shape, figsize=size, sharey=True, sharex=True, squeeze=False)
        for ax, (title, found) in zip(axes.flat, panels.items(), strict=True):
            ax.axvspan(-1, 1, color=_BAND, alpha=0.6, linewidth=0)
            ax.axvline(0, color=_QUIET, linewidth=1)
            for bar in found:
                place = groups.index(bar.group) + _offset(kinds, bar.series)
                look, (low, value, high) = SERIES[bar.series], bar.ends
                ax.plot([low, high], [place, place], color=look.color, linewidth=2, linestyle="-")
                face = "white" if bar.hollow else look.color
                ax.plot(value, place, look.marker, color=look.color, markerfacecolor=face, markersize=7)
            ax.set_title(textwrap.fill(title, 22 if narrow else 26))
            ax.tick_params(labelbottom=True)  # the next panel below may be a screen away
            ax.grid(visible=False, axis="y")
        first = axes[0, 0]
        first.set_yticks(range(len(groups)), groups)
        first.set_ylim(len(groups) - 0.5, -0.5)
        fig.supxlabel(textwrap.fill(xlabel, 32) if narrow else xlabel)
        handles = [
            plt.Line2D([], [], color=s.color, marker=s.marker, linestyle="-", label=s.label)
            for s in (SERIES[name] for name in kinds)
        ]
        fig.legend(handles=handles, loc="outside upper center", ncols=1 if narrow else min(len(kinds), 2))
    return fig


def of_robots(panels: Mapping[str, Sequence[Bar]]) -> Callable[[bool], Figure]:
    """Return what draws a forest of robots in margins, narrow or wide, as `html.figure_of` wants it.

    Args:
        panels: title → its bars.
    """
    return lambda narrow: forest(panels, xlabel=MARGINS_AS_UNIT, order=ROBOTS, narrow=narrow)


def _offset(kinds: Sequence[str], name: str) -> float:
    """Return how far a series stands from the middle of its group."""
    return 0.7 * ((kinds.index(name) + 0.5) / len(kinds) - 0.5)


def in_words(panels: Mapping[str, Sequence[Bar]]) -> str:
    """Return what a forest shows, for those who cannot see it.

    Example:
        >>> import numpy as np
        >>> gap = Estimate(np.array(5.0), np.array(2.0), np.array(8.0), 10, 0, 0.95, "difference of means")
        >>> in_words({"final return": [Bar("Ant", "beta", gap, unit=2.0)]})
        'final return: Ant, Beta − Gaussian: 5.0 [2.0, 8.0]'
    """
    return ". ".join(
        f"{title}: "
        + "; ".join(f"{b.group}, {SERIES[b.series].label}: {spoken(b.difference)}" for b in found)
        for title, found in panels.items()
        if found
    )
