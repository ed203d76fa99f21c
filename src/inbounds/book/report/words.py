"""What the study's report calls things: pairs of families, and the values of a figure for those who cannot see it."""

from __future__ import annotations

from collections.abc import Mapping

from inbounds.book.drawing.figures import LOOKS
from inbounds.book.report.study_figures import SHORT
from inbounds.study.analysis import Contrast
from inbounds.study.statistics import Estimate
from inbounds.study.words import number, p_equals, p_value, spoken, verdict

__all__ = ["in_words", "number", "p_equals", "p_value", "pair_name", "spoken", "verdict"]


def pair_name(contrast: Contrast) -> str:
    """Say what is compared."""
    return f"{SHORT[contrast.first]} − {SHORT[contrast.second]}"


def in_words(panels: Mapping[str, Mapping[str, Estimate | None]]) -> str:
    """Say the values of estimates by panel and family, for those who cannot see the figure."""
    return ". ".join(
        f"{panel}: "
        + ", ".join(f"{LOOKS[f].label} {number(e.value) if e else 'missing'}" for f, e in row.items())
        for panel, row in panels.items()
    )
