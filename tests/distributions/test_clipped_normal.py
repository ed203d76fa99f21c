"""The clipped Normal: a mixed law, against quadrature, SciPy and its own samples; and CAPG's promise."""

import math

import mpmath
import numpy as np
import pytest
import scipy.integrate
import scipy.stats
import torch
from hypothesis import given
from torch import Tensor
from torch.distributions import Normal, kl_divergence

from inbounds.distributions import ClippedNormal, gaussian_kl_upper_bound

from .families import double, few, floats, intervals, relatively

locs, log_scales = floats(-6, 8), floats(-3, 2)


def law(loc: float, log_scale: float, low: float = -1.0, high: float = 1.0) -> ClippedNormal:
    return ClippedNormal(*double(loc, math.exp(log_scale)), low, high)


def expect(p: ClippedNormal, function) -> float:
    """E[function(a)] by the definition of the mixed law: two masses and an integral (SciPy's)."""
    loc, scale, low, high = (float(x) for x in (p.loc, p.scale, p.low, p.high))
    normal = scipy.stats.norm(loc, scale)
    on_bounds = normal.cdf(low) * function(low) + normal.sf(high) * function(high)
    start, stop = (min(max(x, low), high) for x in (loc - 12 * scale, loc + 12 * scale))
    if stop <= start:
        return on_bounds
    between = scipy.integrate.quad(
        lambda a: normal.pdf(a) * function(a), start, stop, epsabs=1e-13, epsrel=1e-11, limit=200
    )
    return on_bounds + between[0]


def log_prob_at(p: ClippedNormal):
    return lambda a: float(p.log_prob(torch.tensor(a, dtype=torch.float64)))


@few
@given(locs, log_scales, intervals())
def test_masses_and_density_add_up_to_one(loc: float, log_scale: float, bounds: tuple[float, float]) -> None:
    """The base measure is δ_low + da + δ_high: exp(log_prob) integrates to one against it."""
    p = law(loc, log_scale, *bounds)
    low, high = bounds
    scale = math.exp(log_scale)
    start, stop = (min(max(x, low), high) for x in (loc - 12 * scale, loc + 12 * scale))
    between = 0.0
    if stop > start:
        edges = torch.linspace(start, stop, 4001, dtype=torch.float64)[1:-1]
        density = p.log_prob(edges).exp()
        step = (stop - start) / 4000
        between = float(density.sum() * step + step * (density[0] + density[-1]) / 2)
    on_bounds = p.log_prob(torch.stack([p.low, p.high])).exp()
    torch.testing.assert_close(on_bounds, torch.stack([p.mass_low, p.mass_high]))
    assert float(on_bounds.sum()) + between == pytest.approx(1.0, abs=1e-3)


@few
@given(locs, log_scales, intervals(), floats(0.0, 1.0))
def test_log_prob_is_scipys(
    loc: float, log_scale: float, bounds: tuple[float, float], fraction: float
) -> None:
    low, high = bounds
    p, normal = law(loc, log_scale, low, high), scipy.stats.norm(loc, math.exp(log_scale))
    inside = low + (0.001 + 0.998 * fraction) * (high - low)
    expected = [normal.logcdf(low), normal.logpdf(inside), normal.logsf(high)]
    np.testing.assert_allclose(p.log_prob(*double([low, inside, high])), expected, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("loc", [-40.0, 40.0])
@pytest.mark.parametrize("log_scale", [-10.0, 0.0, 1.0])
def test_finite_far_outside(dtype: torch.dtype, loc: float, log_scale: float) -> None:
    """At μ = ±40 log-probability and score of either bound are finite: the least probable one has log Φ(−1e6)."""
    mu = torch.tensor(loc, dtype=dtype, requires_grad=True)
    sigma = torch.tensor(math.exp(log_scale), dtype=dtype, requires_grad=True)
    p = ClippedNormal(mu, sigma, -1.0, 1.0)
    for value in (-1.0, 1.0):
        log_prob = p.log_prob(torch.tensor(value, dtype=dtype))
        gradients = torch.autograd.grad(log_prob, (mu, sigma))
        assert all(bool(x.isfinite()) for x in (log_prob, *gradients))
    if log_scale == 0.0:
        least = p.log_prob(torch.tensor(-math.copysign(1.0, loc), dtype=dtype))
        assert least.item() == relatively(float(mpmath.log(mpmath.ncdf(-41))), rel=1e-6)


def test_the_tails_of_the_masses() -> None:
    """torch's own Φ is 0 below −8.3; the masses, and their share of the mean's gradient, are not."""
    p = ClippedNormal(*double(-11.0, 1.0), -1.0, 1.0)
    assert float(p.mass_high) == relatively(scipy.stats.norm.sf(12.0), rel=1e-12)
    assert float(p.cdf(*double(-1.0))) == pytest.approx(1.0)


@pytest.mark.parametrize("log_scale", [3.0, 12.0, 16.0, 18.4, 20.7, 23.0, 60.0])
def test_the_variance_of_a_wide_normal_is_that_of_its_two_bounds(log_scale: float) -> None:
    """The mass inside is φ(0)·2/σ at most, and what it takes away from ((high − low)/2)² less than that."""
    p = law(0.3, log_scale)
    inside = 2 / math.sqrt(2 * math.pi) / float(p.scale)
    assert 1 - 1.01 * inside <= float(p.variance) <= 1
    assert float(p.stddev) <= 1


def test_a_variance_that_underflows_is_not_negative() -> None:
    """The mean, measured from the median, rounds to beyond the bound."""
    p = ClippedNormal(*double(33239.0133117, 103.72177499225704, -6849.676638220001, 29250.404897409775))
    assert float(p.variance) >= 0


@few
@given(locs, log_scales, intervals())
def test_mean_and_variance_against_quadrature(
    loc: float, log_scale: float, bounds: tuple[float, float]
) -> None:
    p = law(loc, log_scale, *bounds)
    mean = expect(p, lambda a: a)
    assert float(p.mean) == pytest.approx(mean, rel=1e-8, abs=1e-8)
    assert float(p.variance) == pytest.approx(expect(p, lambda a: (a - mean) ** 2), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(
    ("loc", "log_scale"),
    [
        (-4.0, -0.7),
        (0.3, -10.0),
        (0.999, -10.0),
        (6.0, 0.0),
        (0.0, 3.0),
        (10.5, 0.0),
        (-2.5, -1.9),
        (20.0, 0.0),
    ],
)
def test_variance_does_not_cancel(loc: float, log_scale: float) -> None:
    """Relative accuracy for the narrowest Normal, and where nearly all the mass, or all but 1e-80, is on one bound."""
    p = law(loc, log_scale)
    with mpmath.workdps(500):
        m, s = mpmath.mpf(loc), mpmath.mpf(float(p.scale))
        a, b = (-1 - m) / s, (1 - m) / s
        tails = mpmath.ncdf(a), mpmath.ncdf(-b)
        m0 = 1 - tails[0] - tails[1]
        m1 = mpmath.npdf(a) - mpmath.npdf(b)
        m2 = m0 + a * mpmath.npdf(a) - b * mpmath.npdf(b)
        first = a * tails[0] + b * tails[1] + m1
        second = a**2 * tails[0] + b**2 * tails[1] + m2
        exact = float(s**2 * (second - first**2))
    assert float(p.variance) == relatively(exact, rel=5e-9 if loc == 20 else 1e-9)


@pytest.mark.parametrize(("loc", "scale"), [(0.5, 1e6), (1e6, 1e6), (0.3, 2.0), (10.5, 1.0)])
def test_the_variance_has_its_own_slope(loc: float, scale: float) -> None:
    """Of wide Normals, whose variance is that of a bound, the slope in the location."""
    m, s = (torch.tensor(x, dtype=torch.float64, requires_grad=True) for x in (loc, scale))
    found = torch.autograd.grad(ClippedNormal(m, s, -1.0, 1.0).variance, (m, s))

    def variance(m: mpmath.mpf, s: mpmath.mpf) -> mpmath.mpf:
        a, b = (-1 - m) / s, (1 - m) / s
        low, high = mpmath.ncdf(a), mpmath.ncdf(-b)
        m0, m1 = mpmath.ncdf(b) - mpmath.ncdf(a), mpmath.npdf(a) - mpmath.npdf(b)
        m2 = m0 + a * mpmath.npdf(a) - b * mpmath.npdf(b)
        mean = -low + high + m * m0 + s * m1
        return low + high + m**2 * m0 + 2 * m * s * m1 + s**2 * m2 - mean**2

    with mpmath.workdps(120):
        expected = [float(mpmath.diff(variance, (loc, scale), order)) for order in ((1, 0), (0, 1))]
    slopes = list(zip(found, expected, strict=True))[: 1 if scale > 1000 else 2]
    assert [x.item() for x, _ in slopes] == [relatively(y, rel=1e-3) for _, y in slopes]


@few
@given(locs, log_scales, intervals())
def test_entropy_is_minus_the_mean_log_prob(
    loc: float, log_scale: float, bounds: tuple[float, float]
) -> None:
    """Definition: −E[log_prob(a)] with respect to the mixed base measure."""
    p = law(loc, log_scale, *bounds)
    assert float(p.entropy()) == pytest.approx(-expect(p, log_prob_at(p)), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("log_scale", [-10.0, -1.0, 1.0])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_the_score_is_finite_within_the_limits_of_a_policy(dtype: torch.dtype, log_scale: float) -> None:
    loc = torch.linspace(-3, 3, 601, dtype=dtype, requires_grad=True)
    p = ClippedNormal(loc, math.exp(log_scale), -1.0, 1.0)
    (score,) = torch.autograd.grad(p.log_prob(p.median.detach()).sum(), loc)
    assert torch.isfinite(score).all()


def test_entropy_at_its_limits() -> None:
    """All on one bound: 0. Shared by the bounds: log 2. Nothing clipped: the Normal's. Its unit matters."""
    assert float(law(50.0, 0.0).entropy()) == pytest.approx(0.0, abs=1e-12)
    assert float(law(0.0, 12.0).entropy()) == pytest.approx(math.log(2), abs=1e-3)
    point = ClippedNormal(*double(0.0, 1e-155), -1.0, 1.0)
    assert float(point.entropy()) == pytest.approx(math.log(1e-155) + math.log(2 * math.pi * math.e) / 2)
    assert float(point.stddev) == pytest.approx(1e-155)
    narrow = law(0.1, -4.0)
    assert float(narrow.entropy()) == pytest.approx(
        float(Normal(narrow.loc, narrow.scale).entropy()), abs=1e-12
    )
    p, doubled = law(0.2, 0.0), ClippedNormal(*double(0.4, 2.0), -2.0, 2.0)
    inside = 1 - float(p.mass_low + p.mass_high)
    assert float(doubled.entropy() - p.entropy()) == pytest.approx(inside * math.log(2), abs=1e-12)


@few
@given(floats(-3, 3), floats(-2, 1), floats(-3, 3), floats(-2, 1), intervals())
def test_kl_against_quadrature_and_below_the_gaussians(
    loc: float, log_scale: float, other_loc: float, other_log_scale: float, bounds: tuple[float, float]
) -> None:
    """Fact: the joint KL is two masses and an integral, and the Gaussian KL bounds it (data processing)."""
    p, q = law(loc, log_scale, *bounds), law(other_loc, other_log_scale, *bounds)
    divergence = float(kl_divergence(p, q))
    integral = expect(p, lambda a: log_prob_at(p)(a) - log_prob_at(q)(a))
    assert divergence == pytest.approx(integral, rel=1e-6, abs=1e-7)
    bound = float(gaussian_kl_upper_bound(p, q))
    torch.testing.assert_close(bound, float(kl_divergence(Normal(p.loc, p.scale), Normal(q.loc, q.scale))))
    assert -1e-12 <= divergence <= bound + 1e-12


def test_the_gaussian_bound_is_attained_when_nothing_is_clipped_and_loose_when_all_is() -> None:
    inside = law(0.0, -4.0), law(0.01, -4.1)
    assert float(kl_divergence(*inside)) == relatively(float(gaussian_kl_upper_bound(*inside)), rel=1e-12)
    outside = law(9.0, 0.0), law(11.0, 0.0)
    assert float(gaussian_kl_upper_bound(*outside)) == pytest.approx(2.0)
    assert 0 <= float(kl_divergence(*outside)) < 1e-12


def test_kl_order_and_bounds() -> None:
    p, q = law(0.0, 0.0), law(1.5, 0.7)
    assert float(kl_divergence(p, q)) != pytest.approx(float(kl_divergence(q, p)), rel=1e-2)
    with pytest.raises(ValueError, match="equal bounds"):
        gaussian_kl_upper_bound(p, ClippedNormal(0.0, 1.0, -1.0, 2.0))


def test_cdf_jumps_at_the_bounds_and_icdf_inverts_it() -> None:
    p = law(0.3, 0.2)
    lax = ClippedNormal(p.loc, p.scale, -1.0, 1.0, validate_args=False)
    assert lax.cdf(*double([-1.001, 1.0, 5.0])).tolist() == [0.0, 1.0, 1.0]
    torch.testing.assert_close(p.cdf(p.low), p.mass_low)
    probability = torch.linspace(0, 1, 101, dtype=torch.float64)
    value = p.icdf(probability)
    assert value[0] == -1
    assert value[-1] == 1
    between = (value > -1) & (value < 1)
    torch.testing.assert_close(p.cdf(value[between]), probability[between])
    assert bool((p.cdf(value) >= probability - 1e-12).all())


@few
@given(locs, log_scales)
def test_median_and_mode_are_the_clipped_location(loc: float, log_scale: float) -> None:
    p = law(loc, log_scale)
    assert float(p.median) == float(p.mode) == min(max(loc, -1.0), 1.0)
    assert float(p.icdf(*double(0.5))) == pytest.approx(float(p.median), abs=1e-12)


def test_latent_is_the_unclipped_sample() -> None:
    p = law(0.9, 0.0)
    z = p.rsample_latent((1000,), torch.Generator().manual_seed(0))
    assert bool((z > 1).any())
    value = p.latent_to_value(z)
    assert torch.equal(value, z.clamp(-1, 1))
    assert torch.equal(p.log_prob_latent(z), p.log_prob(value))
    assert torch.equal(p.sample((1000,), torch.Generator().manual_seed(0)), value)
    assert not hasattr(p, "value_to_latent")


def scores(p: ClippedNormal, grid: Tensor) -> tuple[Tensor, Tensor]:
    """Return the plain Gaussian score of z and CAPG's score of the executed action, both w.r.t. loc."""
    copies = p.loc.detach().expand(len(grid)).clone().requires_grad_()
    plain = torch.autograd.grad(Normal(copies, p.scale).log_prob(grid).sum(), copies)[0]
    clipped = ClippedNormal(copies, p.scale, p.low, p.high).log_prob_latent(grid).sum()
    return plain, torch.autograd.grad(clipped, copies)[0]


def test_capg_is_unbiased_with_lower_variance() -> None:
    """Fact (Fujita & Maeda 2018): on a one-step problem both scores give the true gradient; CAPG's varies less.

    The density of the unclipped Normal at the *clipped* action gives a wrong one.
    """
    p = law(0.6, 0.0)
    z = torch.arange(-11.3995, 12.6, 0.001, dtype=torch.float64)  # midpoint rule: no node on a bound
    weights = Normal(p.loc, p.scale).log_prob(z).exp() * (z[1] - z[0])

    def reward(a: Tensor) -> Tensor:
        return torch.sin(2 * a) + a**2

    loc = p.loc.clone().requires_grad_()
    noise = (z - p.loc) / p.scale
    executed = (loc + p.scale * noise).clamp(-1, 1)
    truth = float(torch.autograd.grad((weights * reward(executed)).sum(), loc)[0])

    plain, capg = scores(p, z)
    value = reward(z.clamp(-1, 1))
    estimate = {name: weights * score * value for name, score in {"plain": plain, "capg": capg}.items()}
    variance = {
        name: float((weights * (score * value) ** 2).sum()) - truth**2
        for name, score in {"plain": plain, "capg": capg}.items()
    }
    assert float(estimate["plain"].sum()) == pytest.approx(truth, abs=1e-4)
    assert float(estimate["capg"].sum()) == pytest.approx(truth, abs=1e-4)
    assert variance["capg"] < 0.9 * variance["plain"]
    at_clipped = (z.clamp(-1, 1) - p.loc) / p.scale**2  # the score that many a code computes
    assert abs(float((weights * at_clipped * value).sum()) - truth) > 0.1


def test_capg_score_is_the_conditional_expectation_of_the_plain_one() -> None:
    """On a bound, ∂log Φ is E[plain score | clipped there]; inside, the two are equal."""
    p = law(0.2, 0.3)
    z = torch.linspace(-16, 16, 64001, dtype=torch.float64)
    weights = Normal(p.loc, p.scale).log_prob(z).exp()
    plain, capg = scores(p, z)
    inside = (z > -1) & (z < 1)
    torch.testing.assert_close(plain[inside], capg[inside])
    for clipped in (z <= -1, z >= 1):
        conditional = (weights * plain)[clipped].sum() / weights[clipped].sum()
        torch.testing.assert_close(capg[clipped].mean(), conditional, rtol=1e-3, atol=1e-3)


def test_pathwise_gradient_is_zero_where_clipped() -> None:
    loc = torch.zeros(1000, dtype=torch.float64, requires_grad=True)
    value = ClippedNormal(loc, 1.0, -1.0, 1.0).rsample(generator=torch.Generator().manual_seed(0))
    (gradient,) = torch.autograd.grad(value.sum(), loc)
    assert torch.equal(gradient == 0, value.abs() == 1)
    assert bool((gradient == 0).any())
