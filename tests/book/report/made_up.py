"""Differences that no study has found."""

import numpy as np

from inbounds.study.statistics import Estimate


def gap(low: float, high: float) -> Estimate:
    """A difference in the middle of its interval, of ten seeds."""
    middle = np.array((low + high) / 2)
    return Estimate(middle, np.array(low), np.array(high), 10, 0, 0.95, "difference of means")
