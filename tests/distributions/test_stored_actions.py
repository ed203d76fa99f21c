"""What a stored action remembers of its latent, against the package's own inverse; and the price of an epsilon."""

import itertools
import math

import mpmath
import pytest
import torch
from hypothesis import given
from torch.distributions import Normal

from inbounds.distributions import LogitNormal

from .families import few, floats

SPACING = 2.0**-24  # of float32 numbers in [1/2, 1]


def recalled(latent: float) -> tuple[float, float]:
    """Return the float32 action of a latent, and the latent that the package reads off it, in float64."""
    law = LogitNormal(torch.tensor(0.0), torch.tensor(1.0), -1.0, 1.0)
    action = law.latent_to_value(torch.tensor(latent, dtype=torch.float32)).double()
    wide = LogitNormal(torch.zeros((), dtype=torch.float64), 1.0, -1.0, 1.0)
    return float(action), float(wide.value_to_latent(action))


@few
@given(floats(math.log(3), 17.3))
def test_the_error_stays_below_its_bound(latent: float) -> None:
    """Δ/(2y − Δ) + Δ/3, twice over: the float32 sigmoid is not correctly rounded, and the latent itself is."""
    latent = float(torch.tensor(latent, dtype=torch.float32))
    distance = 2 / (1 + math.exp(latent))
    _, again = recalled(latent)
    doubled = 2 * SPACING  # two spacings instead of one: half of it is the library's
    bound = doubled / (2 * distance - doubled) + doubled / 3 if 2 * distance > doubled else math.inf
    assert abs(again - latent) <= bound


def test_the_error_grows_by_e_per_unit_of_latent() -> None:
    largest = []
    for start in (8.0, 10.0, 12.0, 14.0):
        latents = torch.linspace(start, start + 0.2, 400, dtype=torch.float32).tolist()
        largest.append(max(abs(recalled(z)[1] - z) for z in latents))
    for near, far in itertools.pairwise(largest):
        assert far / near == pytest.approx(math.e**2, rel=0.25)


@pytest.mark.parametrize("latent", [18.1, 25.0, 80.0])
def test_beyond_the_last_number_the_latent_is_gone(latent: float) -> None:
    """26 log 2 = 18.02 is the end in float32; the package answers with the last number inside, 25 log 2."""
    action, again = recalled(latent)
    assert action == 1 - SPACING
    assert again == pytest.approx(math.log(2 / SPACING - 1), abs=1e-6)


@few
@given(floats(-3, 3), floats(0.1, 1.5), floats(-9, 9), floats(-8, -2))
def test_the_price_of_an_epsilon(loc: float, scale: float, x: float, log10_eps: float) -> None:
    """log f_ε − log f = −log(1 + ε cosh² x) for a = tanh x: the habit against the package's density."""
    eps = 10.0**log10_eps
    law = LogitNormal(*torch.tensor([2 * loc, 2 * scale], dtype=torch.float64), -1.0, 1.0)
    point = torch.tensor(x, dtype=torch.float64)
    exact = float(law.log_prob_latent(2 * point))
    with mpmath.workdps(40):
        log_slope = float(mpmath.log(1 - mpmath.tanh(mpmath.mpf(x)) ** 2 + mpmath.mpf(eps)))
    normal = float(Normal(*torch.tensor([loc, scale], dtype=torch.float64)).log_prob(point))
    habit = normal - log_slope
    assert habit - exact == pytest.approx(-math.log1p(eps * math.cosh(x) ** 2), abs=1e-9)
