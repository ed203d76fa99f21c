"""The dial's map as a figure and as a table: what was found beside what was forecast (`inbounds.study.dial`)."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from inbounds.book.drawing import figures
from inbounds.study.dial.cells import FRACTIONS
from inbounds.study.dial.outcomes import MARGIN, Endpoint, Finding, predicted_difference, tally

PANELS = (("none", 1), ("none", 8), ("raw", 1), ("raw", 8))
"""Cost and dimension of each panel."""
REGIONS = {"inside, f ≤ 0.5": (0.0, 0.5), "edge, f = 0.9": (0.9, 0.9), "beyond, f ≥ 1.5": (1.5, 9.0)}
_GREY = "#DFE3E8"


def draw_map(findings: Sequence[Finding], endpoint: Endpoint) -> Figure:
    """Draw both bounded laws minus the Gaussian with σ(s): dots with intervals as found, dashes as forecast.

    Args:
        findings: of `DialOutcomes`.
        endpoint: final or area.
    """
    fig, axes = plt.subplots(1, len(PANELS), figsize=(figures.WIDTH, 4.4), sharey=True)
    for ax, (cost, dims) in zip(axes, PANELS, strict=True):
        ax.axhspan(-MARGIN, MARGIN, color=_GREY)
        for shift, law in ((-0.15, "logit-normal"), (0.15, "beta")):
            chosen = [
                f
                for f in findings
                if f.comparison == (law, "gaussian")
                and f.endpoint == endpoint
                and (f.setting.cost, f.setting.dims) == (cost, dims)
            ]
            _draw(ax, law, chosen, shift)
        ax.set_xticks(range(len(FRACTIONS)), [f"{f:g}" for f in FRACTIONS], rotation=90)
        ax.set_xlim(-0.6, len(FRACTIONS) - 0.4)
        ax.set_yscale("symlog", linthresh=0.1, linscale=1.5)
        ax.set_yticks([-2, -0.5, -0.1, 0, 0.1, 0.5], ["−2", "−0.5", "−0.1", "0", "0.1", "0.5"])
        ax.minorticks_off()
        ax.set_title(f"{'raw cost' if cost == 'raw' else 'no cost'}\nd = {dims}")
    axes[0].set_ylabel(f"{endpoint}, minus Gaussian")
    fig.supxlabel("where the best action lies [half-ranges]")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return fig


def _draw(ax: Axes, law: str, chosen: Sequence[Finding], shift: float) -> None:
    x = np.arange(len(chosen)) + shift
    value, low, high = (
        np.array([float(getattr(f.found, name)) for f in chosen]) for name in ("value", "low", "high")
    )
    look = figures.LOOKS[law]
    ax.errorbar(
        x,
        value,
        [value - low, high - value],
        fmt=look.marker,
        markersize=4.5,
        color=look.color,
        label=look.label,
    )
    forecast = [predicted_difference(f.setting, f.comparison, f.endpoint) for f in chosen]
    ax.plot(x, forecast, "_", markersize=11, markeredgewidth=2, color=look.color, alpha=0.6)


def table(findings: Sequence[Finding]) -> str:
    """Return a line per comparison, region and setting: the classes found, and each model's right forecasts."""
    lines = [f"{'':28} above below none unclear      steps   geometry"]
    for pair in dict.fromkeys(f.comparison for f in findings):
        lines.append(_line(" − ".join(pair), [f for f in findings if f.comparison == pair]))
    for name, (least, most) in REGIONS.items():
        lines.append(_line(name, [f for f in findings if least <= f.setting.fraction <= most]))
    for knobs in dict.fromkeys((f.setting.cost, f.setting.dims) for f in findings):
        chosen = [f for f in findings if (f.setting.cost, f.setting.dims) == knobs]
        lines.append(_line(f"cost {knobs[0]}, d = {knobs[1]}", chosen))
    return "\n".join([*lines, _line("all", findings)])


def _line(name: str, chosen: Sequence[Finding]) -> str:
    kinds = [f.kind for f in chosen]
    found = [kinds.count(kind) for kind in ("above", "below", "no difference", "unresolved")]
    scores = []
    for counts in (tally(chosen), tally(chosen, "geometry")):
        scores.append(f"{counts['right']} of {counts['right'] + counts['wrong']}")
    return f"{name:28}{found[0]:6}{found[1]:6}{found[2]:5}{found[3]:8}{scores[0]:>11}{scores[1]:>11}"
