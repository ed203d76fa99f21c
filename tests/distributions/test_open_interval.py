"""What a logit-normal pays for never reaching a bound."""

import math

import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from inbounds.distributions import LogitNormal

LOCS, SCALES = st.floats(-12, 3), st.floats(0.05, 2)
BOUNDS = st.tuples(st.floats(-5, 5), st.floats(0.1, 20))


@settings(deadline=None, max_examples=60)
@given(loc=LOCS, scale=SCALES, bounds=BOUNDS, upper=st.booleans())
def test_what_an_open_interval_costs(loc: float, scale: float, bounds: tuple, upper: bool) -> None:
    """The mean distance to a bound, and its slope in loc, are below width · exp(μ + σ²/2)."""
    low, width = bounds
    mu = torch.tensor(-loc if upper else loc, dtype=torch.float64, requires_grad=True)
    law = LogitNormal(mu, scale, 0.0, width)  # from zero on: the distance is the value, without cancellation
    distance = width - law.mean if upper else law.mean
    (slope,) = torch.autograd.grad(distance, mu)
    limit = width * math.exp(loc + scale**2 / 2)
    assert 0 < distance < limit * (1 + 1e-9) + 1e-9 * width
    assert 0 < abs(slope) < limit * (1 + 1e-9)
    assert (slope < 0) == upper
    shifted = LogitNormal(mu, scale, low, low + width)
    assert torch.allclose(shifted.mean - low, law.mean, atol=1e-9)


@settings(deadline=None, max_examples=40)
@given(
    scale=SCALES,
    epsilon=st.floats(1e-4, 0.5),
    delta=st.floats(0.01, 0.99),
    width=st.floats(0.1, 20),
)
def test_where_it_must_be_to_stay_near(scale: float, epsilon: float, delta: float, width: float) -> None:
    """P(a − low ≤ ε width) ≥ 1 − δ exactly up to μ = logit ε − σ Φ⁻¹(1 − δ)."""
    edge = math.log(epsilon / (1 - epsilon)) - scale * stats.norm.ppf(1 - delta)
    for loc, enough in ((edge - 0.01, True), (edge + 0.01, False)):
        law = LogitNormal(torch.tensor(loc, dtype=torch.float64), scale, 0.0, width)
        near = law.cdf(torch.tensor(epsilon * width, dtype=torch.float64)).item()
        assert (near >= 1 - delta) == enough
