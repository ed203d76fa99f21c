"""A mean is within the bounds, to the last bit, wherever the law has gone."""

import itertools

import pytest
import torch
from scipy import stats

from inbounds.distributions import ClippedNormal, LogitNormal, ScaledBeta

BOXES = [(0.0, 1.0), (-1.0, 1.0), (-2.0, 0.4), (0.1, 0.3)]


@pytest.mark.parametrize("law", [LogitNormal, ClippedNormal])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_mean_stays_within_the_bounds(law: type, dtype: torch.dtype) -> None:
    grid = itertools.product(
        [0.0, *(s * x for s in (-1, 1) for x in (15, 20, 38, 100, 1e4, 1e30))], [0.1, 1, 10], BOXES
    )
    for loc, scale, (low, high) in grid:
        made = law(*(torch.tensor(x, dtype=dtype) for x in (loc, scale, low, high)))
        assert made.low <= made.mean <= made.high, (loc, scale, low, high)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_the_mean_of_a_beta_stays_within_the_bounds(dtype: torch.dtype) -> None:
    for a, b, (low, high) in itertools.product([1e-3, 1, 1e9], [1e-3, 1, 1e9], BOXES):
        made = ScaledBeta(*(torch.tensor(x, dtype=dtype) for x in (a, b, low, high)))
        assert made.low <= made.mean <= made.high, (a, b, low, high)


@pytest.mark.parametrize("loc", [1e10, 1e20, 1e30])
def test_a_location_far_beyond_the_box_is_on_its_bound(loc: float) -> None:
    assert ClippedNormal(loc, 1.0).mean == 1
    assert ClippedNormal(-loc, 1.0).mean == -1


@pytest.mark.parametrize("scale", [1e8, 1e20, 1e30])
def test_a_normal_too_wide_for_its_box_shares_it_between_the_bounds(scale: float) -> None:
    for ratio in (-1.0, 0.0, 0.3):
        made = ClippedNormal(
            torch.tensor(ratio * scale, dtype=torch.float64), torch.tensor(scale, dtype=torch.float64)
        )
        assert made.mean.item() == pytest.approx(2 * stats.norm.cdf(ratio) - 1, abs=1e-7)
