"""What a number with an interval shows, in the words that every page uses: above, below, or no difference found.

An interval that holds zero does not show that there is nothing, so the words say which effects it leaves possible.
The side comes from `inbounds.study.words.side`, which the study's report uses too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from inbounds.study.statistics import Estimate
from inbounds.study.words import number, side, spoken

Interval = Estimate | tuple[float, float, float]
"""An estimate, or its lower end, its value and its upper end."""


def verdict(
    of: Interval,
    against: float = 0.0,
    *,
    above: str = "above",
    below: str = "below",
    digits: int | None = None,
    unit: str = "",
) -> str:
    """Say on which side of a number an interval lies.

    Args:
        of: a difference with its interval, or any number with one.
        against: what it is compared with.
        above: the words if the whole interval lies above.
        below: the words if the whole interval lies below.
        digits: decimals of the numbers in the answer; by default as returns are written.
        unit: behind the numbers, with its space: `" points"`.

    Raises:
        ValueError: the ends are not in order, or not finite.

    Example:
        >>> verdict((9.0, 12.3, 15.0)), verdict((-77.0, -9.0, 59.0), unit=" points")
        ('above', 'no difference found (effects between −77.0 and 59.0 points remain possible)')
    """
    low, _, high = ends(of)
    found = side(low, high, against)
    if found:
        return above if found > 0 else below
    first, second = (_write(end - against, digits) for end in (low, high))
    return f"no difference found (effects between {first} and {second}{unit} remain possible)"


def told(of: Interval, against: float = 0.0, *, digits: int | None = None, unit: str = "") -> str:
    """Say a number with its interval, then its verdict.

    Example:
        >>> told((9.0, 12.3, 15.0), digits=0, unit=" points")
        '12 points [9, 15], above'
    """
    low, value, high = ends(of)
    shown = f"{_write(value, digits)}{unit} [{_write(low, digits)}, {_write(high, digits)}]"
    found = side(low, high, against)
    return f"{shown}, {'above' if found > 0 else 'below' if found < 0 else 'no difference found'}"


def tally(
    all_of: Iterable[Interval], against: float = 0.0, *, above: str = "above", below: str = "below"
) -> str:
    """Say how many of several intervals lie where.

    Example:
        >>> tally([(1.0, 2.0, 3.0), (-1.0, 0.0, 1.0), (-4.0, -3.0, -2.0), (1.0, 1.0, 1.0)])
        'above in 2 of 4, below in 1, no difference found in 1'
    """
    counts = Counter(side(low, high, against) for low, _, high in map(ends, all_of))
    return f"{above} in {counts[1]} of {counts.total()}, {below} in {counts[-1]}, no difference found in {counts[0]}"


def ends(of: Interval) -> tuple[float, float, float]:
    """Return lower end, value and upper end of an interval.

    Raises:
        ValueError: the ends are not in order, or not finite.

    Example:
        >>> ends((1, 2, 3))
        (1.0, 2.0, 3.0)
    """
    found = (of.low, of.value, of.high) if isinstance(of, Estimate) else of
    low, value, high = map(float, found)
    if not (float("-inf") < low <= high < float("inf")):
        raise ValueError(f"an interval from {low} to {high}: give lower end, value, upper end, all finite")
    return low, value, high


def _write(x: float, digits: int | None) -> str:
    return number(x) if digits is None else f"{x:z.{digits}f}".replace("-", "−")


__all__ = ["Interval", "ends", "spoken", "tally", "told", "verdict"]
