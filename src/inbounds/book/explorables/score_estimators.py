"""An explorable: three estimators of one policy gradient, over the policy and the reward.

::

    from inbounds.book.explorables.score_estimators import score_estimators

    score_estimators()

The mathematics runs in the reader's browser (`explorables/score_estimators.js`) and is tested against this module.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
import torch
from bokeh.models import ColumnDataSource
from bokeh.plotting import figure
from matplotlib.figure import Figure
from numpy.typing import NDArray
from torch import Tensor
from torch.distributions import Normal

from inbounds.book.drawing import figures
from inbounds.book.explorables.frame import Explorable, curve, plot, slider
from inbounds.book.explorables.legend import Mark
from inbounds.distributions import ClippedNormal

__all__ = ["ESTIMATORS", "OneStep", "score_estimators"]

ESTIMATORS: dict[str, figures.FamilyStyle] = {
    "drawn": figures.FamilyStyle("at the drawn action", "#A8330A", "#DD5B33", "-", "s"),
    "clipped": figures.FamilyStyle("at the clipped action", "#4B1E78", "#A98BF0", "--", "v"),
    "capg": figures.FamilyStyle("CAPG", "#CC7E14", "#FFD394", "-.", "D"),
}
"""The three estimators and the look of each, in the order in which the chapter meets them."""


@dataclass(frozen=True)
class OneStep:
    """One action on the box [-1, 1]: z ~ N(μ, σ²) is clipped to a and paid 1 - (a - peak)², less a baseline.

    The moments are those of one sample of (reward - share · mean reward) times a score, by Gauss–Legendre quadrature
    on the three pieces of the real line; the scores are autograd's, of the Normal and of
    `ClippedNormal`.

    Its `moments` has an example.
    """

    mu: float
    """μ, location of the draw."""
    sigma: float
    """σ, its standard deviation."""
    peak: float = 1.0
    """The best action; beyond ±1, the bound is best."""
    share: float = 0.0
    """Of the mean reward, how much is subtracted: 0 is no baseline, 1 the value."""

    def moments(self) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Per estimator the mean and the standard deviation of one sample, for the gradient in (μ, log σ).

        Example:
            >>> found = OneStep(mu=0.5, sigma=1.0).moments()
            >>> {name: mean.round(4).tolist() for name, (mean, _) in found.items()}
            {'drawn': [1.0698, -0.7312], 'clipped': [0.784, -0.8064], 'capg': [1.0698, -0.7312]}
        """
        z, weights = self._nodes()
        action = z.clamp(-1.0, 1.0)
        reward = 1.0 - (action - self.peak) ** 2
        paid = reward - self.share * (weights * reward).sum()
        found = {}
        for name, score in self._scores(z, action).items():
            mean = (weights * paid * score).sum(-1)  # [2]
            square = (weights * (paid * score) ** 2).sum(-1)
            found[name] = mean.numpy(), (square - mean**2).clamp(min=0.0).sqrt().numpy()
        return found

    def _nodes(self) -> tuple[Tensor, Tensor]:
        """Return nodes z `[N]`, none on a bound, and their weights under the Normal."""
        edges = np.array([self.mu - 12 * self.sigma, -1.0, 1.0, self.mu + 12 * self.sigma])
        edges = np.clip(edges, edges[0], edges[3])  # a bound 12 σ away leaves its piece empty
        x, w = np.polynomial.legendre.leggauss(300)
        half = np.diff(edges)[:, None] / 2
        z = torch.from_numpy((edges[:-1, None] + half * (1 + x)).ravel())
        loc, scale = torch.tensor([self.mu, self.sigma], dtype=torch.float64)
        density = Normal(loc, scale).log_prob(z).exp()
        return z, density * torch.from_numpy((half * w).ravel())

    def _scores(self, z: Tensor, action: Tensor) -> dict[str, Tensor]:
        """Per estimator the score `[2, N]` in (μ, log σ)."""
        loc = torch.full_like(z, self.mu).requires_grad_()
        log_scale = torch.full_like(z, np.log(self.sigma)).requires_grad_()
        scale = log_scale.exp()
        log_probs = {
            "drawn": Normal(loc, scale).log_prob(z),
            "clipped": Normal(loc, scale).log_prob(action),
            "capg": ClippedNormal(loc, scale, -1.0, 1.0).log_prob_latent(z),
        }
        gradient = functools.partial(torch.autograd.grad, inputs=(loc, log_scale), retain_graph=True)
        return {name: torch.stack(gradient(log_prob.sum())) for name, log_prob in log_probs.items()}


def score_estimators(
    mu: float = 0.8, sigma: float = 1.0, peak: float = 1.0, share: float = 1.0
) -> Explorable:
    """Mean and spread of three estimators of the policy gradient, over μ, σ, the best action and the baseline.

    Args:
        mu: Initial μ, in [-2.4, 2.4].
        sigma: Initial σ, in [0.1, e].
        peak: Initial best action, in [-1.5, 1.5].
        share: Initial share of the mean reward that is subtracted, in [0, 1].

    Returns:
        An explorable with the estimators' means and standard deviations against μ, and a table of both, for the
        gradients in μ and in log σ.

    Raises:
        ValueError: If a value lies outside its slider.

    Example:
        >>> score_estimators(peak=1.5).name
        'score-estimators'
    """
    log_sigma = float(np.log(sigma)) if sigma > 0 else -np.inf
    inside = abs(mu) <= 2.4 and -2.31 <= log_sigma <= 1.0 and abs(peak) <= 1.5 and 0.0 <= share <= 1.0
    if not inside:
        raise ValueError(
            f"mu={mu:g}, sigma={sigma:g}, peak={peak:g}, share={share:g} lie outside the sliders: choose mu in "
            "[-2.4, 2.4], sigma in [0.1, 2.71], peak in [-1.5, 1.5], share in [0, 1]"
        )
    step = OneStep(mu, sigma, peak, share)
    bias = step.moments()["clipped"][0][0] - step.moments()["capg"][0][0]
    return Explorable(
        name="score-estimators",
        title="three estimators of a policy gradient, over location μ, scale σ, best action and baseline",
        alt=(
            "Expected gradient in μ and standard deviation of one sample, against μ, for three estimators. The score "
            "at the drawn action and CAPG have one mean, the true gradient, and CAPG never the larger spread; the "
            f"score at the clipped action has another mean: at μ = {mu:g}, σ = {sigma:g} it is off by {bias:.2f}."
        ),
        controls=(
            slider("mu", "location μ", -2.4, 2.4, mu, 0.1),
            slider("log_sigma", "scale σ (logarithmic)", -2.3, 1.0, log_sigma, 0.1, log=True),
            slider("peak", "best action", -1.5, 1.5, peak, 0.1),
            slider("share", "baseline / mean reward", 0.0, 1.0, share, 0.1),
        ),
        plots=tuple(
            _panel(key, label, height)
            for key, label, height in (
                ("mean", "expected gradient in μ", 300),
                ("std", "its std. deviation", 240),
            )
        ),
        columns={name: look.label for name, look in ESTIMATORS.items()},
        rows={
            "mean_loc": "gradient in μ: mean",
            "bias_loc": "bias",
            "std_loc": "standard deviation",
            "mean_log_scale": "gradient in log σ: mean",
            "bias_log_scale": "bias",
            "std_log_scale": "standard deviation",
        },
        fallback=lambda: _static(step),
        looks=ESTIMATORS,
        legend=(Mark("upright", "line", "your μ", of=("at-mean", "at-std")),),
    )


def _panel(key: str, label: str, height: int) -> figure:
    """Draw one plot against μ: a curve per estimator and a line at the slider's μ."""
    fig = plot("location μ (the box is [−1, 1])", label, (-2.4, 2.4), key, height=height)
    marker = ColumnDataSource({"x": [], "y": []}, name=f"at-{key}")
    fig.line("x", "y", source=marker, name="line", line_width=1)
    for name, look in ESTIMATORS.items():
        curve(fig, name, look, source=f"{key}-{name}")
    return fig


def _static(step: OneStep) -> Figure:
    """Draw the static figure of `score_estimators`."""
    locs = np.linspace(-2.4, 2.4, 121)
    found = [OneStep(loc, step.sigma, step.peak, step.share).moments() for loc in locs]
    with figures.use_style():
        fig, axes = plt.subplots(2, 1, sharex=True, figsize=(figures.WIDTH, 5.4))
        for row, (ax, label) in enumerate(
            zip(axes, ("expected gradient in μ", "standard deviation"), strict=True)
        ):
            ax.axvline(step.mu, color="#5F6770", linewidth=1)
            for name, look in ESTIMATORS.items():
                values = [each[name][row][0] for each in found]
                ax.plot(locs, values, color=look.color, linestyle=look.linestyle, label=look.label)
            ax.set_ylabel(label)
        axes[1].set_xlabel("location μ (the box is [−1, 1])")
        axes[0].legend(loc="upper center", bbox_to_anchor=(0.5, 1.26), ncols=3, columnspacing=1.0)
    return fig
