"""An explorable: what λ trades, bias for variance, where both are known exactly.

::

    from inbounds.book.explorables.bias_and_variance import bias_and_variance

    bias_and_variance()

The mathematics runs in the reader's browser (`explorables/bias_and_variance.js`) and is tested against this module,
and this module against the package's `inbounds.learning.gae`, on exact means and on simulated rollouts.
"""

from __future__ import annotations

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from bokeh.models import ColumnDataSource
from bokeh.plotting import figure
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from inbounds.book.drawing import figures
from inbounds.book.explorables.frame import Explorable, curve, plot, slider
from inbounds.book.explorables.legend import Mark

__all__ = ["FAULTS", "Fork", "bias_and_variance"]

FAULTS: dict[str, figures.FamilyStyle] = {
    "bias": figures.FamilyStyle("bias²", "#A8330A", "#DD5B33", "--", "s"),
    "variance": figures.FamilyStyle("variance", "#CC7E14", "#FFD394", "-.", "D"),
    "sum": figures.FamilyStyle("sum", "#4B1E78", "#A98BF0", "-", "o"),
}
"""The two faults of an estimate and their sum, the mean squared error, and the look of each."""

LEGEND = (
    Mark(
        "ring", "ink", "at this λ, where the upright line is", of=(*(f"{name}-here" for name in FAULTS), "at")
    ),
    Mark("diamond", "ink", "the smallest sum", of=("best",)),
    Mark("bars", "line", "weights of the residuals at this λ", of=("weights",)),
)
"""What the marks mean that the table does not name."""

_LAMBDA, _MISSED, _OFFSET, _VISITS = (0.0, 1.0), (0.0, 1.0), (0.0, 1.0), (1, 20)
_STEPS = 25


@dataclass(frozen=True)
class Fork:
    """A rover at a fork, a critic, and the GAE estimate of the policy gradient there.

    The rover turns right or left with probability 1/2, and never turns again. Every step pays a reward with standard
    deviation 1; its mean is 0 at the fork, `pay` on the right road and −`pay` on the left. So the advantage of
    turning right is γ pay/(1 − γ), and that of turning left its negative. The critic's value of a road is the true
    one times 1 − `missed`; its value of the fork is off by `offset` times the advantage.

    Its `faults` has an example.
    """

    missed: float
    """What the critic misses of a road's value, a share: 0 is a perfect critic, 1 one that knows nothing."""
    offset: float = 0.0
    """The critic's error in the fork itself, a baseline, in advantages of turning right."""
    visits: int = 1
    """Independent visits to the fork, over which the estimate is averaged."""
    gamma: float = 0.9
    """γ, the discount."""
    pay: float = 0.2
    """Mean reward of a step on the right road, in standard deviations of one reward."""

    @property
    def advantage(self) -> float:
        """The advantage of turning right."""
        return self.gamma * self.pay / (1 - self.gamma)

    def faults(self, lam: ArrayLike) -> dict[str, NDArray[np.float64]]:
        """Return squared bias, variance and their sum for some λ, as shares of the squared gradient.

        Args:
            lam: λ, `[...]`, in [0, 1].

        Returns:
            By the keys of `FAULTS`, `[...]` each.

        Example:
            >>> found = Fork(missed=0.6, visits=4).faults([0.0, 0.9, 1.0])
            >>> {name: values.round(3).tolist() for name, values in found.items()}
            {'bias': [0.36, 0.1, 0.0], 'variance': [0.077, 0.224, 0.406], 'sum': [0.437, 0.324, 0.406]}
        """
        lam = np.asarray(lam, np.float64)
        decay = self.gamma * lam
        bias = (self.missed * (1 - lam) / (1 - decay)) ** 2
        variance = (1 / (1 - decay**2) / self.advantage**2 + self.offset**2) / self.visits
        return {"bias": bias, "variance": variance, "sum": bias + variance}

    def best(self) -> float:
        """Return the λ of the smallest sum, to three digits.

        Example:
            >>> [round(Fork(missed=0.6, visits=n).best(), 2) for n in (1, 4, 16)]
            [0.19, 0.92, 0.99]
        """
        grid = np.linspace(0.0, 1.0, 1001)
        return float(grid[self.faults(grid)["sum"].argmin()])


def bias_and_variance(
    lam: float = 0.5, missed: float = 0.6, offset: float = 0.3, visits: int = 4
) -> Explorable:
    """Bias, variance and their sum of an advantage estimate over λ, and the weights of the residuals.

    Args:
        lam: Initial λ, in [0, 1].
        missed: Initial share of a road's value that the critic misses, in [0, 1].
        offset: Initial error of the critic in the fork, in [0, 1].
        visits: Initial number of visits that are averaged, in [1, 20].

    Returns:
        An explorable with the three curves against λ, the point where the reader stands and the smallest sum; the
        weights of the residuals; and a table of the three numbers for four λ.

    Raises:
        ValueError: If a value lies outside its slider.

    Example:
        >>> bias_and_variance(missed=0.0).name
        'bias-and-variance'
    """
    values = (lam, _LAMBDA), (missed, _MISSED), (offset, _OFFSET), (visits, _VISITS)
    if not all(low <= value <= high for value, (low, high) in values):
        raise ValueError(
            f"lam={lam:g}, missed={missed:g}, offset={offset:g}, visits={visits:g} lie outside the sliders: choose "
            "lam, missed and offset in [0, 1], visits in [1, 20]"
        )
    fork = Fork(missed, offset, visits)
    here = {name: float(value) for name, value in fork.faults(lam).items()}
    count = slider("visits", "visits to the fork, averaged", *_VISITS, visits, 1)
    count.format = "0"
    return Explorable(
        name="bias-and-variance",
        title="bias and variance of the advantage estimate, over λ, the critic's errors and the number of visits",
        alt=(
            "Squared bias, variance and their sum against λ, as shares of the squared gradient, and below them the "
            "weights of the residuals that follow. The bias falls to zero at λ = 1 and the variance rises. At "
            f"λ = {lam:g}, for a critic that misses {missed:.0%} of what follows, the squared bias is "
            f"{here['bias']:.3f} and the variance {here['variance']:.3f}; the sum is smallest at λ = {fork.best():.2f}."
        ),
        controls=(
            slider("lam", "λ of the estimate", *_LAMBDA, lam, 0.05),
            slider("missed", "critic's error on the roads [share]", *_MISSED, missed, 0.1),
            slider("offset", "critic's error at the fork [share]", *_OFFSET, offset, 0.1),
            count,
        ),
        plots=(_curves(), _weights()),
        columns={name: look.label for name, look in FAULTS.items()},
        rows={
            "residual": "λ = 0, residual",
            "here": "this λ",
            "rest": "λ = 1, all rewards",
            "best": "smallest sum ◇",
        },
        fallback=lambda: _static(fork, lam),
        looks=FAULTS,
        legend=LEGEND,
    )


def _curves() -> figure:
    """Draw the upper plot, empty: the curves, rings at the reader's λ, a diamond at the smallest sum."""
    fig = plot("λ", "squared error / gradient²", _LAMBDA, "y", height=300)
    fig.x_range.update(start=-0.02, end=1.02)
    fig.line("x", "y", source=ColumnDataSource({"x": [], "y": []}, name="at"), name="line", line_width=1)
    for name, look in reversed(FAULTS.items()):  # without a bias the variance lies on the sum, and shows
        curve(fig, name, look, source=name)
    for name in FAULTS:
        ring = ColumnDataSource({"x": [], "y": []}, name=f"{name}-here")
        fig.scatter("x", "y", source=ring, name=name, size=11, line_width=3, fill_alpha=0.0)
    best = ColumnDataSource({"x": [], "y": []}, name="best")
    fig.scatter("x", "y", source=best, name="ink", marker="diamond", size=17, line_width=2, fill_alpha=0.0)
    return fig


def _weights() -> figure:
    """Draw the lower plot, empty: a bar per residual."""
    fig = plot("l, steps after the fork", "weight (γλ)ˡ", (-0.7, _STEPS - 0.3), "weight", height=170)
    bars = ColumnDataSource({"x": [], "top": []}, name="weights")
    fig.vbar("x", top="top", source=bars, name="line", width=0.6, fill_alpha=0.55)
    return fig


def _static(fork: Fork, lam: float) -> Figure:
    """Draw the static figure of `bias_and_variance`."""
    grid = np.linspace(0.0, 1.0, 101)
    steps = np.arange(_STEPS)
    with figures.use_style():
        fig, (top, low) = plt.subplots(2, 1, figsize=(figures.WIDTH, 5.0), height_ratios=(2.2, 1))
        top.axvline(lam, color="#5F6770", linewidth=1)
        for name, values in reversed(fork.faults(grid).items()):
            look = FAULTS[name]
            top.plot(grid, values, color=look.color, linestyle=look.linestyle, label=look.label)
            at = float(fork.faults(lam)[name])
            top.plot([lam], [at], "o", color=look.color, markerfacecolor="none", ms=8, mew=2)
        best = fork.best()
        smallest = float(fork.faults(best)["sum"])
        top.plot([best], [smallest], "D", color="#22272D", markerfacecolor="none", ms=8, mew=1.5)
        top.set(xlabel="λ", ylabel="squared error / gradient²", ylim=(0, None))
        top.legend(loc="upper center", bbox_to_anchor=(0.5, 1.18), ncols=3, reverse=True)
        low.bar(steps, (fork.gamma * lam) ** steps, width=0.6, color="#5F6770")
        low.set(xlabel="l, steps after the fork", ylabel="weight (γλ)ˡ", ylim=(0, 1.05))
    return fig
