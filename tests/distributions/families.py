"""The three laws as the tests meet them: how to draw parameters, what to compare with, what to differentiate."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import scipy.stats
import torch
from hypothesis import settings
from hypothesis import strategies as st
from torch import Tensor

from inbounds.distributions import BoundedDistribution, ClippedNormal, LogitNormal, ScaledBeta

few = settings(max_examples=25, deadline=None, derandomize=True)


def floats(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, width=64)


def relatively(value: float, rel: float) -> Any:
    """Compare by relative error alone: approx by itself also accepts whatever is within 1e-12."""
    return pytest.approx(value, rel=rel, abs=0.0)


@st.composite
def intervals(draw: Any) -> tuple[float, float]:
    """Asymmetric bounds (low, high) of ordinary robots, and some less ordinary."""
    low = draw(floats(-5.0, 5.0))
    return low, low + draw(floats(0.1, 8.0))


def double(*values: Any) -> tuple[Tensor, ...]:
    return tuple(torch.as_tensor(value, dtype=torch.float64) for value in values)


@dataclass(frozen=True)
class Family:
    """One law: its class, the ranges of its two parameters (second positive), and SciPy's word on its cdf."""

    law: type[BoundedDistribution]
    names: tuple[str, str]
    first: tuple[float, float]
    second: tuple[float, float]
    cdf: Callable[..., Any]

    def parameters(self, shape: tuple[int, ...] = (), seed: int = 0) -> tuple[Tensor, Tensor]:
        generator = torch.Generator().manual_seed(seed)
        first, second = torch.rand(2, *shape, generator=generator, dtype=torch.float64)
        return tuple(lo + (hi - lo) * u for (lo, hi), u in ((self.first, first), (self.second, second)))

    def make(self, shape: tuple[int, ...] = (), low: Any = -1.0, high: Any = 2.0, seed: int = 0) -> Any:
        return self.law(*self.parameters(shape, seed), low, high)


def _clipped_cdf(value: Any, loc: float, scale: float, low: float, high: float) -> Any:
    inner = scipy.stats.norm.cdf(value, loc, scale)
    return np.where(value < low, 0.0, np.where(value >= high, 1.0, inner))


FAMILIES = {
    "logit-normal": Family(
        LogitNormal,
        ("loc", "scale"),
        (-3.0, 3.0),
        (0.2, 2.5),
        lambda v, m, s, lo, hi: scipy.stats.johnsonsb.cdf(v, -m / s, 1 / s, lo, hi - lo),
    ),
    "beta": Family(
        ScaledBeta,
        ("concentration1", "concentration0"),
        (0.6, 8.0),
        (0.6, 8.0),
        lambda v, a, b, lo, hi: scipy.stats.beta.cdf(v, a, b, lo, hi - lo),
    ),
    "clipped-normal": Family(ClippedNormal, ("loc", "scale"), (-2.0, 3.0), (0.2, 2.0), _clipped_cdf),
}
