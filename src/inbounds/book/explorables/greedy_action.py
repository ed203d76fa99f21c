"""An explorable: three greedy actions of a logit-normal policy, over its parameters.

::

    from inbounds.book.explorables.greedy_action import greedy_actions

    greedy_actions()

The mathematics runs in the reader's browser (`explorables/greedy_action.js`) and is tested against this package.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import matplotlib.pyplot as plt
import numpy as np
import torch
from bokeh.models import ColumnDataSource
from bokeh.plotting import figure
from matplotlib.figure import Figure

from inbounds.book.drawing import figures
from inbounds.book.explorables.frame import BOUNDS, Explorable, bounds, curve, family_curve, plot, slider
from inbounds.book.explorables.legend import Mark
from inbounds.distributions import LogitNormal

__all__ = ["CENTRES", "GreedyActions", "greedy_actions"]

CENTRES: Mapping[str, figures.FamilyStyle] = MappingProxyType(
    {
        "mean": figures.FamilyStyle("mean", figures.SHADES[1], "#D0C8F8", ":", "^"),
        "median": figures.FamilyStyle("median", figures.SHADES[2], "#A840F8", "-", "o"),
        "mode": figures.FamilyStyle("mode", figures.SHADES[0], "#E07878", "--", "s"),
    }
)
"""The three centres and the look of each, throughout the chapter."""

_MU, _LOG_SIGMA = (-4.0, 4.0), (-3.0, 1.0)


@dataclass(frozen=True)
class GreedyActions:
    """Mean, median and mode of the action tanh(z/2) for a latent z ~ N(μ, σ²).

    Its `actions` has an example.
    """

    mu: float
    """μ, location of the latent."""
    sigma: float
    """σ, its scale."""

    @property
    def law(self) -> LogitNormal:
        """The logit-normal on (-1, 1), float64."""
        loc, scale = torch.tensor([self.mu, self.sigma], dtype=torch.float64)
        return LogitNormal(loc, scale, low=-1.0, high=1.0)

    @property
    def actions(self) -> dict[str, float]:
        """The three greedy actions, by the names of `CENTRES`.

        Example:
            >>> {name: round(a, 2) for name, a in GreedyActions(mu=0.1, sigma=2.0).actions.items()}
            {'mean': 0.03, 'median': 0.05, 'mode': 0.96}
        """
        return {name: float(getattr(self.law, name)) for name in CENTRES}

    @property
    def slopes(self) -> dict[str, float]:
        """Their derivatives with respect to μ.

        Example:
            >>> {name: round(s, 2) for name, s in GreedyActions(mu=0.1, sigma=1.0).slopes.items()}
            {'mean': 0.41, 'median': 0.5, 'mode': 0.98}
        """
        found = {}
        for name in CENTRES:
            loc = torch.tensor(self.mu, dtype=torch.float64, requires_grad=True)
            law = LogitNormal(loc, torch.tensor(self.sigma, dtype=torch.float64), low=-1.0, high=1.0)
            (slope,) = torch.autograd.grad(getattr(law, name), loc)
            found[name] = float(slope)
        return found


def greedy_actions(mu: float = 0.3, sigma: float = 1.6) -> Explorable:
    """Mean, median and mode of a logit-normal: in its density, and over μ and over σ.

    Args:
        mu: Initial μ, in [-4, 4].
        sigma: Initial σ, in [0.05, e].

    Returns:
        An explorable with three pictures and a table of actions, errors and slopes.

    Raises:
        ValueError: If μ or σ lies outside its slider.

    Example:
        >>> greedy_actions(sigma=0.5).name
        'greedy-action'
    """
    log_sigma = float(np.log(sigma)) if sigma > 0 else -np.inf
    if not (_MU[0] <= mu <= _MU[1] and _LOG_SIGMA[0] <= log_sigma <= _LOG_SIGMA[1]):
        raise ValueError(
            f"mu={mu:g}, sigma={sigma:g} lie outside the sliders: choose mu in [-4, 4], sigma in [0.05, 2.71]"
        )
    policy = GreedyActions(mu, sigma)
    actions = ", ".join(f"{name} {action:.3f}" for name, action in policy.actions.items())
    density = plot("action", "density", (-1.1, 1.1), "density", height=220)
    family_curve(density, "logit-normal")
    density.renderers[-1].data_source.name = "density"
    over_mu = plot("location μ", "greedy action", _MU, "over_mu", height=220)
    over_sigma = plot("log σ", "greedy action", _LOG_SIGMA, "over_sigma", height=220)
    for name, look in CENTRES.items():
        curve(density, name, look, source=f"at_{name}")
        curve(over_mu, name, look, source=f"mu_{name}")
        curve(over_sigma, name, look, source=f"sigma_{name}")
    _add_cursor(over_mu, "cursor_mu")
    _add_cursor(over_sigma, "cursor_sigma")
    bounds(density)
    return Explorable(
        name="greedy-action",
        title="three greedy actions of a logit-normal policy, over location μ and scale σ",
        alt=(
            "The density of a logit-normal action on the interval from -1 to 1 with its mean, median and mode, and "
            f"the three as curves over μ and over σ. At μ = {mu:g}, σ = {sigma:g}: {actions}. The mode jumps "
            "where μ changes its sign and σ is large; the other two never do."
        ),
        controls=(
            slider("mu", "location μ", *_MU, mu, 0.1),
            slider("log_sigma", "scale σ (logarithmic)", *_LOG_SIGMA, log_sigma, 0.05, log=True),
        ),
        plots=(density, over_mu, over_sigma),
        columns={name: look.label for name, look in CENTRES.items()},
        rows={
            "action": "greedy action c",
            "absolute": "mean of |a − c|",
            "rms": "root mean square of a − c",
            "slope": "change of c per unit of μ",
        },
        fallback=lambda: _static_figure(policy),
        looks={**CENTRES, "logit-normal": figures.LOOKS["logit-normal"]},
        legend=(
            Mark("line", "logit-normal", "density of the action", of=("density",)),
            BOUNDS,
            Mark("upright dotted", "line", "your μ and your σ", of=("cursor_mu", "cursor_sigma")),
        ),
    )


def _add_cursor(fig: figure, source: str) -> None:
    """Draw a thin vertical line where a slider stands, in the colour of the axes."""
    data = ColumnDataSource({"x": [], "y": []}, name=source)
    fig.line("x", "y", source=data, name="line", line_width=1, line_dash=[2, 2])


def _static_figure(policy: GreedyActions) -> Figure:
    """Draw the static figure of `greedy_actions`."""
    with figures.use_style():
        fig, axes = plt.subplots(1, 3, figsize=(figures.WIDTH, 3.4))
        inside = torch.linspace(-1, 1, 1003, dtype=torch.float64)[1:-1]
        look = figures.family_style("logit-normal") | {"label": None}
        axes[0].plot(inside.numpy(), policy.law.log_prob(inside).exp().numpy(), **look)
        mu = np.linspace(-4, 4, 401)
        sigma = np.exp(np.linspace(-3, 1, 201))
        over_mu = _centres(mu, np.full_like(mu, policy.sigma))
        over_sigma = _centres(np.full_like(sigma, policy.mu), sigma)
        if policy.sigma**2 > 2:
            over_mu["mode"][np.abs(mu) < 1e-9] = np.nan  # the jump is left open
        for name, centre in CENTRES.items():
            style = {"color": centre.color, "linestyle": centre.linestyle}
            axes[0].axvline(policy.actions[name], label=centre.label, **style)
            axes[1].plot(mu, over_mu[name], **style)
            axes[2].plot(sigma, over_sigma[name], **style)
        for bound in (-1.0, 1.0):
            axes[0].axvline(bound, color="#5F6770", linewidth=1, linestyle="-")
        for ax, at in zip(axes[1:], (policy.mu, policy.sigma), strict=True):
            ax.axvline(at, color="#5F6770", linewidth=1, linestyle=":")
        axes[0].set(xlabel="action", title="density", ylim=(0, None))
        axes[1].set(xlabel="μ", ylabel="action", title=f"σ = {policy.sigma:.3g}", ylim=(-1.05, 1.05))
        axes[2].set(
            xlabel="σ", ylabel="action", title=f"μ = {policy.mu:.3g}", ylim=(-1.05, 1.05), xscale="log"
        )
        fig.legend(loc="outside lower center", ncols=3)
    return fig


def _centres(mu: np.ndarray, sigma: np.ndarray) -> dict[str, np.ndarray]:
    """Return the three actions at many parameters, `[N]` each."""
    law = LogitNormal(torch.from_numpy(mu), torch.from_numpy(sigma), low=-1.0, high=1.0)
    return {name: getattr(law, name).numpy() for name in CENTRES}
