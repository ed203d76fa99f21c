"""An explorable: one step of REINFORCE from a batch of draws, beside the exact step.

::

    from inbounds.book.explorables.reinforce_step import reinforce_step

    reinforce_step()

The mathematics runs in the reader's browser (`explorables/reinforce_step.js`) and is tested against this module,
whose gradients are autograd's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
import torch
from bokeh.models import ColumnDataSource, Range1d
from bokeh.plotting import figure
from matplotlib.figure import Figure
from torch import Tensor
from torch.distributions import Normal

from inbounds.book.drawing import figures
from inbounds.book.explorables.frame import DASHES, Explorable, curve, plot, slider
from inbounds.book.explorables.legend import Mark

__all__ = ["POLICIES", "StepOfReinforce", "reinforce_step"]

POLICIES: dict[str, figures.FamilyStyle] = {
    "old": figures.FamilyStyle("before", "#CC7E14", "#FFD394", "-.", "D"),
    "sampled": figures.FamilyStyle("after this batch", "#A8330A", "#DD5B33", "--", "s"),
    "exact": figures.FamilyStyle("after the exact step", "#4B1E78", "#A98BF0", "-", "o"),
}
"""The policy before and after a step, and the look of each."""

LEGEND = (
    Mark("line", "ink", "first plot: the reward", of=("reward",)),
    Mark("dotted", "ink", "the baseline", of=("baseline",)),
    Mark(
        "ring",
        "sampled",
        "the draws of this batch; in the last plot its gradient",
        of=("draws", "end-sampled", "arrow-sampled"),
    ),
    Mark("ring", "exact", "the exact gradient", of=("end-exact", "arrow-exact")),
    Mark("small ring", "sampled", "the gradients of 200 batches", of=("cloud",)),
    Mark("oval", "exact", "two standard deviations about the exact gradient", of=("ellipse",)),
)
"""What the marks mean that the table does not name."""

_WIDTH = 0.8
_LATENTS, _GRADIENTS = (-4.0, 4.0), (-1.6, 1.6)
_PEAK, _DRAWS, _BATCH, _SHARE, _RATE = (-3.0, 3.0), (1, 64), (1, 30), (0.0, 1.0), (0.1, 1.0)


@dataclass(frozen=True)
class StepOfReinforce:
    """One state, one step: z ~ N(0, 1) is paid 1 + exp(-(z - peak)² / (2 · 0.8²)), less a baseline.

    Gradients `[2]` are those in (μ, log σ), float64.

    Example:
        >>> step = StepOfReinforce(peak=1.5, draws=8, batch=3, share=1.0)
        >>> [round(float(g), 3) for g in step.exact()]
        [0.288, 0.071]
    """

    peak: float = 1.5
    """The best latent."""
    draws: int = 8
    """Draws in a batch, 1 to 64."""
    batch: int = 3
    """Number of the batch, from 1: which draws."""
    share: float = 0.0
    """Of the expected reward, how much is subtracted: 0 is no baseline, 1 the value of the state."""
    rate: float = 0.5
    """Learning rate: the step is the gradient times it."""

    def reward(self, z: Tensor) -> Tensor:
        """Return the reward `[...]` of latents `[...]`, from 1 to 2."""
        return 1.0 + torch.exp(-0.5 * ((z - self.peak) / _WIDTH) ** 2)

    def expected(self, loc: Tensor, log_scale: Tensor) -> Tensor:
        """Return the expected reward `[]` under N(μ, σ²), by the trapezoid rule on ±9 σ."""
        t = torch.linspace(-9.0, 9.0, 2001, dtype=torch.float64)
        weights = Normal(0.0, 1.0).log_prob(t).exp() * (t[1] - t[0])
        return (weights * self.reward(loc + log_scale.exp() * t)).sum()

    @property
    def baseline(self) -> float:
        """What is subtracted from each reward."""
        return self.share * float(self.expected(*torch.zeros(2, dtype=torch.float64)))

    def latents(self) -> Tensor:
        """Return the batch's draws `[draws]`, the same on every machine: Lehmer's generator and Box–Muller pairs."""
        state, found = 12345 + 7919 * self.batch, []
        uniforms = []
        for _ in range(10 + 2 * ((self.draws + 1) // 2)):
            state = 48271 * state % 2147483647
            uniforms.append(state / 2147483647)
        for u, v in zip(uniforms[10::2], uniforms[11::2], strict=True):
            radius, angle = math.sqrt(-2 * math.log(u)), 2 * math.pi * v
            found += [radius * math.cos(angle), radius * math.sin(angle)]
        return torch.tensor(found[: self.draws], dtype=torch.float64)

    def exact(self) -> Tensor:
        """Return the gradient `[2]` of the expected reward: through the reward, without a score."""
        parameters = torch.zeros(2, dtype=torch.float64, requires_grad=True)
        (gradient,) = torch.autograd.grad(self.expected(*parameters), parameters)
        return gradient

    def sampled(self) -> Tensor:
        """Return the batch's estimate `[2]`, as the chapter's program takes it: mean weight times log-probability."""
        parameters = torch.zeros(2, dtype=torch.float64, requires_grad=True)
        z = self.latents()
        weight = self.reward(z) - self.baseline
        loc, log_scale = parameters
        objective = (weight * Normal(loc, log_scale.exp()).log_prob(z)).mean()
        (gradient,) = torch.autograd.grad(objective, parameters)
        return gradient

    def covariance(self) -> Tensor:
        """Return the covariance `[2, 2]` of a batch's estimate, by the trapezoid rule."""
        z = torch.linspace(-9.0, 9.0, 2001, dtype=torch.float64)
        weights = Normal(0.0, 1.0).log_prob(z).exp() * (z[1] - z[0])
        each = (self.reward(z) - self.baseline) * torch.stack([z, z**2 - 1.0])  # [2, N]
        away = each - self.exact()[:, None]
        return (weights * away) @ away.T / self.draws

    def after(self, gradient: Tensor) -> tuple[float, float]:
        """Return μ and σ after a step along a gradient `[2]`; log σ is clipped to [-10, 1], as in the program."""
        loc, log_scale = (self.rate * gradient).tolist()
        return loc, math.exp(min(1.0, max(-10.0, log_scale)))


def reinforce_step(
    peak: float = 1.5, draws: int = 8, batch: int = 3, share: float = 1.0, rate: float = 1.0
) -> Explorable:
    """Show one step of REINFORCE from a batch of draws beside the exact step, and the steps of 200 such batches.

    Args:
        peak: Initial best latent, in [-3, 3].
        draws: Initial number of draws in a batch, 1 to 64.
        batch: Initial batch, 1 to 30.
        share: Initial share of the expected reward that is subtracted, in [0, 1].
        rate: Initial learning rate, in [0.1, 1].

    Returns:
        An explorable with the draws on the reward, the policy before and after, and the gradients of 200 batches about
        the exact one; and a table of expected rewards, steps, and their spreads.

    Raises:
        ValueError: If a value lies outside its slider.

    Example:
        >>> reinforce_step(draws=4).name
        'reinforce-step'
    """
    values = (peak, _PEAK), (draws, _DRAWS), (batch, _BATCH), (share, _SHARE), (rate, _RATE)
    if not all(low <= value <= high for value, (low, high) in values):
        raise ValueError(
            f"peak={peak:g}, draws={draws}, batch={batch}, share={share:g}, rate={rate:g} lie outside the sliders: "
            "choose peak in [-3, 3], draws in [1, 64], batch in [1, 30], share in [0, 1], rate in [0.1, 1]"
        )
    step = StepOfReinforce(peak, draws, batch, share, rate)
    exact, sampled = step.exact(), step.sampled()
    spread = float(step.covariance()[0, 0].sqrt())
    return Explorable(
        name="reinforce-step",
        title="one step of REINFORCE, over the reward, the batch, the baseline and the learning rate",
        alt=(
            "Three plots. Draws of a policy on a reward with one peak; the policy's density before, after the step of "
            "this batch, and after the exact step; and the gradients of 200 batches in the plane of μ and log σ, a "
            f"cloud about the exact one. With {draws} draws and {share:.0%} of the expected reward as baseline, the "
            f"gradient in μ is {float(sampled[0]):.2f} from this batch and {float(exact[0]):.2f} exactly, and its "
            f"standard deviation over batches is {spread:.2f}."
        ),
        controls=(
            slider("draws", "draws in a batch", *_DRAWS, draws, 1, digits=0),
            slider("batch", "which batch", *_BATCH, batch, 1, digits=0),
            slider("share", "baseline / mean reward", *_SHARE, share, 0.1),
            slider("peak", "best latent", *_PEAK, peak, 0.1),
            slider("rate", "learning rate", *_RATE, rate, 0.05),
        ),
        plots=(_rewards(), _densities(), _gradients()),
        columns={name: look.label for name, look in POLICIES.items()},
        rows={
            "expected": "expected reward",
            "mu": "μ",
            "sigma": "σ",
            "step_loc": "step in μ",
            "spread_loc": "its std. over batches",
            "step_log_scale": "step in log σ",
            "spread_log_scale": "its std. over batches",
        },
        fallback=lambda: _static(step),
        looks=POLICIES,
        legend=LEGEND,
    )


def _rewards() -> figure:
    """Draw the plot of the reward, the baseline and the draws."""
    fig = plot("latent z", "reward", _LATENTS, "", height=170)
    fig.y_range = Range1d(-0.1, 2.2)
    for source, dash in (("reward", []), ("baseline", DASHES[":"])):
        data = ColumnDataSource({"x": [], "y": []}, name=source)
        fig.line("x", "y", source=data, name="ink", line_width=2, line_dash=dash)
    _points(fig, "draws", "sampled", size=9)
    fig.min_border_left = 64
    return fig


def _densities() -> figure:
    """Draw the plot of the policy before and after the steps."""
    fig = plot("latent z", "density", _LATENTS, "density", height=200)
    for name, look in POLICIES.items():
        curve(fig, name, look, source=name)
    fig.min_border_left = 64
    return fig


def _gradients() -> figure:
    """Draw the plot of the batches' gradients about the exact one."""
    fig = plot("gradient in μ", "gradient in log σ", _GRADIENTS, "", height=300)
    fig.y_range = Range1d(*_GRADIENTS)
    _points(fig, "cloud", "sampled", size=4, width=1, alpha=0.6)
    for source, name, width in (
        ("ellipse", "exact", 1),
        ("arrow-sampled", "sampled", 3),
        ("arrow-exact", "exact", 3),
    ):
        data = ColumnDataSource({"x": [], "y": []}, name=source)
        fig.line("x", "y", source=data, name=name, line_width=width)
    for name in ("sampled", "exact"):
        _points(fig, f"end-{name}", name, size=12)
    fig.min_border_left = 64
    return fig


def _points(fig: figure, source: str, color: str, *, size: int, width: int = 2, alpha: float = 1.0) -> None:
    """Add circles, none yet, in the colour of one of `POLICIES`."""
    data = ColumnDataSource({"x": [], "y": []}, name=source)
    fig.scatter(
        "x", "y", source=data, name=color, size=size, line_width=width, line_alpha=alpha, fill_alpha=0.0
    )


def _static(step: StepOfReinforce) -> Figure:
    """Draw the static figure of `reinforce_step`."""
    z = torch.linspace(*_LATENTS, 81, dtype=torch.float64)
    gradients = {"sampled": step.sampled(), "exact": step.exact()}
    laws = {"old": (0.0, 1.0)} | {name: step.after(found) for name, found in gradients.items()}
    hollow = {"color": POLICIES["sampled"].color, "markerfacecolor": "none", "linestyle": "none"}
    with figures.use_style():
        fig, (top, middle, below) = plt.subplots(3, 1, figsize=(figures.WIDTH, 7.4), height_ratios=(2, 2, 4))
        top.plot(z, step.reward(z), color="#22272D", linestyle="-")
        top.axhline(step.baseline, color="#22272D", linestyle=":")
        top.plot(step.latents(), step.reward(step.latents()), "o", **hollow)
        top.set(ylabel="reward", ylim=(-0.1, 2.2), xlim=_LATENTS)
        for name, (loc, scale) in laws.items():
            look = POLICIES[name]
            density = Normal(loc, scale).log_prob(z).exp()
            middle.plot(z, density, color=look.color, linestyle=look.linestyle, label=look.label)
        middle.set(xlabel="latent z", ylabel="density", xlim=_LATENTS, ylim=(0.0, None))
        fig.legend(*middle.get_legend_handles_labels(), loc="outside upper center", ncols=3)
        cloud = torch.stack(
            [StepOfReinforce(step.peak, step.draws, k, step.share).sampled() for k in range(1, 201)], dim=1
        )
        below.plot(*cloud, ".", color=POLICIES["sampled"].color, alpha=0.5, rasterized=True)
        for name, found in gradients.items():
            ends = np.stack([np.zeros(2), found.numpy()], axis=1)
            below.plot(
                *ends, "-o", color=POLICIES[name].color, markerfacecolor="none", markevery=[1], ms=9, mew=2
            )
        angle = torch.linspace(0, 2 * math.pi, 73, dtype=torch.float64)
        around = 2 * torch.linalg.cholesky(step.covariance()) @ torch.stack([angle.cos(), angle.sin()])
        below.plot(
            *(gradients["exact"][:, None] + around), color=POLICIES["exact"].color, linestyle="-", linewidth=1
        )
        below.set(xlabel="gradient in μ", ylabel="gradient in log σ", xlim=_GRADIENTS, ylim=_GRADIENTS)
        below.set(xticks=(-1, 0, 1), yticks=(-1, 0, 1))
    return fig
