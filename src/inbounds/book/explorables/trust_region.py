"""An explorable: a trust region in the plane of a Gaussian's parameters, the plain and the natural step to its edge.

::

    from inbounds.book.explorables.trust_region import trust_region

    trust_region()

The mathematics runs in the reader's browser (`explorables/trust_region.js`) and is tested against this module, whose
divergence is that of the family `gaussian`, and against `inbounds.learning.trpo`.
"""

from __future__ import annotations

import math
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
from inbounds.learning.families import FAMILIES, NormalParameters

__all__ = ["REGIONS", "STEPS", "OneMotor", "trust_region"]

STEPS: dict[str, figures.FamilyStyle] = {
    "plain": figures.FamilyStyle("plain gradient", "#A8330A", "#DD5B33", "--", "s"),
    "natural": figures.FamilyStyle("natural gradient", "#4B1E78", "#A98BF0", "-", "o"),
}
"""The two steps, and the look of each."""

REGIONS: dict[str, figures.FamilyStyle] = {
    "quadratic": figures.FamilyStyle("KL, quadratic", "#1F8277", "#52CCAB", ":", "^"),
    "exact": figures.FamilyStyle("KL, exact", "#CC7E14", "#FFD394", "-", "D"),
}
"""The two trust regions, and the look of their edges."""

LEGEND = (
    Mark("dotted", "quadratic", "where the quadratic KL reaches the bound", of=("quadratic",)),
    Mark("area", "exact", "where the exact KL is within it", of=("exact",)),
    Mark("thin", "line", "steps of equal predicted gain", of=("level",)),
    Mark("ring", "ink", "the end of a step", of=tuple(f"{name}-end" for name in STEPS)),
    Mark("dot", "ink", "what the line search keeps of it", of=tuple(f"{name}-kept" for name in STEPS)),
)
"""What the marks mean that the table does not name."""

_SIGMA, _PEAK, _MAX_KL = (0.1, math.exp(-0.35)), (-1.0, 1.0), (0.01, 0.5)
_LAW = FAMILIES["gaussian"].law


@dataclass(frozen=True)
class OneMotor:
    """A policy N(0, σ²) of one motor, in one state, paid exp(−2 (a − peak)²) for the action a, and a bound on its KL.

    Steps are changes of (μ, log σ).

    Its `steps` has an example.
    """

    sigma: float
    """σ of the old policy."""
    peak: float
    """The best action, less the old policy's μ."""
    max_kl: float
    """D_max, in nats."""

    def worth(self, step: Tensor) -> Tensor:
        """Return the mean reward after some steps `[..., 2]`, exact: the product of two Gaussians, integrated."""
        loc, log_scale = step[..., 0], step[..., 1] + math.log(self.sigma)
        spread = 0.25 + (2 * log_scale).exp()
        return (0.25 / spread).sqrt() * (-((loc - self.peak) ** 2) / (2 * spread)).exp()

    def kl(self, step: Tensor) -> Tensor:
        """Return KL(old‖new) of some steps `[..., 2]`, in nats."""
        start = step.new_tensor([0.0, math.log(self.sigma)])
        old, new = start.expand_as(step), start + step
        return _LAW.kl(
            NormalParameters(old[..., :1], old[..., 1:]), NormalParameters(new[..., :1], new[..., 1:])
        )

    def slope(self) -> Tensor:
        """Return the gradient of the worth `[2]` at the old policy."""
        return torch.autograd.functional.jacobian(self.worth, torch.zeros(2, dtype=torch.float64))

    def fisher(self) -> Tensor:
        """Return the Fisher matrix `[2, 2]`: the Hessian of the divergence at the old policy."""
        return torch.autograd.functional.hessian(self.kl, torch.zeros(2, dtype=torch.float64))

    def steps(self) -> dict[str, NDArray[np.float64]]:
        """Return the plain and the natural step `[2]`, as long as ½ Δᵀ F Δ ≤ D_max allows.

        Example:
            >>> motor = OneMotor(sigma=0.25, peak=0.1, max_kl=0.02)
            >>> {name: step.round(3).tolist() for name, step in motor.steps().items()}
            {'plain': [0.049, -0.03], 'natural': [0.025, -0.122]}
        """
        slope, fisher = self.slope(), self.fisher()
        directions = {"plain": slope, "natural": torch.linalg.solve(fisher, slope)}
        return {
            name: (x * (2 * self.max_kl / (x @ fisher @ x)).sqrt()).numpy() for name, x in directions.items()
        }

    def kept(self, step: NDArray[np.float64]) -> float:
        """Return the share of a step that a line search keeps: halved until KL and gain allow it, at most nine times.

        Example:
            >>> motor = OneMotor(sigma=0.25, peak=0.1, max_kl=0.1)
            >>> [motor.kept(step) for step in motor.steps().values()]
            [0.5, 0.5]
        """
        start = self.worth(torch.zeros(2, dtype=torch.float64))
        for share in 0.5 ** np.arange(10.0):
            tried = torch.from_numpy(share * step)
            if self.kl(tried) <= self.max_kl and self.worth(tried) > start:
                return float(share)
        return 0.0

    def edge(self, points: int = 241) -> NDArray[np.float64]:
        """Return steps `[points, 2]` on the edge of the exact region KL ≤ D_max, found by bisection along rays."""
        angle = torch.linspace(0, 2 * math.pi, points, dtype=torch.float64)
        rays = torch.stack([self.sigma * math.sqrt(2) * angle.cos(), angle.sin()], -1)
        inside, outside = torch.zeros_like(angle), torch.full_like(angle, 3.0)
        for _ in range(60):
            middle = (inside + outside) / 2
            within = self.kl(middle[:, None] * rays) <= self.max_kl
            inside, outside = torch.where(within, middle, inside), torch.where(within, outside, middle)
        return (inside[:, None] * rays).numpy()


def trust_region(sigma: float = 0.25, peak: float = 0.1, max_kl: float = 0.1) -> Explorable:
    """Show the region that a bound on the divergence leaves, and two steps to its edge, over σ, reward and bound.

    Args:
        sigma: Initial σ of the old policy, in [0.1, 0.7].
        peak: Initial best action, less the old policy's μ, in [-1, 1].
        max_kl: Initial D_max in nats, in [0.01, 0.5].

    Returns:
        An explorable with the region KL(old‖new) ≤ D_max, exact and to second order, in the plane of the changes of μ
        and log σ, with the plain and the natural gradient's step, and a table of their gains and divergences.

    Raises:
        ValueError: If a value lies outside its slider.

    Example:
        >>> trust_region(sigma=0.5).name
        'trust-region'
    """
    values = (sigma, _SIGMA), (peak, _PEAK), (max_kl, _MAX_KL)
    if not all(low <= value <= high for value, (low, high) in values):
        raise ValueError(
            f"sigma={sigma:g}, peak={peak:g}, max_kl={max_kl:g} lie outside the sliders: choose sigma in [0.1, 0.7], "
            "peak in [-1, 1], max_kl in [0.01, 0.5]"
        )
    motor = OneMotor(sigma, peak, max_kl)
    plain, natural = (float(motor.slope() @ torch.from_numpy(step)) for step in motor.steps().values())
    return Explorable(
        name="trust-region",
        title="a trust region and two steps to its edge, over scale, reward and bound",
        alt=(
            "In the plane of the changes of μ and of log σ, an ellipse, the quadratic trust region, and the exact one, "
            "shaped like an egg. Two steps lead from the centre to the ellipse. A line of equal predicted gain touches "
            f"the ellipse at the natural step. At σ = {sigma:g}, best action {peak:g} from μ and a bound of "
            f"{max_kl:g} nats the plain step is promised {plain:.3f}, the natural step {natural:.3f}."
        ),
        controls=(
            slider("log_sigma", "scale σ (logarithmic)", -2.3, -0.35, math.log(sigma), 0.05, log=True),
            slider("peak", "best action minus μ", *_PEAK, peak, 0.05),
            slider(
                "log_max_kl", "bound on the KL [nats]", -4.6, -0.7, math.log(max_kl), 0.1, log=True, digits=3
            ),
        ),
        plots=(_plane(),),
        columns={name: look.label for name, look in STEPS.items()},
        rows={
            "predicted": "predicted gain",
            "gain": "true gain",
            **{name: f"{look.label} [nats]" for name, look in REGIONS.items()},
            "kept": "line search keeps",
        },
        fallback=lambda: _static(motor),
        looks=STEPS | REGIONS,
        legend=LEGEND,
    )


def _plane() -> figure:
    """Return the empty picture: as wide as high, so that a right angle looks like one."""
    fig = plot("change of μ", "change of log σ", (-1.0, 1.0), "y")
    fig.x_range.name = "x"
    fig.update(
        sizing_mode="scale_width", aspect_ratio=1.0, height=None,
        styles={"width": "min(100%, 500px)", "margin": "0 auto"},
        min_border_left=70, min_border_right=8, min_border_top=8, min_border_bottom=70,
    )  # fmt: skip
    for axis in fig.axis:
        axis.ticker.desired_num_ticks = 4
    data = {name: ColumnDataSource({"x": [], "y": []}, name=name) for name in ("exact", "level")}
    fig.patch("x", "y", source=data["exact"], name="exact", fill_alpha=0.15, line_width=2)
    curve(fig, "quadratic", REGIONS["quadratic"], source="quadratic")
    fig.line("x", "y", source=data["level"], name="line", line_width=1)
    for name, look in STEPS.items():
        curve(fig, name, look, source=name)
        for point, marker, size in (("end", "circle", 14), ("kept", "dot", 40)):
            source = ColumnDataSource({"x": [], "y": []}, name=f"{name}-{point}")
            fig.scatter(
                "x", "y", source=source, name=name, marker=marker, size=size, line_width=3, fill_alpha=0.0
            )
    return fig


def _static(motor: OneMotor) -> Figure:
    """Draw the static figure of `trust_region`."""
    angle = np.linspace(0, 2 * np.pi, 241)
    width, height = motor.sigma * np.sqrt(2 * motor.max_kl), np.sqrt(motor.max_kl)
    edges = {
        "quadratic": np.stack([width * np.cos(angle), height * np.sin(angle)], -1),
        "exact": motor.edge(),
    }
    half = 1.1 * (2 * motor.max_kl) ** 0.4
    slope = motor.slope().numpy()
    with figures.use_style():
        fig, ax = plt.subplots(figsize=(figures.WIDTH, 4.4))
        ax.fill(*edges["exact"].T, color=REGIONS["exact"].color, alpha=0.15, linewidth=0)
        for name, look in REGIONS.items():
            ax.plot(*edges[name].T, color=look.color, linestyle=look.linestyle, label=look.label)
        for name, step in motor.steps().items():
            look = STEPS[name]
            ax.plot([0, step[0]], [0, step[1]], color=look.color, linestyle=look.linestyle, label=look.label)
            ax.plot(*step, "o", color=look.color, markerfacecolor="none", ms=10, mew=2)
            ax.plot(*(motor.kept(step) * step), "o", color=look.color, ms=6)
        ax.axline(step, step + np.array([-slope[1], slope[0]]), color="#5F6770", linewidth=1)
        ax.set(
            xlabel="change of μ",
            ylabel="change of log σ",
            xlim=(-half, half),
            ylim=(-half, half),
            aspect="equal",
        )
        ax.legend(loc="center left", bbox_to_anchor=(1.05, 0.5))
    return fig
