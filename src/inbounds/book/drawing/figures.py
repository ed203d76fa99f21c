"""How the book draws: one style, one look per policy family, alt text on every figure.

A family keeps its colour, line style and marker from the first chapter to the last. The colours differ in
lightness as well as in hue, so that they stay apart in greyscale print and under every common form of colour
blindness (a test simulates both); the line style says the same thing once more.

Figures are opaque and white, which reads in the light and in the dark theme, in print, and on GitHub.
`inbounds.book.drawing.alt_text.show` puts a figure on the page together with its alt text::

    figures.use_style()
    fig, ax = plt.subplots()
    ax.plot(t, x, **figures.family_style("beta"))
    figures.show(fig, alt="Return against environment steps: ...")
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import torch
from cycler import cycler
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from inbounds.book.drawing.alt_text import PIXELS_PER_INCH, png_bytes, show, svg_bytes, svg_uri

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from inbounds.distributions import LogitNormal

__all__ = [
    "LOOKS",
    "MAX_DENSITY",
    "SHADES",
    "STYLE",
    "WIDTH",
    "FamilyStyle",
    "beta_densities",
    "density_panels",
    "family_style",
    "logit_normal_densities",
    "png_bytes",
    "saturation_histogram",
    "show",
    "svg_bytes",
    "svg_uri",
    "use_style",
]

WIDTH = 6.8
"""Width of a figure in inches: 680 CSS pixels, the text column of the book on a laptop."""

MAX_DENSITY = 4.0
"""Where density panels end: a density may be unbounded at the ends of its support."""


@dataclass(frozen=True)
class FamilyStyle:
    """The look of one policy family, the same throughout the book.

    Example:
        >>> from inbounds.book.drawing.figures import LOOKS
        >>> LOOKS["beta"].label
        'Beta'
    """

    label: str
    """Name in legends."""
    color: str
    """Colour on white."""
    color_on_dark: str
    """Colour on the dark theme's background, for the explorables, which have no background of their own."""
    linestyle: str
    """Matplotlib line style."""
    marker: str
    """Matplotlib marker."""


LOOKS: Mapping[str, FamilyStyle] = MappingProxyType(
    {
        "gaussian": FamilyStyle("Gaussian, clipped", "#A8330A", "#DD5B33", "--", "s"),
        "clipped-gaussian": FamilyStyle("CAPG", "#CC7E14", "#FFD394", "-.", "D"),
        "beta": FamilyStyle("Beta", "#1F8277", "#52CCAB", ":", "^"),
        "logit-normal": FamilyStyle("Logit-normal", "#0E2F66", "#6E9CFD", "-", "o"),
    }
)
"""The four policy families, in the order in which the book compares them."""

SHADES = ("#541B2E", "#4A36D8", "#A92DB0", "#B37FC8")
"""Four colours for curves that are not families, dark to light; each comes with its own line style.

None can be taken for a family's colour, with any kind of colour vision.
"""

STYLE: Mapping[str, Any] = MappingProxyType(
    {
        "figure.figsize": (WIDTH, 3.8),
        "figure.dpi": PIXELS_PER_INCH,
        "figure.facecolor": "white",
        "figure.constrained_layout.use": True,
        "figure.constrained_layout.w_pad": 0.08,
        "figure.constrained_layout.h_pad": 0.08,
        "savefig.facecolor": "white",
        # 13 pt on 680 pixels are still 8.5 pixels where a phone shrinks the figure to half its width.
        "font.family": "DejaVu Sans",
        "font.size": 13.0,
        "axes.titlesize": 13.0,
        "axes.labelsize": 13.0,
        "figure.labelsize": 13.0,
        "xtick.labelsize": 12.0,
        "ytick.labelsize": 12.0,
        "legend.fontsize": 12.0,
        "mathtext.fontset": "dejavusans",
        "axes.facecolor": "white",
        "axes.edgecolor": "#5F6770",
        "axes.labelcolor": "#22272D",
        "axes.titlecolor": "#22272D",
        "text.color": "#22272D",
        "xtick.color": "#22272D",
        "ytick.color": "#22272D",
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.color": "#DFE3E8",
        "grid.linewidth": 0.8,
        "axes.prop_cycle": cycler(color=SHADES) + cycler(linestyle=["-", "--", "-.", (0, (1, 1.3))]),
        "lines.linewidth": 2.2,
        "lines.markersize": 6.0,
        "legend.frameon": False,
        "legend.handlelength": 2.4,
        "hatch.linewidth": 1.2,
    }
)
"""Matplotlib parameters of the book."""


class _Restore(AbstractContextManager[None]):
    """Gives Matplotlib its earlier parameters back at the end of a `with` block."""

    def __init__(self, before: Mapping[str, Any]) -> None:
        self._before = before

    def __exit__(self, *_exc: object) -> None:
        mpl.rcParams.update(self._before)


def use_style() -> AbstractContextManager[None]:
    """Switch Matplotlib to the book's style: for good, or for the length of a `with` block.

    Returns:
        A context manager that restores the parameters found; ignore it to keep the style.

    Example:
        >>> import matplotlib as mpl
        >>> with use_style():
        ...     mpl.rcParams["axes.grid"]
        True
    """
    before = {key: mpl.rcParams[key] for key in STYLE}
    mpl.rcParams.update(STYLE)
    return _Restore(before)


def family_style(family: str) -> dict[str, Any]:
    """Keyword arguments for `Axes.plot` that draw a policy family in its own look.

    Args:
        family: A key of `LOOKS`.

    Returns:
        `color`, `linestyle` and `label`.

    Raises:
        ValueError: If there is no such family.

    Example:
        >>> family_style("beta")["label"]
        'Beta'
    """
    if family not in LOOKS:
        raise ValueError(f"no policy family {family!r}; choose one of {', '.join(LOOKS)}")
    look = LOOKS[family]
    return {"color": look.color, "linestyle": look.linestyle, "label": look.label}


def density_panels(
    panels: Sequence[tuple[str, Sequence[tuple[str, torch.distributions.Distribution]]]],
    low: float = 0.0,
    high: float = 1.0,
) -> Figure:
    """Draw panels side by side, each with the densities of a few distributions on one interval.

    Args:
        panels: Per panel a title and its curves; a curve is a label and a distribution without batch axes.
        low: Lower end of the interval.
        high: Upper end of the interval.

    Returns:
        The figure; densities above `MAX_DENSITY` leave it at the top.

    Example:
        >>> import torch
        >>> from inbounds.distributions import LogitNormal
        >>> fig = density_panels([("wide", [("σ = 2", LogitNormal(torch.tensor(0.0), torch.tensor(2.0)))])])
        >>> [ax.get_title() for ax in fig.axes]
        ['wide']
    """
    # Open interval: the densities are defined inside only, some are unbounded at the ends.
    inside = np.linspace(low, high, 2003)[1:-1]
    value = torch.as_tensor(inside, dtype=torch.float64)
    with use_style():
        fig, axes = plt.subplots(1, len(panels), sharey=True, squeeze=False, figsize=(WIDTH, 4.4))
        for ax, (title, curves) in zip(axes[0], panels, strict=True):
            for label, law in curves:
                ax.plot(inside, law.log_prob(value).exp().numpy(), label=label)
            ax.set(title=title, xlabel="action", xlim=(low, high), ylim=(0.0, MAX_DENSITY))
            ax.set_yticks(np.arange(0.0, MAX_DENSITY + 0.5))
            ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=2, columnspacing=1.0)
        axes[0, 0].set_ylabel("density per unit of action")
    return fig


def logit_normal_densities(
    locs: Sequence[float] = (0.0, 1.0),
    scales: Sequence[float] = (0.3, 1.0, 2**0.5, np.e),
) -> Figure:
    """Logit-normal densities on (0, 1): a panel per μ, a curve per σ.

    The counterpart of the source thesis' figure 3.1. σ = √2 is the largest for which no μ gives two peaks, and
    e is the cap the thesis puts on σ.
    """
    from inbounds.distributions import LogitNormal

    def law(loc: float, scale: float) -> LogitNormal:
        parameters = torch.tensor([loc, scale], dtype=torch.float64)
        return LogitNormal(parameters[0], parameters[1])

    return density_panels(
        [(f"μ = {loc:g}", [(f"σ = {scale:.3g}", law(loc, scale)) for scale in scales]) for loc in locs]
    )


def beta_densities(
    panels: Mapping[str, Sequence[tuple[float, float]]] = MappingProxyType(
        {
            "α = β": ((0.5, 0.5), (1.0, 1.0), (2.0, 2.0), (8.0, 8.0)),
            "α ≠ β": ((0.5, 1.5), (1.0, 3.0), (2.0, 5.0), (8.0, 3.0)),
        }
    ),
) -> Figure:
    """Beta densities on (0, 1) over pairs (α, β): the counterpart of the source thesis' figure 2.1.

    The first pair of each panel lies outside what a Beta policy may take (α, β > 1): it has no single peak inside.
    """

    def law(alpha: float, beta: float) -> torch.distributions.Beta:
        parameters = torch.tensor([alpha, beta], dtype=torch.float64)
        return torch.distributions.Beta(parameters[0], parameters[1])

    return density_panels(
        [(title, [(f"({a:g}, {b:g})", law(a, b)) for a, b in pairs]) for title, pairs in panels.items()]
    )


def saturation_histogram(
    actions: Mapping[str, ArrayLike], low: float = -1.0, high: float = 1.0, bins: int = 40
) -> Figure:
    """Draw where executed actions fall: a histogram inside the bounds, and the two bounds counted apart.

    Args:
        actions: Per policy family the executed (already clipped) actions, of any shape.
        low: Lower bound of the action.
        high: Upper bound of the action.
        bins: Bins inside the bounds.

    Returns:
        A panel per family. The outer bars hold the actions *at* a bound; their label is the saturation there.

    Raises:
        ValueError: If a family is unknown, or an action is missing, not finite, or out of bounds.

    Example:
        >>> fig = saturation_histogram({"gaussian": [-1.0, 0.2, 1.0, 1.0], "beta": [-0.5, 0.5, 0.1, 0.9]})
        >>> len(fig.axes)
        2
    """
    columns = min(2, len(actions))
    rows = -(-len(actions) // columns) if columns else 0
    if not rows:
        raise ValueError("no actions to draw: pass a mapping from policy family to executed actions")
    with use_style():
        fig, axes = plt.subplots(
            rows, columns, sharex=True, sharey=True, squeeze=False, figsize=(WIDTH, 0.6 + 3.0 * rows)
        )
        for ax, (family, values) in zip(axes.flat, actions.items(), strict=False):
            _saturation_panel(ax, family, np.asarray(values, dtype=np.float64).ravel(), low, high, bins)
        for ax in axes.flat[len(actions) :]:
            ax.set_visible(False)
        for ax in axes[:, 0]:
            ax.set_ylabel("share of actions")
            ax.yaxis.set_major_locator(MaxNLocator(5))
            ax.yaxis.set_major_formatter(PercentFormatter(xmax=1.0, decimals=0))
        for ax in axes[-1]:
            ax.set_xlabel("executed action")
    return fig


def _saturation_panel(ax: Any, family: str, action: np.ndarray, low: float, high: float, bins: int) -> None:
    """Draw one family's panel of `saturation_histogram`."""
    style = family_style(family)
    if not action.size or not np.isfinite(action).all() or action.min() < low or action.max() > high:
        raise ValueError(
            f"{family!r}: expected finite executed actions in [{low:g}, {high:g}]; clip them to the bounds first"
        )
    inside = action[(action > low) & (action < high)]
    counts, edges = np.histogram(inside, bins=bins, range=(low, high))
    ax.stairs(counts / action.size, edges, fill=True, color=style["color"], alpha=0.55)
    ax.stairs(counts / action.size, edges, color=style["color"], linewidth=1.2)
    bar = 0.09 * (high - low)
    for side, bound in ((-1, low), (1, high)):
        mass = float(np.mean(action == bound))
        where = bound + side * 0.75 * bar  # beside the interval: a bound is a point, its bar has a width
        ax.bar(
            where, mass, width=bar, facecolor="white", edgecolor=style["color"], hatch="///", linewidth=1.6
        )
        ax.annotate(
            f"{mass:.0%}",
            (where, mass),
            (0, 3),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=12,
        )
    ax.set_title(style["label"])
    ax.set_xlim(low - 2.1 * bar, high + 2.1 * bar)
    ax.set_xticks([low, 0.5 * (low + high), high])
    ax.margins(y=0.14)
