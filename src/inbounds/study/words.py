"""Numbers of the study in words: estimates with their intervals, p-values, what a comparison shows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from inbounds.study.statistics import Comparison, Estimate
from inbounds.study.statistics.settings import LEVEL


def spoken(estimate: Estimate | None, digits: int | None = None) -> str:
    """Say an estimate with its interval.

    Example:
        >>> spoken(Estimate(np.array(12.34), np.array(9.0), np.array(15.0), 10, 0, 0.95, "mean"))
        '12.3 [9.0, 15.0]'
    """
    if estimate is None:
        return "missing"
    write: Callable[..., str] = number if digits is None else lambda x: _minus(f"{float(x):z.{digits}f}")
    return f"{write(estimate.value)} [{write(estimate.low)}, {write(estimate.high)}]"


def number(value: float | np.ndarray) -> str:
    """Say a return, with a decimal where it is small."""
    return _minus(f"{float(value):z.0f}" if abs(float(value)) >= 100 else f"{float(value):z.1f}")


def percent(share: float, digits: int = 0) -> str:
    """Say a share in per cent, as the book's prose writes it, never broken before its sign.

    Example:
        >>> percent(0.95).split()
        ['95', '%']
    """
    return f"{_minus(f'{100 * share:z.{digits}f}')}\N{NARROW NO-BREAK SPACE}%"


def p_value(p: float) -> str:
    """Say a p-value."""
    return "" if np.isnan(p) else "< 0.001" if p < 0.001 else f"{p:.3f}"


def p_equals(p: float) -> str:
    """Say a p-value in a sentence or beside a bar, where no heading names it.

    Example:
        >>> p_equals(0.02), p_equals(1e-5)
        ('p = 0.020', 'p < 0.001')
    """
    value = p_value(p)
    return f"p {value}" if value.startswith("<") else f"p = {value}" if value else ""


def verdict(comparison: Comparison, level: float = 1 - LEVEL) -> str:
    """Say in a word what a comparison shows.

    Example:
        >>> verdict(Comparison(None, float("nan"), float("nan")))
        ''
    """
    gap = comparison.difference
    if gap is None:
        return ""
    if gap.low <= 0 <= gap.high:
        return "unresolved"
    if comparison.p_adjusted < level:
        return "higher" if gap.value > 0 else "lower"
    return "not after Holm"


def _minus(digits: str) -> str:
    return digits.replace("-", "−")
