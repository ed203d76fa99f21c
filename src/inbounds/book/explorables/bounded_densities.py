"""Three laws on a box that aim at the same action: their densities, mean, spread, median and modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import torch
from bokeh.models import ColumnDataSource, LinearAxis, Range1d
from matplotlib.figure import Figure
from scipy import stats

from inbounds.book.drawing import figures
from inbounds.book.explorables.frame import BOUNDS, Explorable, bounds, family_curve, plot, slider
from inbounds.book.explorables.legend import Mark
from inbounds.distributions import LogitNormal

__all__ = ["MatchedLaws", "bounded_densities"]


@dataclass(frozen=True)
class MatchedLaws:
    """Three laws on the box [-1, 1] that aim at the same action with, to first order, the same noise.

    The logit-normal draws z ~ N(μ, σ²) and executes tanh(z/2) = 2·sigmoid(z) - 1. Replace the squash by its tangent at
    μ, and a Gaussian is left: N(m, s²) with m = tanh(μ/2), the logit-normal's median, and s = σ(1 - m²)/2, σ times the
    squash's slope there. As σ → 0 the two agree; as σ grows, the tangent leaves the box where the squash bends, and
    the simulator clips it. The Beta has the mean and standard deviation of the logit-normal's actions.

    Example:
        >>> MatchedLaws(mu=0.0, sigma=1.0).logit_normal
        LogitNormal(loc: 0.0, scale: 1.0, low: -1.0, high: 1.0)
    """

    mu: float
    """μ, location of the logit-normal's latent."""
    sigma: float
    """σ, scale of the logit-normal's latent."""

    @property
    def logit_normal(self) -> LogitNormal:
        """The logit-normal on (-1, 1), float64."""
        loc, scale = torch.tensor([self.mu, self.sigma], dtype=torch.float64)
        return LogitNormal(loc, scale, low=-1.0, high=1.0)

    @property
    def gaussian(self) -> tuple[float, float]:
        """Mean m and standard deviation s of the Gaussian before it is clipped.

        Example:
            >>> MatchedLaws(mu=0.0, sigma=1.0).gaussian
            (0.0, 0.5)
        """
        m = float(np.tanh(0.5 * self.mu))
        return m, 0.5 * self.sigma * (1.0 - m * m)

    @property
    def atoms(self) -> tuple[float, float]:
        """Probabilities that the clipped Gaussian sits at -1 and at 1.

        Example:
            >>> low, high = MatchedLaws(mu=0.0, sigma=2.0).atoms
            >>> round(low, 4), round(high, 4)
            (0.1587, 0.1587)
        """
        m, s = self.gaussian
        return float(stats.norm.cdf(-1.0, m, s)), float(stats.norm.sf(1.0, m, s))

    @property
    def beta(self) -> tuple[float, float]:
        """α and β of the Beta with the logit-normal's mean and variance; a Beta policy needs both above 1."""
        centre = 0.5 * (1.0 + float(self.logit_normal.mean))
        total = centre * (1.0 - centre) / (0.25 * float(self.logit_normal.variance)) - 1.0
        return centre * total, (1.0 - centre) * total


def bounded_densities(mu: float = 1.0, sigma: float = 1.0) -> Explorable:
    """Gaussian clipped by the simulator, Beta, and logit-normal on one box, over μ and σ.

    The box is [-1, 1], the control range of every joint of Gymnasium's HalfCheetah (a fraction of full torque). How
    the three laws are matched is told in `MatchedLaws`. σ runs from 0.05 to e, the cap the source thesis sets.

    Args:
        mu: Initial μ, in [-4, 4].
        sigma: Initial σ, in [0.05, e].

    Returns:
        An explorable with the curves, the Gaussian's mass at the bounds on an axis of its own, and a table of masses,
        moments, medians and modes.

    Raises:
        ValueError: If μ or σ lies outside its slider.

    Example:
        >>> bounded_densities(mu=0.5).name
        'bounded-densities'
    """
    log_sigma = float(np.log(sigma)) if sigma > 0 else -np.inf
    if not (-4.0 <= mu <= 4.0 and -3.0 <= log_sigma <= 1.0):
        raise ValueError(
            f"mu={mu:g}, sigma={sigma:g} lie outside the sliders: choose mu in [-4, 4], sigma in [0.05, 2.71]"
        )
    fig = plot("executed action (±1: full torque)", "density", (-1.35, 1.35), "density")
    for family in ("gaussian", "beta", "logit-normal"):
        family_curve(fig, family)
    _add_atoms(fig)
    laws = MatchedLaws(mu, sigma)
    return Explorable(
        name="bounded-densities",
        title="three policies on a bounded action, over location μ and scale σ",
        alt=(
            "Densities on the interval from -1 to 1: a Gaussian clipped by the simulator, a logit-normal, and the Beta "
            f"of its mean and spread if there is one. At μ = {mu:g}, σ = {sigma:g} the Gaussian puts "
            f"{laws.atoms[0]:.1%} of its actions on the lower and {laws.atoms[1]:.1%} on the upper bound, "
            "the others none."
        ),
        controls=(
            slider("mu", "location μ", -4.0, 4.0, mu, 0.1),
            slider("log_sigma", "scale σ (logarithmic)", -3.0, 1.0, log_sigma, 0.05, log=True),
        ),
        plots=(fig,),
        columns={"gaussian": "Gaussian, clipped", "beta": "Beta", "logit-normal": "Logit-normal"},
        rows={
            "parameters": "parameters",
            "at_low": "at bound −1",
            "at_high": "at bound +1",
            "near": "beyond ±0.99",
            "mean": "mean",
            "std": "standard deviation",
            "median": "median",
            "modes": "mode(s) inside",
        },
        fallback=lambda: _bounded_densities_figure(laws),
        legend=(
            BOUNDS,
            Mark(
                "hatched",
                "gaussian",
                "share of the Gaussian’s actions at a bound: axis at the right",
                of=("atoms",),
            ),
        ),
    )


def _add_atoms(fig: Any) -> None:
    """Draw bars beside the two bounds for the Gaussian's mass there, on an axis of probability at the right."""
    bounds(fig)
    fig.extra_y_ranges = {"mass": Range1d(0.0, 1.0)}
    fig.add_layout(
        LinearAxis(
            y_range_name="mass", axis_label="probability at a bound",
            axis_label_text_font_style="normal", axis_label_text_font_size="14px", major_label_text_font_size="13px",
        ),
        "right",
    )  # fmt: skip
    source = ColumnDataSource({"x": [], "mass": [], "label": []}, name="atoms")
    fig.vbar(
        "x", top="mass", width=0.14, source=source, y_range_name="mass", name="gaussian",
        fill_alpha=0.25, line_width=2, hatch_pattern="right_diagonal_line", hatch_alpha=0.8,
    )  # fmt: skip
    fig.text(
        "x", "mass", "label", source=source, y_range_name="mass", y_offset=-4,
        text_align="center", text_baseline="bottom", text_font_size="13px",
    )  # fmt: skip


def _bounded_densities_figure(laws: MatchedLaws) -> Figure:
    """Draw the static figure of `bounded_densities`."""
    inside = np.linspace(-1.0, 1.0, 2003)[1:-1]
    m, s = laws.gaussian
    alpha, beta = laws.beta
    density = {"gaussian": stats.norm.pdf(inside, m, s)}
    if min(alpha, beta) > 1.0:
        density["beta"] = stats.beta.pdf(inside, alpha, beta, loc=-1.0, scale=2.0)
    density["logit-normal"] = laws.logit_normal.log_prob(torch.as_tensor(inside)).exp().numpy()
    with figures.use_style():
        fig, ax = plt.subplots(figsize=(figures.WIDTH, 4.2))
        for family, values in density.items():
            ax.plot(inside, values, **figures.family_style(family))
        ax.vlines((-1.0, 1.0), 0.0, 1.0, transform=ax.get_xaxis_transform(), color="#5F6770", linewidth=1)
        ax.set(
            xlim=(-1.35, 1.35), ylim=(0.0, None), xlabel="executed action (±1: full torque)", ylabel="density"
        )
        atoms = ax.twinx()
        atoms.set(ylim=(0.0, 1.0), ylabel="probability at a bound")
        atoms.grid(False)
        color = figures.LOOKS["gaussian"].color
        for x, mass in zip((-1.14, 1.14), laws.atoms, strict=True):
            atoms.bar(x, mass, width=0.14, facecolor="none", edgecolor=color, hatch="////", linewidth=1.6)
            atoms.annotate(
                f"{mass:.0%}", (x, mass), (0, 3), textcoords="offset points", ha="center", va="bottom"
            )
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, 1.17), ncols=len(density))
    return fig
