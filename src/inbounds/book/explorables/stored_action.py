"""An explorable: what an action in a floating-point format has forgotten of the latent it came from.

::

    from inbounds.book.explorables.stored_action import stored_action

    stored_action()

The mathematics runs in the reader's browser (`explorables/stored_action.js`) and is tested against this module,
PyTorch's own formats and mpmath.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from bokeh.models import ColumnDataSource, CustomJSTickFormatter, Slider
from bokeh.plotting import figure
from matplotlib.figure import Figure
from numpy.typing import NDArray

from inbounds.book.drawing import figures
from inbounds.book.explorables.frame import Explorable, curve, plot, slider
from inbounds.book.explorables.legend import Mark

__all__ = ["FORMATS", "LATENTS", "StoredAction", "stored_action"]

LATENTS: dict[str, figures.FamilyStyle] = {
    "drawn": figures.FamilyStyle("drawn", "#4B1E78", "#A98BF0", "-", "o"),
    "recalled": figures.FamilyStyle("from the stored action", "#CC7E14", "#FFD394", "--", "D"),
}
"""The latent that was drawn and the one that the record gives back, and the look of each."""

LEGEND = (
    Mark("line", "line", "the policy’s density", of=("density",)),
    Mark("ring", "ink", "either latent, as high as its density", of=tuple(f"{name}-top" for name in LATENTS)),
    Mark("ticks", "line", "latents that a stored action can give back", of=("ticks",)),
    Mark("area", "line", "so many of them that their ticks would touch", of=("dense",)),
    Mark("area", "recalled", "latents that share this stored action", of=("cell",)),
)
"""What the marks mean that the table does not name."""

FORMATS = {"bfloat16": 8, "float16": 11, "float32": 24, "float64": 53}
"""Significant bits of each format."""

_LATENT, _NOISE, _SCALE = (2.0, 40.0), (-2.0, 2.0), (0.05, 1.0)


@dataclass(frozen=True)
class StoredAction:
    """A latent z ~ N(μ, σ²), its action tanh(z/2) on the box [-1, 1], and what a record of the action gives back.

    Everything is exact arithmetic on one rounding: that of the action to the format's nearest number.

    Its `ratio` has an example.
    """

    z: float
    """The latent, from log 3 on: the action lies in [1/2, 1], where a format's numbers are evenly spaced."""
    noise: float = 1.0
    """(z − μ)/σ."""
    scale: float = 0.5
    """σ."""
    form: str = "float32"
    """A key of `FORMATS`."""

    @property
    def loc(self) -> float:
        """μ."""
        return self.z - self.scale * self.noise

    @property
    def spacing(self) -> float:
        """What separates neighbouring numbers just below 1."""
        return 2.0 ** -FORMATS[self.form]

    @property
    def steps(self) -> int:
        """How many spacings below the bound the stored action lies: all that the record contains."""
        return round(2 / (1 + math.exp(self.z)) / self.spacing)

    @property
    def recalled(self) -> float:
        """The latent that belongs to the stored action; infinite where that is the bound."""
        return _latent_at(self.steps * self.spacing)

    @property
    def cell(self) -> tuple[float, float]:
        """The ends of the interval of latents that share the record."""
        return tuple(_latent_at((self.steps + half) * self.spacing) for half in (0.5, -0.5))  # type: ignore[return-value]

    def log_density(self, latent: float) -> float:
        """Return the log-density of a latent under the policy, in nats."""
        t = (latent - self.loc) / self.scale
        return -0.5 * t**2 - math.log(self.scale) - 0.5 * math.log(2 * math.pi)

    @property
    def ratio(self) -> float:
        """The ratio at unchanged parameters, new log-density from the record, old one from the latent; it should be 1.

        Example:
            >>> from inbounds.book.explorables.stored_action import FORMATS
            >>> [round(StoredAction(16.5, form=form).ratio, 3) for form in FORMATS]
            [0.0, 0.0, 0.735, 1.0]
        """
        return math.exp(self.log_density(self.recalled) - self.log_density(self.z))


def _latent_at(distance: float) -> float:
    """Return the latent of the action at some distance from the bound."""
    return math.log((2 - distance) / distance) if distance > 0 else math.inf


def stored_action(
    z: float = 16.5, noise: float = 1.0, sigma: float = 0.5, form: str = "float32"
) -> Explorable:
    """Drag a latent outwards: the action that is stored, the latent it gives back, and what that does to the ratio.

    Args:
        z: Initial latent, in [2, 40].
        noise: Initial (z − μ)/σ, in [-2, 2].
        sigma: Initial σ, in [0.05, 1].
        form: Initial format, a key of `FORMATS`.

    Returns:
        An explorable with the policy's density over latents, both latents, and the latents that a record can give
        back; and a table of latent, action, log-density, score and ratio, as drawn and from the record.

    Raises:
        ValueError: If a value lies outside its slider.

    Example:
        >>> stored_action(form="bfloat16").name
        'stored-action'
    """
    values = (z, _LATENT), (noise, _NOISE), (sigma, _SCALE)
    if form not in FORMATS or not all(low <= value <= high for value, (low, high) in values):
        raise ValueError(
            f"z={z:g}, noise={noise:g}, sigma={sigma:g}, form={form!r} lie outside the sliders: choose z in [2, 40], "
            f"noise in [-2, 2], sigma in [0.05, 1], form among {', '.join(FORMATS)}"
        )
    stored = StoredAction(z, noise, sigma, form)
    return Explorable(
        name="stored-action",
        title="a latent and what its stored action gives back, over latent, noise, scale σ and format",
        alt=(
            "The policy's density over latents, with the latent that was drawn and the one that the stored action "
            "gives back, each as high as its density; ticks for the latents that a record can give back, and a band "
            f"for those that share this record. At z = {z:g} with σ = {sigma:g}, {form} gives back "
            f"{stored.recalled:.2f}, and the ratio at unchanged parameters is {stored.ratio:.2f}."
        ),
        controls=(
            slider("z", "latent z", *_LATENT, z, 0.1),
            slider("noise", "noise (z − μ)/σ", *_NOISE, noise, 0.1),
            slider("log_sigma", "scale σ (logarithmic)", -3.0, 0.0, math.log(sigma), 0.1, log=True),
            _formats(form),
        ),
        plots=(_picture(),),
        columns={name: look.label for name, look in LATENTS.items()},
        rows={
            "latent": "latent",
            "action": "action",
            "distance": "1 − action",
            "log_density": "log-density of the latent",
            "score": "score in μ",
            "ratio": "ratio",
        },
        fallback=lambda: _static(stored),
        looks=LATENTS,
        legend=LEGEND,
    )


def _formats(form: str) -> Slider:
    """Return the slider over the formats, which shows their names."""
    names = list(FORMATS)
    choice = slider("form", "number format of the stored action", 0, len(names) - 1, names.index(form), 1)
    choice.format = CustomJSTickFormatter(code=f"return {names}[Math.round(tick)]")
    return choice


def _picture() -> figure:
    """Draw the plot, empty: band and ticks below, the density, a stem and a ring for each of the latents."""
    fig = plot("latent z", "density of the latent", (0, 1), "y")
    fig.x_range.name = "x"
    for name, color, alpha in (("cell", "recalled", 0.2), ("dense", "line", 0.6)):
        source = ColumnDataSource({"x": [], "width": [], "top": []}, name=name)
        fig.vbar("x", width="width", top="top", source=source, name=color, fill_alpha=alpha, line_alpha=0.0)
    ticks = ColumnDataSource({"x0": [], "x1": [], "y0": [], "y1": []}, name="ticks")
    fig.segment("x0", "y0", "x1", "y1", source=ticks, name="line", line_width=1.5)
    density = ColumnDataSource({"x": [], "y": []}, name="density")
    fig.line("x", "y", source=density, name="line", line_width=2)
    for name, look in LATENTS.items():
        curve(fig, name, look, source=name)
    for name, size in zip(LATENTS, (15, 9), strict=True):
        ring = ColumnDataSource({"x": [], "y": []}, name=f"{name}-top")
        fig.scatter("x", "y", source=ring, name=name, size=size, line_width=3, fill_alpha=0.0)
    return fig


def _static(stored: StoredAction) -> Figure:
    """Draw the static figure of `stored_action`."""
    ends = [stored.loc - 4 * stored.scale, stored.loc + 4 * stored.scale]
    if math.isfinite(stored.recalled):
        ends += [stored.recalled]
    left, right = min(ends), max(ends)
    grid = np.linspace(left, right, 321)

    def density(latent: NDArray[np.float64] | float) -> NDArray[np.float64]:
        t = (np.asarray(latent) - stored.loc) / stored.scale
        return np.exp(-0.5 * t**2) / (stored.scale * math.sqrt(2 * math.pi))

    with figures.use_style():
        fig, ax = plt.subplots(figsize=(figures.WIDTH, 3.6))
        low, high = (min(max(end, left), right) for end in stored.cell)
        if high > low:
            ax.axvspan(low, high, color=LATENTS["recalled"].color, alpha=0.2, linewidth=0)
        ax.plot(grid, density(grid), color="#5F6770", linewidth=2)
        count = math.ceil(100 / (right - left))
        ticks = [_latent_at((k + 1) * stored.spacing) for k in range(count)]
        rug = 0.07 * float(density(stored.loc))
        ax.vlines([at for at in ticks if left <= at <= right], 0, rug, color="#5F6770", linewidth=1.5)
        dense = min(max(_latent_at((count + 1) * stored.spacing), left), right)
        ax.fill_between([left, dense], 0, rug, color="#5F6770", alpha=0.6, linewidth=0)
        for name, at in (("drawn", stored.z), ("recalled", stored.recalled)):
            if math.isfinite(at):
                look = LATENTS[name]
                ax.plot([at, at], [0, float(density(at))], look.linestyle, color=look.color, label=look.label)
                ax.plot([at], [float(density(at))], "o", color=look.color, markerfacecolor="none", ms=9)
        ax.set(xlabel="latent z", ylabel="density of the latent", xlim=(left, right), ylim=(0, None))
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, 1.18), ncols=2)
    return fig
