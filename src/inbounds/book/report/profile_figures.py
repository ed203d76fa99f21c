"""Performance profiles: which share of the runs scores more than τ, a line per policy family."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from inbounds.book.drawing.figures import LOOKS, WIDTH, family_style, use_style
from inbounds.book.report.study_panels import NARROW, families_in, family_legend, list_gaps, note, note_of
from inbounds.study.statistics import Profile

__all__ = ["performance_profiles", "profile_note"]


def performance_profiles(
    profiles: Mapping[str, Profile | None],
    *,
    xlabel: str = "normalised score τ",
    narrow: bool = False,
    noted: bool = True,
) -> Figure:
    """Draw performance profiles with bands: the share of runs that score more than τ, a line per policy family.

    Args:
        profiles: per family its profile, or None where it is missing.
        xlabel: what τ is, and how it is normalised.
        narrow: for a phone.
        noted: with `profile_note` below the panel.

    Returns:
        The figure.

    Raises:
        ValueError: nothing to draw, or an unknown family.

    Example:
        >>> import numpy as np
        >>> from inbounds.study.statistics import performance_profile
        >>> taus, rng = np.linspace(0, 1, 5), np.random.default_rng(0)
        >>> fig = performance_profiles({"beta": performance_profile({"Ant-v5": rng.random(10)}, taus, rng)})
        >>> fig.axes[0].get_xlabel()
        'normalised score τ'
    """
    families = families_in([profiles])
    with use_style():
        fig, ax = plt.subplots(figsize=(NARROW if narrow else WIDTH, 4.6))
        for family, profile in profiles.items():
            if profile is not None:
                style = family_style(family)
                tau, share = profile.thresholds, profile.share
                ax.fill_between(tau, share.low, share.high, color=style["color"], alpha=0.18, linewidth=0)
                every = max(1, len(tau) // 5)
                first = list(LOOKS).index(family) * every // len(LOOKS)
                ax.plot(
                    tau,
                    share.value,
                    marker=LOOKS[family].marker,
                    markevery=(first, every),
                    linewidth=1.8,
                    **style,
                )
        list_gaps(ax, {family: p.share if p else None for family, p in profiles.items()}, at_left=False)
        ax.set(xlabel=xlabel, ylabel="share of runs above τ", ylim=(-0.02, 1.02))
        ax.yaxis.set_major_formatter(PercentFormatter(xmax=1.0, decimals=0))
        family_legend(fig, families, narrow=narrow)
        if noted:
            note(fig, profile_note(profiles), narrow=narrow)
    return fig


def profile_note(profiles: Mapping[str, Profile | None]) -> str:
    """Say what line and band of performance profiles are, and of how many seeds."""
    return note_of("Line", "Band", [p.share for p in profiles.values() if p], ", at each τ by itself")
