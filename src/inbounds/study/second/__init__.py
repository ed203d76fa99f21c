"""The second study: equal start, a practitioner's Gaussian, fresh seeds. `results/PROTOCOL-2.md` fixed it beforehand.

outcomes = Outcomes.read(StudyFolder(), second_cells())
rows = primary(outcomes)
"""

from inbounds.study.second.over_robots import aggregate, improvement
from inbounds.study.second.primary import GAUSSIAN, PrimaryRow, pooled_difference, primary
from inbounds.study.second.secondary import (
    PAIRS,
    Pair,
    SecondaryRow,
    compared,
    engines_agree,
    secondary,
    starts,
)
from inbounds.study.second.yardsticks import BEST, DO_NOTHING, MARGINS, normalized

__all__ = [
    "BEST",
    "DO_NOTHING",
    "GAUSSIAN",
    "MARGINS",
    "PAIRS",
    "Pair",
    "PrimaryRow",
    "SecondaryRow",
    "aggregate",
    "compared",
    "engines_agree",
    "improvement",
    "normalized",
    "pooled_difference",
    "primary",
    "secondary",
    "starts",
]
