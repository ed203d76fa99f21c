"""An explorable: the clipped surrogate of one step, over its ratio, its advantage and ε.

::

    from inbounds.book.explorables.ppo_clip import ppo_clip

    ppo_clip()

The mathematics runs in the reader's browser (`explorables/ppo_clip.js`) and is tested against this package's
`inbounds.learning.ppo.clipped_surrogate` and its derivative by autograd.
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import torch
from bokeh.models import ColumnDataSource
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from inbounds.book.drawing import figures
from inbounds.book.explorables.frame import Explorable, curve, plot, slider
from inbounds.book.explorables.legend import Mark
from inbounds.learning.ppo import clipped_surrogate

__all__ = ["CURVES", "ppo_clip", "surrogate_and_slope"]

CURVES: dict[str, figures.FamilyStyle] = {
    "unclipped": figures.FamilyStyle("w Â", "#A8330A", "#DD5B33", "--", "s"),
    "clipped": figures.FamilyStyle("clip(w) Â", "#CC7E14", "#FFD394", "-.", "D"),
    "smaller": figures.FamilyStyle("the smaller", "#4B1E78", "#A98BF0", "-", "o"),
}
"""The two candidates and the surrogate, and the look of each."""

_RATIO, _ADVANTAGE, _CLIP_RANGE = (0.0, 2.5), (-2.0, 2.0), (0.02, 0.5)


def surrogate_and_slope(
    ratio: ArrayLike, advantage: float, clip_range: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the clipped surrogate at some ratios, and its derivative in the ratio.

    Args:
        ratio: w, `[...]`, positive.
        advantage: Â.
        clip_range: ε.

    Returns:
        min(w Â, clip(w, 1 − ε, 1 + ε) Â) and its derivative, `[...]` each.

    Example:
        >>> value, slope = surrogate_and_slope([0.5, 1.0, 1.5], advantage=-1.0, clip_range=0.2)
        >>> value.round(3).tolist(), slope.round(3).tolist()
        ([-0.8, -1.0, -1.5], [0.0, -1.0, -1.0])
    """
    r = torch.tensor(np.asarray(ratio, np.float64), requires_grad=True)
    value = clipped_surrogate(r.log(), torch.zeros_like(r), torch.full_like(r, advantage), clip_range)
    (slope,) = torch.autograd.grad(value.sum(), r)
    return value.detach().numpy(), slope.numpy()


def ppo_clip(ratio: float = 1.5, advantage: float = 1.0, clip_range: float = 0.2) -> Explorable:
    """Show the clipped surrogate of one step, with its two candidates, over w, Â and ε.

    Args:
        ratio: Initial w, in [0, 2.5].
        advantage: Initial Â, in [-2, 2].
        clip_range: Initial ε, in [0.02, 0.5].

    Returns:
        An explorable with the three curves against w, the point where the step stands, and a table of value, slope,
        and gain over w = 1.

    Raises:
        ValueError: If a value lies outside its slider.

    Example:
        >>> ppo_clip(ratio=0.5, advantage=-1.0).name
        'ppo-clip'
    """
    values = (ratio, _RATIO), (advantage, _ADVANTAGE), (clip_range, _CLIP_RANGE)
    if not all(low <= value <= high for value, (low, high) in values):
        raise ValueError(
            f"ratio={ratio:g}, advantage={advantage:g}, clip_range={clip_range:g} lie outside the sliders: choose "
            "ratio in [0, 2.5], advantage in [-2, 2], clip_range in [0.02, 0.5]"
        )
    here, slope = surrogate_and_slope(max(ratio, 1e-9), advantage, clip_range)
    fig = plot("ratio w", "surrogate of one step", _RATIO, "y")
    for edge in ("lower", "upper"):
        source = ColumnDataSource({"x": [], "y": []}, name=edge)
        fig.line("x", "y", source=source, name="line", line_width=1)
    for name, look in CURVES.items():
        curve(fig, name, look, source=name)
    point = ColumnDataSource({"x": [], "y": []}, name="here")
    fig.scatter("x", "y", source=point, name="smaller", size=14, line_width=3, fill_alpha=0.0)
    return Explorable(
        name="ppo-clip",
        title="the clipped surrogate of one step, over ratio, advantage and clip range",
        alt=(
            "Three lines against the ratio w: w times the advantage, its clipped version, and the smaller of both, "
            "which follows the first up to a corner at one end of the interval 1 ± ε and is flat beyond. "
            f"At w = {ratio:g}, advantage {advantage:g}, ε = {clip_range:g} the surrogate is {float(here):.2f} "
            f"and its slope {float(slope):.2f}."
        ),
        controls=(
            slider("ratio", "ratio w", *_RATIO, ratio, 0.05),
            slider("advantage", "advantage Â", *_ADVANTAGE, advantage, 0.1),
            slider("clip_range", "clip range ε", *_CLIP_RANGE, clip_range, 0.02),
        ),
        plots=(fig,),
        columns={name: look.label for name, look in CURVES.items()},
        rows={"value": "value", "slope": "slope in w", "gain": "gain over w = 1"},
        fallback=lambda: _static(ratio, advantage, clip_range),
        looks=CURVES,
        legend=(
            Mark("upright", "line", "ends of the interval, 1 − ε and 1 + ε", of=("lower", "upper")),
            Mark("ring", "smaller", "your step: the surrogate at your ratio", of=("here",)),
        ),
    )


def _static(ratio: float, advantage: float, clip_range: float) -> Figure:
    """Draw the static figure of `ppo_clip`."""
    r = np.linspace(0.0, 2.5, 501)
    clipped = np.clip(r, 1 - clip_range, 1 + clip_range) * advantage
    drawn = {"unclipped": r * advantage, "clipped": clipped}
    drawn["smaller"] = np.minimum(*drawn.values())
    with figures.use_style():
        fig, ax = plt.subplots(figsize=(figures.WIDTH, 3.6))
        for edge in (1 - clip_range, 1 + clip_range):
            ax.axvline(edge, color="#5F6770", linewidth=1)
        for name, values in drawn.items():
            look = CURVES[name]
            ax.plot(r, values, color=look.color, linestyle=look.linestyle, label=look.label)
        at = np.interp(ratio, r, drawn["smaller"])
        ax.plot([ratio], [at], "o", color=CURVES["smaller"].color, markerfacecolor="none", ms=10, mew=2)
        ax.set(xlabel="ratio w", ylabel="surrogate of one step", xlim=_RATIO)
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, 1.18), ncols=3)
    return fig
