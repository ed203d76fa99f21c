"""Names that the claims share: cells by arm, algorithm and family; presets; how a test is told."""

from __future__ import annotations

from collections.abc import Sequence

from inbounds.study.analysis import Contrast

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
