"""Numbers of the study in words: estimates with their intervals, p-values, what a comparison shows.

`verdict` is the table's word for a comparison after Holm; a page's words for any interval are in
`inbounds.book.verdicts`. Both ask `side`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from inbounds.study.statistics import Comparison, Estimate
from inbounds.study.statistics.settings import SIGNIFICANCE


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
    """Say a return, with a decimal where it is small.

    Example:
        >>> number(99.94), number(99.96)
        ('99.9', '100')
    """
    exact = float(value)
    return _minus(f"{exact:z.0f}" if abs(round(exact, 1)) >= 100 else f"{exact:z.1f}")


def percent(share: float, digits: int = 0) -> str:
    """Say a share in per cent, as the book's prose writes it, never broken before its sign.

    Example:
        >>> percent(0.95).split()
        ['95', '%']
    """
    return f"{_minus(f'{100 * share:z.{digits}f}')}\N{NARROW NO-BREAK SPACE}%"


def p_value(p: float) -> str:
    """Say a p-value, so that one below the level of significance can be told from one above.

    Example:
        >>> p_value(0.0497), p_value(0.0502), p_value(0.0002)
        ('< 0.050', '0.050', '< 0.001')
    """
    if np.isnan(p):
        return ""
    if p < 0.001:
        return "< 0.001"
    return f"< {SIGNIFICANCE:.3f}" if p < SIGNIFICANCE <= round(p, 3) else f"{p:.3f}"


def p_equals(p: float) -> str:
    """Say a p-value in a sentence or beside a bar, where no heading names it.

    Example:
        >>> p_equals(0.02), p_equals(1e-5)
        ('p = 0.020', 'p < 0.001')
    """
    value = p_value(p)
    return f"p {value}" if value.startswith("<") else f"p = {value}" if value else ""


def side(low: float | np.ndarray, high: float | np.ndarray, against: float = 0.0) -> int:
    """Say on which side of a number an interval lies: 1 above, −1 below, 0 if it holds the number.

    Example:
        >>> side(0.1, 0.3), side(-3, -1), side(0.0, 2.0)
        (1, -1, 0)
    """
    return int(float(low) > against) - int(float(high) < against)


def verdict(comparison: Comparison, level: float = SIGNIFICANCE) -> str:
    """Say in a word what a comparison shows.

    Example:
        >>> verdict(Comparison(None, float("nan"), float("nan")))
        ''
    """
    gap = comparison.difference
    if gap is None:
        return ""
    found = side(gap.low, gap.high)
    if not found:
        return "unresolved"
    if comparison.p_adjusted < level:
        return "higher" if found > 0 else "lower"
    return "not after Holm"


def _minus(digits: str) -> str:
    return digits.replace("-", "−")
