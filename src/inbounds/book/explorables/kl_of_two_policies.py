"""An explorable: the divergence between two policies, as their latents have it and as their actions do.

::

    from inbounds.book.explorables.kl_of_two_policies import kl_of_two_policies

    kl_of_two_policies()

The mathematics runs in the reader's browser (`explorables/kl_of_two_policies.js`) and is tested against this
package.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import matplotlib.pyplot as plt
import numpy as np
import torch
from bokeh.models import ColumnDataSource
from matplotlib.figure import Figure
from torch.distributions import Distribution, kl_divergence

from inbounds.book.drawing import figures
from inbounds.book.explorables.frame import BOUNDS, Explorable, bounds, curve, plot, slider
from inbounds.book.explorables.legend import Mark
from inbounds.distributions import ClippedNormal
from inbounds.learning.families import FAMILIES, NormalParameters

__all__ = ["MAPS", "TwoPolicies", "kl_of_two_policies"]

Pair: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class Map:
    """What a policy family's map does to the latent, and what its picture therefore needs."""

    does: str
    """In words."""
    bounded: bool = True
    """Whether the action lies in [-1, 1]."""
    atoms: bool = False
    """Whether the bounds carry mass."""


MAPS = {
    "gaussian": Map("as drawn", bounded=False),
    "logit-normal": Map("squashed"),
    "clipped-gaussian": Map("clipped", atoms=True),
}
"""By policy family, in the order of the pictures. The laws themselves come from the families' own files."""

_LOC, _LOG_SCALE = (-3.0, 3.0), (-2.0, 1.0)


@dataclass(frozen=True)
class TwoPolicies:
    """An old policy N(μ, σ²) and a new one, as laws of the latent, under the maps of `MAPS`.

    As drawn, the action is the latent z itself; squashed it is tanh(z/2), a logit-normal on [-1, 1]; clipped it is
    min(max(z, -1), 1).

    Its `kl` has an example.
    """

    old: Pair
    """μ and σ of the old policy's latent."""
    new: Pair
    """μ and σ of the new policy's latent."""

    def laws(self, family: str) -> tuple[Distribution, Distribution]:
        """Return the laws of the action under a family's map, old and new, float64."""
        return _law(family, *self.old), _law(family, *self.new)

    def kl(self, family: str) -> Pair:
        """Return KL(old‖new) and KL(new‖old) of the action, in nats, exact.

        Example:
            >>> from inbounds.book.explorables.kl_of_two_policies import MAPS
            >>> policies = TwoPolicies(old=(0.0, 1.0), new=(1.0, 1.0))
            >>> [round(policies.kl(family)[0], 3) for family in MAPS]
            [0.5, 0.5, 0.467]
        """
        old, new = self.laws(family)
        return float(kl_divergence(old, new)), float(kl_divergence(new, old))


def _law(family: str, mu: float, sigma: float) -> Distribution:
    loc, scale = torch.tensor([mu, sigma], dtype=torch.float64)
    low, high = torch.tensor([-1.0, 1.0], dtype=torch.float64)
    return FAMILIES[family].distribution(NormalParameters(loc, scale.log()), low, high)


def kl_of_two_policies(old: Pair = (0.0, 1.0), new: Pair = (0.8, 0.7)) -> Explorable:
    """Two policies, three pictures: as drawn, squashed into [-1, 1], clipped to it; with divergence, entropy and mean.

    Args:
        old: Initial μ in [-3, 3] and σ in [0.14, 2.71] of the old policy.
        new: The same of the new one.

    Returns:
        An explorable with four sliders, three pictures, and a table of what the maps change and what they do not.

    Raises:
        ValueError: If a parameter lies outside its slider.

    Example:
        >>> kl_of_two_policies(new=(1.0, 0.5)).name
        'kl-of-two-policies'
    """
    for role, (mu, sigma) in (("old", old), ("new", new)):
        log_sigma = float(np.log(sigma)) if sigma > 0 else -np.inf
        if not (_LOC[0] <= mu <= _LOC[1] and _LOG_SCALE[0] <= log_sigma <= _LOG_SCALE[1]):
            raise ValueError(
                f"{role}: mu={mu:g}, sigma={sigma:g} lie outside the sliders: "
                "choose mu in [-3, 3], sigma in [0.14, 2.71]"
            )
    policies = TwoPolicies(old, new)
    divergences = [
        f"{policies.kl(family)[0]:.3f}{'' if shown.bounded else ' nats'} {shown.does}"
        for family, shown in MAPS.items()
    ]
    return Explorable(
        name="kl-of-two-policies",
        title="two policies under three maps, over the location and scale of each",
        alt=(
            "An old and a new policy, as drawn, squashed into the interval from -1 to 1, and clipped to it. At the old "
            f"μ = {old[0]:g}, σ = {old[1]:g} and the new μ = {new[0]:g}, σ = {new[1]:g} the divergence old to new is "
            f"{', '.join(divergences[:-1])} and {divergences[-1]}."
        ),
        controls=tuple(
            control
            for role, (mu, sigma) in (("old", old), ("new", new))
            for control in (
                slider(f"mu_{role}", f"{role} location μ", *_LOC, mu, 0.1),
                slider(
                    f"log_sigma_{role}", f"{role} scale σ", *_LOG_SCALE, float(np.log(sigma)), 0.05, log=True
                ),
            )
        ),
        plots=tuple(_picture(family) for family in MAPS),
        columns={family: shown.does for family, shown in MAPS.items()},
        rows={
            "kl": "KL(old‖new) [nats]",
            "reverse": "KL(new‖old) [nats]",
            "variation": "total variation",
            "entropy_old": "entropy, old [nats]",
            "entropy_new": "entropy, new [nats]",
            "mean_old": "mean, old",
            "mean_new": "mean, new",
        },
        fallback=lambda: _static_figure(policies),
        legend=(
            Mark("wide", "ink", "old policy: thick and pale", of=tuple(f"{family}-old" for family in MAPS)),
            Mark("line", "ink", "new policy: thin", of=tuple(f"{family}-new" for family in MAPS)),
            BOUNDS,
            Mark(
                "bars",
                "clipped-gaussian",
                "probability of the bound that they stand beside",
                of=("atoms-old", "atoms-new"),
            ),
        ),
    )


def _picture(family: str) -> Any:
    """Return one empty picture; old curves are thick and pale, new ones thin."""
    shown = MAPS[family]
    fig = plot(
        f"action, {shown.does}" if shown.bounded else "latent z",
        "density, mass" if shown.atoms else "density",
        (-1.35, 1.35) if shown.bounded else (-9.0, 9.0),
        f"y-{family}",
        height=210,
    )
    for role, width, alpha in (("old", 6, 0.4), ("new", 2.5, 1.0)):
        curve(fig, family, figures.LOOKS[family], source=f"{family}-{role}")
        fig.renderers[-1].glyph.update(line_width=width, line_alpha=alpha)
        if shown.atoms:
            atoms = ColumnDataSource({"x": [], "mass": []}, name=f"atoms-{role}")
            fig.vbar(
                "x", top="mass", width=0.1, source=atoms, name=family, fill_alpha=0.55 * alpha, line_alpha=alpha,
                line_width=2,
            )  # fmt: skip
    if shown.bounded:
        bounds(fig)
    return fig


def _static_figure(policies: TwoPolicies) -> Figure:
    """Return the static figure of `kl_of_two_policies`."""
    with figures.use_style():
        fig, axes = plt.subplots(1, 3, figsize=(figures.WIDTH, 3.2))
        for ax, (family, shown) in zip(axes, MAPS.items(), strict=True):
            end = 0.9999 if shown.bounded else 9.0
            grid = torch.linspace(-end, end, 2001, dtype=torch.float64)
            style = figures.family_style(family) | {"label": None}
            laws = policies.laws(family)
            for law, width, alpha in zip(laws, (5.0, 2.0), (0.4, 1.0), strict=True):
                ax.plot(grid.numpy(), law.log_prob(grid).exp().numpy(), linewidth=width, alpha=alpha, **style)
                if isinstance(law, ClippedNormal):
                    place = 1.1 if width > 3 else 1.22
                    masses = [float(law.mass_low), float(law.mass_high)]
                    ax.bar([-place, place], masses, width=0.1, color=style["color"], alpha=0.6 * alpha)
            for bound in (-1.0, 1.0) if shown.bounded else ():
                ax.axvline(bound, color="#5F6770", linewidth=1, linestyle="-")
            ax.set(
                title=f"{shown.does}: {policies.kl(family)[0]:.3f} nats", xlabel="action", ylim=(0.0, None)
            )
        axes[0].set(xlabel="latent z", ylabel="density", xlim=(-5, 5))
    return fig
