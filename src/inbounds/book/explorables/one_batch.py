"""An explorable: many steps on the surrogate of one small batch, what they promise, and what they earn.

::

    from inbounds.book.explorables.one_batch import one_batch

    one_batch()

The mathematics runs in the reader's browser (`explorables/one_batch.js`) and is tested against this module, whose
surrogate is `inbounds.learning.ppo.clipped_surrogate` with a clip that never acts, differentiated by autograd.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
import torch
from bokeh.models import ColumnDataSource
from bokeh.plotting import figure
from matplotlib.figure import Figure
from numpy.typing import NDArray
from torch import Tensor

from inbounds.book.drawing import figures
from inbounds.book.explorables.frame import Explorable, curve, plot, slider
from inbounds.book.explorables.legend import Mark
from inbounds.book.explorables.trust_region import OneMotor
from inbounds.learning.families import FAMILIES, NormalParameters
from inbounds.learning.ppo import clipped_surrogate

__all__ = ["CURVES", "OneBatch", "one_batch"]

CURVES: dict[str, figures.FamilyStyle] = {
    "promise": figures.FamilyStyle("surrogate, promised gain", "#A8330A", "#DD5B33", "-", "s"),
    "truth": figures.FamilyStyle("true gain", "#4B1E78", "#A98BF0", "--", "o"),
    "now": figures.FamilyStyle("at your step", "#CC7E14", "#FFD394", "-.", "D"),
    "brake": figures.FamilyStyle("first step past 0.03 nats", "#1F8277", "#52CCAB", ":", "^"),
}
"""What is promised and what is earned, the reader's step and that of early stopping, and the look of each."""

LEGEND = (
    Mark("thin", "line", "above, the most that any policy can gain", of=("most",)),
    Mark(
        "ring",
        "promise",
        "a draw at its estimated advantage; its area is its weight",
        of=("drawn", "promise-now", "truth-now"),
    ),
    Mark("dashed", "truth", "below, the true advantage of an action", of=("advantage",)),
    Mark("area", "now", "the new policy’s density, not to scale", of=("new",)),
    Mark("thin", "line", "below, the old policy’s density, not to scale", of=("old",)),
)
"""What the marks mean that the table does not name."""

_STEPS, _DRAWS, _NOISE, _BATCH = (0, 100), (10, 200), (0.0, 1.0), (1, 20)
_STEP_KL, _BRAKE = 0.001, 0.03
_LAW = FAMILIES["gaussian"].law


@dataclass(frozen=True)
class OneBatch:
    """Draws of a policy N(0, ½²) paid exp(−2 (a − 0.2)²) for the action a, with noisy advantages.

    Its `climb` has an example.
    """

    draws: int
    """n."""
    noise: float
    """Standard deviation of what is wrong with an advantage."""
    batch: int
    """Seed of the draws."""

    motor = OneMotor(sigma=0.5, peak=0.2, max_kl=_STEP_KL)
    """The policy and the reward."""

    def drawn(self) -> tuple[Tensor, Tensor]:
        """Return the actions and their estimated advantages, of mean zero, `[n]` each."""
        numbers = _normals(self.batch)
        pairs = torch.tensor(list(itertools.islice(numbers, self.draws)), dtype=torch.float64)
        action = self.motor.sigma * pairs[:, 0]
        start = self.motor.worth(torch.zeros(2, dtype=torch.float64))
        estimate = torch.exp(-2 * (action - self.motor.peak) ** 2) - start + self.noise * pairs[:, 1]
        return action, estimate - estimate.mean()

    def climb(self, steps: int = _STEPS[1]) -> dict[str, NDArray[np.float64]]:
        """Return what natural gradient steps of 0.001 nats each do, `[steps + 1]` each.

        Returns:
            mu and sigma of the policy; promise, the surrogate; truth, the gain in mean reward, exact; effective, the
            effective sample size; kl from the old policy, in nats.

        Example:
            >>> path = OneBatch(draws=20, noise=1.0, batch=10).climb()
            >>> (path["promise"][::20].round(2) + 0.0).tolist()  # no -0.0
            [0.0, 0.29, 0.69, 1.19, 1.89, 2.79]
            >>> path["truth"][::20].round(2).tolist()
            [0.0, 0.07, 0.0, -0.07, -0.08, -0.08]
        """
        action, advantage = self.drawn()
        old = torch.tensor([0.0, math.log(self.motor.sigma)], dtype=torch.float64)
        old_log_prob = _log_prob(old, action)
        worth_of_old = self.motor.worth(torch.zeros_like(old))
        theta, path = old.clone(), []
        for _ in range(steps + 1):
            theta.requires_grad_()
            log_prob = _log_prob(theta, action)
            surrogate = clipped_surrogate(log_prob, old_log_prob, advantage, clip_range=1e9).mean()
            (slope,) = torch.autograd.grad(surrogate, theta)
            theta = theta.detach()
            ratio = (log_prob.detach() - old_log_prob).exp()
            path.append(
                {
                    "mu": theta[0],
                    "sigma": theta[1].exp(),
                    "promise": surrogate.detach(),
                    "truth": self.motor.worth(theta - old) - worth_of_old,
                    "effective": ratio.sum() ** 2 / ratio.square().sum(),
                    "kl": self.motor.kl(theta - old),
                }
            )
            direction = slope * torch.stack([(2 * theta[1]).exp(), torch.tensor(0.5)])
            theta = theta + direction * (2 * _STEP_KL / (slope @ direction)).sqrt()
        return {key: np.array([float(at[key]) for at in path]) for key in path[0]}


def _log_prob(theta: Tensor, action: Tensor) -> Tensor:
    return _LAW.log_prob(NormalParameters(theta[:1], theta[1:]), action[:, None])


def _normals(seed: int) -> Iterator[tuple[float, float]]:
    """Yield pairs of normal numbers: mulberry32, Box and Muller, as in one_batch.js."""
    mask, state = 0xFFFFFFFF, seed

    def uniform() -> float:
        nonlocal state
        state = (state + 0x6D2B79F5) & mask
        t = ((state ^ (state >> 15)) * (state | 1)) & mask
        t ^= (t + ((t ^ (t >> 7)) * (t | 61))) & mask
        return (((t ^ (t >> 14)) & mask) + 0.5) / 2**32

    while True:
        radius = math.sqrt(-2 * math.log(uniform()))
        angle = 2 * math.pi * uniform()
        yield radius * math.cos(angle), radius * math.sin(angle)


def one_batch(steps: int = 60, draws: int = 20, noise: float = 1.0, batch: int = 10) -> Explorable:
    """Show what many steps on one batch promise and what they earn, over steps, size of the batch, noise and batch.

    Args:
        steps: Initial number of steps, in [0, 100].
        draws: Initial n, in [10, 200].
        noise: Initial standard deviation of an advantage's error, in [0, 1]; rewards lie in [0, 1].
        batch: Initial number of the batch, in [1, 20].

    Returns:
        An explorable with the surrogate and the true gain against the number of steps, the batch with its weights, and
        a table of both gains, effective sample size and divergence, at the reader's step and where early stopping ends.

    Raises:
        ValueError: If a value lies outside its slider.

    Example:
        >>> one_batch(draws=50).name
        'one-batch'
    """
    values = (steps, _STEPS), (draws, _DRAWS), (noise, _NOISE), (batch, _BATCH)
    if not all(low <= value <= high for value, (low, high) in values):
        raise ValueError(
            f"steps={steps}, draws={draws}, noise={noise:g}, batch={batch} lie outside the sliders: choose steps in "
            "[0, 100], draws in [10, 200], noise in [0, 1], batch in [1, 20]"
        )
    one = OneBatch(draws, noise, batch)
    path = one.climb()
    return Explorable(
        name="one-batch",
        title="many steps on one batch, over steps, size of the batch, noise and batch",
        alt=(
            "Above, the surrogate of one batch and the true gain against the number of steps, with a line at the most "
            "that any policy can gain. Below, the drawn actions at their estimated advantages, as circles that grow "
            "with the weight, over the old and the new policy. After "
            f"{steps} steps on batch {batch} of {draws} draws the surrogate promises {path['promise'][steps]:.2f}, the "
            f"policy gains {path['truth'][steps]:.2f}, and {path['effective'][steps]:.1f} draws still count."
        ),
        controls=(
            slider("steps", "steps on the batch", *_STEPS, steps, 1, digits=0),
            slider("draws", "draws in the batch", *_DRAWS, draws, 10, digits=0),
            slider("noise", "noise of an advantage [std.]", *_NOISE, noise, 0.1),
            slider("batch", "which batch", *_BATCH, batch, 1, digits=0),
        ),
        plots=(_course(), _weighted()),
        columns={name: CURVES[name].label for name in ("now", "brake")},
        rows={
            "promise": CURVES["promise"].label,
            "truth": CURVES["truth"].label,
            "effective": "effective sample size [draws]",
            "kl": "KL from the old policy [nats]",
            "at": "steps taken",
        },
        fallback=lambda: _static(one, steps),
        looks=CURVES,
        legend=LEGEND,
    )


def _course() -> figure:
    """Return the upper plot, empty: gains against steps."""
    fig = plot("steps on one batch", "gain in mean reward", (0.0, 100.0), "gain", height=260)
    most = ColumnDataSource({"x": [], "y": []}, name="most")
    fig.line("x", "y", source=most, name="line", line_width=1)
    for name, look in reversed(CURVES.items()):
        curve(fig, name, look, source=name)
        if name in ("now", "brake"):
            fig.renderers[-1].glyph.line_width = 2
            continue
        point = ColumnDataSource({"x": [], "y": []}, name=f"{name}-now")
        fig.scatter("x", "y", source=point, name=name, size=12, line_width=3, fill_alpha=0.0)
    return fig


def _weighted() -> figure:
    """Return the lower plot, empty: the batch, its weights, and both policies."""
    fig = plot("action", "advantage", (-2.0, 2.0), "paid", height=260)
    fig.xaxis.ticker.desired_num_ticks = 5
    sources = {name: ColumnDataSource({"x": [], "y": []}, name=name) for name in ("new", "old")}
    fig.patch("x", "y", source=sources["new"], name="now", fill_alpha=0.25, line_width=2)
    fig.line("x", "y", source=sources["old"], name="line", line_width=1)
    curve(fig, "truth", CURVES["truth"], source="advantage")
    drawn = ColumnDataSource({"x": [], "y": [], "size": []}, name="drawn")
    fig.scatter("x", "y", size="size", source=drawn, name="promise", line_width=2, fill_alpha=0.0)
    return fig


def _static(one: OneBatch, steps: int) -> Figure:
    """Draw the static figure of `one_batch`."""
    path = one.climb()
    action, estimate = (values.numpy() for values in one.drawn())
    start = float(one.motor.worth(torch.zeros(2, dtype=torch.float64)))
    mu, sigma = path["mu"][steps], path["sigma"][steps]
    u = (action - mu) / sigma
    weight = one.motor.sigma / sigma * np.exp((action / one.motor.sigma) ** 2 / 2 - u**2 / 2)
    with figures.use_style():
        fig, axes = plt.subplots(2, 1, figsize=(figures.WIDTH, 6.4))
        for name in ("promise", "truth"):
            look = CURVES[name]
            axes[0].plot(path[name], color=look.color, linestyle=look.linestyle, label=look.label)
        for name, at in (("now", steps), ("brake", int(np.argmax(path["kl"] > _BRAKE)))):
            look = CURVES[name]
            axes[0].axvline(at, color=look.color, linestyle=look.linestyle, label=look.label)
        axes[0].axhline(1 - start, color="#5F6770", linewidth=1)
        low = min(-0.15, 1.1 * min(path["truth"].min(), path["promise"].min()))
        axes[0].set(xlabel="steps on one batch", ylabel="gain in mean reward", xlim=(0, 100), ylim=(low, 1.5))
        axes[0].legend(loc="upper center", bbox_to_anchor=(0.5, 1.36), ncols=2)
        x = np.linspace(-2, 2, 161)
        look = CURVES["truth"]
        axes[1].plot(
            x, np.exp(-2 * (x - one.motor.peak) ** 2) - start, color=look.color, linestyle=look.linestyle
        )
        size = np.clip(8 * np.sqrt(weight), 2, 60) ** 2 / 2
        axes[1].scatter(
            action, estimate, s=size, facecolors="none", edgecolors=CURVES["promise"].color, linewidths=1.5
        )
        floor, top = estimate.min() - 1.0, estimate.max() + 0.5
        new, old = (
            floor
            + (top - floor) * np.minimum(1.0, 0.3 * one.motor.sigma / s * np.exp(-(((x - m) / s) ** 2) / 2))
            for m, s in ((mu, sigma), (0.0, one.motor.sigma))
        )
        axes[1].fill_between(x, floor, new, color=CURVES["now"].color, alpha=0.25)
        axes[1].plot(x, old, color="#5F6770", linestyle="-", linewidth=1)
        axes[1].set(xlabel="action", ylabel="advantage", xlim=(-2, 2), ylim=(floor, top))
    return fig
