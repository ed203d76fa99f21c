"""An explorable: a Beta policy, and the means and spreads that Beta policies reach.

::

    from inbounds.book.explorables.beta_lens import beta_lens

    beta_lens()

The mathematics runs in the reader's browser (`explorables/beta_lens.js`) and is tested against this module, SciPy
and the package.
"""

from __future__ import annotations

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
import torch
from bokeh.models import ColumnDataSource, Range1d
from bokeh.plotting import figure
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import optimize

from inbounds.book.drawing import figures
from inbounds.book.explorables.frame import Explorable, family_curve, plot, slider
from inbounds.book.explorables.legend import Mark
from inbounds.distributions import LogitNormal, ScaledBeta
from inbounds.learning import Limits

__all__ = ["BetaInItsLens", "beta_lens"]

_CAP = Limits().concentration_max
_WIDEST = float(np.exp(Limits().log_std_max))
_ACTIONS = (-1.35, 1.35)

LEGEND = (
    Mark(
        "upright",
        "ink",
        "above, the mean; below, the spreads that a Beta can have at this mean",
        of=("at-mean", "reach"),
    ),
    Mark("ring", "ink", "this Beta", of=("here",)),
    Mark("area", "beta", f"all Betas with α and β from 1 to {_CAP:g}", of=("lens",)),
    Mark("thin", "logit-normal", "the widest logit-normals, σ = e = 2.72", of=("arch",)),
    Mark(
        "dotted",
        "beta",
        f"one parameter alone: from 1 to {_CAP:g}, its end at α↑ or β↑",
        of=("path-alpha", "path-beta", "ends"),
    ),
    Mark(
        "line",
        "logit-normal",
        "below, the logit-normal’s σ alone: from 0.02 to e, its end at σ↑",
        of=("path-sigma", "ends"),
    ),
)
"""What the marks of both plots mean."""


@dataclass(frozen=True)
class BetaInItsLens:
    """A Beta policy on [-1, 1], what its mean leaves it of spread, and the logit-normal of its mean and spread.

    A policy's parameters are limited as everywhere in the book (`inbounds.learning.Limits`): 1 ≤ α, β ≤ 80, σ ≤ e.

    Example:
        >>> uniform = BetaInItsLens(alpha=1.0, beta=1.0)
        >>> [round(std, 3) for std in uniform.reach()]
        [0.079, 0.577]
    """

    alpha: float
    """α, in [1, 80]."""
    beta: float
    """β, in [1, 80]."""

    @property
    def law(self) -> ScaledBeta:
        """The Beta, float64."""
        return _beta(self.alpha, self.beta)

    @property
    def logit_normal(self) -> LogitNormal:
        """The logit-normal with the Beta's mean and standard deviation, float64.

        Raises:
            RuntimeError: If none is found.
        """
        wanted = float(self.law.mean), float(self.law.stddev)

        def wrong(parameters: NDArray[np.float64]) -> list[float]:
            law = _logit_normal(*parameters)
            return [
                float(np.arctanh(float(law.mean)) - np.arctanh(wanted[0])),
                float(np.log(float(law.stddev)) - np.log(wanted[1])),
            ]

        start = [np.log(self.alpha / self.beta), 0.5 * np.log(1 / self.alpha + 1 / self.beta)]
        found = optimize.root(wrong, start, tol=1e-12)
        if max(map(abs, wrong(found.x))) > 1e-8:
            raise RuntimeError(f"no logit-normal found for {self}: choose α and β in [1, {_CAP:g}]")
        return _logit_normal(*found.x)

    def reach(self) -> tuple[float, float]:
        """Return the smallest and the largest standard deviation of a Beta policy with this mean.

        At the largest the smaller parameter is 1, at the smallest the larger one is 80.

        Example:
            >>> low, high = BetaInItsLens(alpha=6.0, beta=2.0).reach()
            >>> round(low, 3), round(high, 3)
            (0.083, 0.387)
        """
        least, most = sorted((self.alpha, self.beta))
        low, high = (float(_beta(s * least, s * most).stddev) for s in (_CAP / most, 1 / least))
        return low, high


def _beta(alpha: float, beta: float) -> ScaledBeta:
    """Return the Beta on [-1, 1]."""
    first, second = torch.tensor([alpha, beta], dtype=torch.float64)
    return ScaledBeta(first, second, low=-1.0, high=1.0)


def _logit_normal(loc: float, log_scale: float) -> LogitNormal:
    """Return the logit-normal on [-1, 1] by μ and log σ."""
    loc_, log_scale_ = torch.tensor([loc, log_scale], dtype=torch.float64)
    return LogitNormal(loc_, log_scale_.exp(), low=-1.0, high=1.0)


def beta_lens(alpha: float = 6.0, beta: float = 2.0) -> Explorable:
    """Show a Beta policy over α and β, and where it stands among the means and spreads of Beta policies.

    Args:
        alpha: Initial α, in [1, 80].
        beta: Initial β, in [1, 80].

    Returns:
        An explorable with two plots, the density beside that of the logit-normal with the same mean and spread, and
        standard deviation against mean with the paths of each parameter alone; and a table of mean, spread, mode,
        and the spreads possible at this mean.

    Raises:
        ValueError: If α or β lies outside its slider.

    Example:
        >>> beta_lens(alpha=3.0).name
        'beta-lens'
    """
    if not all(1.0 <= value <= _CAP for value in (alpha, beta)):
        raise ValueError(
            f"alpha={alpha:g}, beta={beta:g} lie outside the sliders: choose both in [1, {_CAP:g}]"
        )
    policy = BetaInItsLens(alpha, beta)
    low, high = policy.reach()
    return Explorable(
        name="beta-lens",
        title="a Beta policy over α and β, and the means and spreads it can have",
        alt=(
            "Above, the density of a Beta policy on the interval from -1 to 1, and the logit-normal of the same mean "
            "and spread. Below, standard deviation against mean: Beta policies fill a lens that closes at both bounds, "
            "logit-normal policies everything under an arch above it; α or β alone moves along a slanted path. "
            f"At α = {alpha:g}, β = {beta:g} the mean is {float(policy.law.mean):.2f} and the standard deviation "
            f"{float(policy.law.stddev):.2f}, of {low:.2f} to {high:.2f} possible at that mean."
        ),
        controls=(
            slider("log_alpha", "α (logarithmic)", 0.0, float(np.log(_CAP)), float(np.log(alpha)), 0.05, log=True),
            slider("log_beta", "β (logarithmic)", 0.0, float(np.log(_CAP)), float(np.log(beta)), 0.05, log=True),
        ),
        plots=(_densities(), _plane()),
        columns={"beta": "Beta", "logit-normal": "Logit-normal, same mean and spread"},
        rows={
            "parameters": "parameters",
            "mean": "mean",
            "std": "standard deviation",
            "mode": "mode(s)",
            "widest": "largest std. at this mean",
            "narrowest": "smallest std. at this mean",
        },
        fallback=lambda: _static(policy),
        legend=LEGEND,
    )  # fmt: skip


def _densities() -> figure:
    """Draw the plot of the two densities, with a line at the mean."""
    fig = plot("action", "density", _ACTIONS, "density", height=240)
    _line(fig, "at-mean", "line", width=1)
    for family in ("beta", "logit-normal"):
        family_curve(fig, family)
    fig.min_border_left = 64
    return fig


def _plane() -> figure:
    """Draw the plot of standard deviation against mean: regions, paths, and the point where the policy stands."""
    fig = plot("mean of the action", "standard deviation", _ACTIONS, "", height=320)
    fig.y_range = Range1d(0.0, 0.86)
    fig.min_border_left = 64
    lens = ColumnDataSource({"x": [], "y": []}, name="lens")
    fig.patch("x", "y", source=lens, name="beta", fill_alpha=0.2, line_width=1)
    _line(fig, "arch", "logit-normal", width=1)
    _line(fig, "reach", "ink", width=2)
    for path, family in (("sigma", "logit-normal"), ("alpha", "beta"), ("beta", "beta")):
        _line(fig, f"path-{path}", family, width=3, dash=[] if path == "sigma" else [2, 4])
    ends = ColumnDataSource({"x": [], "y": [], "label": [], "align": []}, name="ends")
    fig.text(
        "x", "y", "label", source=ends, y_offset=-5, text_align={"field": "align"}, text_font_size="13px"
    )
    here = ColumnDataSource({"x": [], "y": []}, name="here")
    fig.scatter("x", "y", source=here, name="ink", size=12, line_width=3, fill_alpha=0.0)
    return fig


def _line(fig: figure, source: str, color: str, *, width: int, dash: list[int] | None = None) -> None:
    """Add an empty line in one of the page's colours."""
    data = ColumnDataSource({"x": [], "y": []}, name=source)
    fig.line("x", "y", source=data, name=color, line_width=width, line_dash=dash or [])


def _static(policy: BetaInItsLens) -> Figure:
    """Draw the static figure of `beta_lens`."""
    inside = torch.linspace(-1.0, 1.0, 403, dtype=torch.float64)[1:-1]
    mean = float(policy.law.mean)
    with figures.use_style():
        fig, (above, below) = plt.subplots(
            2, 1, figsize=(figures.WIDTH, 5.6), height_ratios=(2, 3), sharex=True
        )
        above.axvline(mean, color="#5F6770", linewidth=1)
        for family, law in (("beta", policy.law), ("logit-normal", policy.logit_normal)):
            above.plot(inside, law.log_prob(inside).exp(), **figures.family_style(family))
        above.set(ylabel="density", ylim=(0.0, None), xlim=_ACTIONS)
        above.legend(loc="upper center", bbox_to_anchor=(0.5, 1.3), ncols=2)
        _static_plane(below, policy)
    return fig


def _static_plane(ax: Axes, policy: BetaInItsLens) -> None:
    """Draw standard deviation against mean."""
    side = torch.logspace(0, float(np.log10(_CAP)), 60, dtype=torch.float64)
    one = torch.ones_like(side)
    edges = [(side, one), (one * _CAP, side), (side.flip(0), one * _CAP), (one, side.flip(0))]
    alpha, beta = (torch.cat(each) for each in zip(*edges, strict=True))
    region = ScaledBeta(alpha, beta, -1.0, 1.0)
    color, other = (figures.LOOKS[family].color for family in ("beta", "logit-normal"))
    ax.fill(region.mean, region.stddev, color=color, alpha=0.2, linewidth=0)
    arch = LogitNormal(
        torch.linspace(-14, 14, 141, dtype=torch.float64), torch.tensor(_WIDEST).double(), -1.0, 1.0
    )
    ax.plot(arch.mean, arch.stddev, color=other, linestyle="-", linewidth=1)
    mean = float(policy.law.mean)
    ax.plot([mean, mean], policy.reach(), color="#22272D", linestyle="-", linewidth=1.5)
    normal = policy.logit_normal
    sigma = torch.logspace(-2, float(np.log10(_WIDEST)), 60, dtype=torch.float64)
    paths = {
        "α↑": (ScaledBeta(side, torch.full_like(side, policy.beta), -1.0, 1.0), color, ":"),
        "β↑": (ScaledBeta(torch.full_like(side, policy.alpha), side, -1.0, 1.0), color, ":"),
        "σ↑": (LogitNormal(normal.loc, sigma, -1.0, 1.0), other, "-"),
    }
    aligned = ("left", "right", "center")
    for (label, (law, shade, dash)), align in zip(paths.items(), aligned, strict=True):
        ax.plot(law.mean, law.stddev, color=shade, linestyle=dash)
        end = float(law.mean[-1]), float(law.stddev[-1])
        ax.annotate(label, end, (0, 4), textcoords="offset points", ha=align, va="bottom")
    ax.plot(mean, float(policy.law.stddev), "o", color="#22272D", markerfacecolor="none", ms=10, mew=2)
    ax.set(xlabel="action; mean of the action", ylabel="standard deviation", ylim=(0.0, 0.86))
