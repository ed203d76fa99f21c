"""What the study's pages call things: arms, endpoints, pairs of families, and a figure's values in words."""

from __future__ import annotations

from collections.abc import Mapping

from inbounds.book.drawing.figures import LOOKS
from inbounds.book.report.study_figures import SHORT
from inbounds.study.analysis import Contrast
from inbounds.study.statistics import Estimate
from inbounds.study.words import number

ALGORITHMS = ("ppo", "trpo")
ARM_NAMES: Mapping[str, str] = {
    "standard": "standard practice",
    "printed": "as printed",
    "beyond": "beyond the thesis",
    "mechanisms": "mechanisms",
}
"""Arm → its name within a sentence, in the protocol's order."""
ARM_TITLES: Mapping[str, str] = {
    arm: f"Arm {place}: {name}" for place, (arm, name) in enumerate(ARM_NAMES.items(), 1)
}
"""Arm → its heading."""
HEADS: Mapping[str, str] = {"final": "final return", "area": "area", "greedy": "greedy return"}
"""Endpoint → title of its column."""


def title_of(arm: str, algorithm: str) -> str:
    """Return the name of an algorithm's part of an arm.

    Example:
        >>> title_of("printed", "ppo")
        'PPO, as printed'
    """
    return f"{algorithm.upper()}, {ARM_NAMES[arm]}"


def pair_name(contrast: Contrast) -> str:
    """Return what is compared, as a difference."""
    return f"{SHORT[contrast.first]} − {SHORT[contrast.second]}"


def in_words(panels: Mapping[str, Mapping[str, Estimate | None]]) -> str:
    """Return the values of estimates by panel and family, for those who cannot see the figure."""
    return ". ".join(
        f"{panel}: "
        + ", ".join(f"{LOOKS[f].label} {number(e.value) if e else 'missing'}" for f, e in row.items())
        for panel, row in panels.items()
    )
