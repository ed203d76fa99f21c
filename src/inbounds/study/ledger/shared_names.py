"""Names that the claims share: cells by arm, algorithm and family; presets; how a test is told."""

from __future__ import annotations

from collections.abc import Sequence

from inbounds.study.analysis import Contrast
from inbounds.study.outcomes import Column

PRESETS = {"printed": "as printed", "standard": "standard practice"}
"""Arm → what its preset is called."""
TEST = "permutation test, Holm over six robots"
NOISY = ("HalfCheetah", "Hopper", "Swimmer", "Walker2d")
"""Robots on which the initial noise has been matched."""


def cells(arm: str, algorithm: str, *families: str, robots: Sequence[str] = ("*",)) -> tuple[str, ...]:
    """Return patterns of cells, as `inbounds.study.select` reads them.

    Example:
        >>> cells("printed", "ppo", "beta", robots=("Ant", "Hopper"))
        ('printed-ant-ppo-beta', 'printed-hopper-ppo-beta')
    """
    return tuple(f"{arm}-{robot.lower()}-{algorithm}-{family}" for family in families for robot in robots)


def squash(algorithm: str, arm: str) -> Contrast:
    """Return the difference that the thesis is about: logit-normal − Gaussian."""
    return Contrast(arm, algorithm, "logit-normal", "gaussian")


AS_THEY_START = Column("standard", "ppo", "logit-normal"), Column("standard", "ppo", "gaussian")
EQUALLY_LOUD = (
    Column("mechanisms", "ppo", "logit-normal", "matched-noise"),
    Column("mechanisms", "ppo", "gaussian", "matched-noise"),
)
"""The gap between logit-normal and Gaussian: first minus second, with their own and with equal noise at the start."""
LOUDNESS_CELLS = (
    *cells("standard", "ppo", "gaussian", "logit-normal", robots=NOISY),
    *cells("mechanisms", "ppo", "gaussian-matched-noise", "logit-normal-matched-noise"),
)
"""What a claim on these two gaps needs."""
