"""The logit-normal against SciPy's Johnson S_B, mpmath and brute force; and the facts that the book proves."""

import math

import mpmath
import numpy as np
import pytest
import scipy.stats
import torch
from hypothesis import assume, given
from hypothesis import strategies as st
from torch import Tensor
from torch.distributions import AffineTransform, Normal, TanhTransform, TransformedDistribution, kl_divergence

from inbounds.distributions import LogitNormal

from .families import double, few, floats, intervals, relatively

DOMAIN = [
    (m, s) for m in (-15.0, -4.0, -0.3, 0.0, 1.0, 7.0, 15.0) for s in (-10.0, -5.0, -1.0, 0.0, 0.5, 1.0)
]


def law(loc: float, log_scale: float, low: float = 0.0, high: float = 1.0) -> LogitNormal:
    return LogitNormal(*double(loc, math.exp(log_scale)), low, high)


def johnson(loc: float, scale: float, low: float, high: float):
    return scipy.stats.johnsonsb(-loc / scale, 1 / scale, low, high - low)


def exact_moments(loc: float, log_scale: float) -> tuple[float, float, float]:
    """Mean, variance and entropy on (0, 1), by forty-digit quadrature."""
    with mpmath.workdps(40):
        m, s = mpmath.mpf(loc), mpmath.exp(mpmath.mpf(log_scale))
        cuts = sorted({mpmath.mpf(c) for c in (-16, -6, -2, 0, 2, 6, 16)} | {max(-16, min(16, -m / s))})

        def expect(f):
            return mpmath.quad(lambda x: mpmath.npdf(x) * f(m + s * x), cuts)

        mean = expect(lambda z: 1 / (1 + mpmath.exp(-z)))
        variance = expect(lambda z: (1 / (1 + mpmath.exp(-z)) - mean) ** 2)
        softplus = expect(lambda z: mpmath.log1p(mpmath.exp(z)))
        entropy = mpmath.log(2 * mpmath.pi * mpmath.e * s**2) / 2 + m - 2 * softplus
        return float(mean), float(variance), float(entropy)


# ---- the density, by change of variables


@few
@given(floats(-5, 5), floats(-3, 1), intervals(), floats(0.001, 0.999))
def test_density_is_johnsons(
    loc: float, log_scale: float, bounds: tuple[float, float], fraction: float
) -> None:
    """Density, cdf and quantile equal SciPy's S_B law, an independent implementation."""
    low, high = bounds
    value = low + fraction * (high - low)
    assume(abs(math.log(fraction / (1 - fraction)) - loc) < 30 * math.exp(log_scale))  # where SciPy is finite
    ours, scipys = law(loc, log_scale, low, high), johnson(loc, math.exp(log_scale), low, high)
    (v,) = double(value)
    assert float(ours.log_prob(v)) == pytest.approx(scipys.logpdf(value), rel=1e-7, abs=1e-7)
    assert float(ours.cdf(v)) == pytest.approx(scipys.cdf(value), abs=1e-9)
    assert float(ours.icdf(*double(fraction))) == pytest.approx(scipys.ppf(fraction), abs=1e-9)


@few
@given(floats(-4, 4), floats(-1, 1), intervals())
def test_density_integrates_to_one(loc: float, log_scale: float, bounds: tuple[float, float]) -> None:
    """∫ p(a) da = 1, the sum taken over values, on a grid that is fine next to the bounds."""
    ours = law(loc, log_scale, *bounds)
    edges = ours.latent_to_value(torch.linspace(-34, 34, 8001, dtype=torch.float64))
    density = ours.log_prob(edges).exp()
    assert float(torch.trapezoid(density, edges)) == pytest.approx(1.0, abs=1e-4)


@few
@given(floats(-3, 3), floats(-2, 1), floats(-0.999, 0.999))
def test_on_the_symmetric_interval_it_is_the_tanh_gaussian(
    loc: float, log_scale: float, value: float
) -> None:
    """Fact: on [−1, 1] the law is tanh of Normal(μ/2, σ/2), the squashed Gaussian of SAC."""
    mu, sigma, v = double(loc, math.exp(log_scale), value)
    squashed = TransformedDistribution(
        Normal(mu / 2, sigma / 2), [TanhTransform(), AffineTransform(0.0, 1.0)]
    )
    torch.testing.assert_close(LogitNormal(mu, sigma, -1.0, 1.0).log_prob(v), squashed.log_prob(v))


@few
@given(floats(-5, 5), floats(-3, 1), intervals(), floats(-8, 8))
def test_latent_density_is_the_density(
    loc: float, log_scale: float, bounds: tuple[float, float], latent: float
) -> None:
    ours, (z,) = law(loc, log_scale, *bounds), double(latent)
    expected = ours.log_prob(ours.latent_to_value(z))
    torch.testing.assert_close(ours.log_prob_latent(z), expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("latent", [-40.0, 40.0])
@pytest.mark.parametrize("log_scale", [-10.0, -1.0, 1.0])
def test_finite_at_saturated_latents(dtype: torch.dtype, latent: float, log_scale: float) -> None:
    """At z = ±40 density and gradient are finite, and equal to mpmath's."""
    loc = torch.tensor(1.0, dtype=dtype, requires_grad=True)
    scale = torch.tensor(math.exp(log_scale), dtype=dtype, requires_grad=True)
    z = torch.tensor(latent, dtype=dtype, requires_grad=True)
    log_prob = LogitNormal(loc, scale, -2.0, 3.0).log_prob_latent(z)
    gradients = torch.autograd.grad(log_prob, (loc, scale, z))
    with mpmath.workdps(60):
        m, s, x = mpmath.mpf(1), mpmath.mpf(scale.item()), mpmath.mpf(latent)
        fraction = 1 / (1 + mpmath.exp(-x))
        exact = mpmath.log(mpmath.npdf(x, m, s) / (5 * fraction * (1 - fraction)))
        slopes = [(x - m) / s**2, (x - m) ** 2 / s**3 - 1 / s, -(x - m) / s**2 + mpmath.tanh(x / 2)]
    accuracy = 1e-6 if dtype == torch.float32 else 1e-13
    for ours, truth in zip((log_prob, *gradients), (exact, *slopes), strict=True):
        assert ours.item() == relatively(float(truth), rel=accuracy)


def test_a_float32_value_has_forgotten_its_latent() -> None:
    """Fact: store the latent. Reading it back from a float32 value near its bound is wrong by whole nats."""
    ours = LogitNormal(torch.tensor(14.0), 1.0, -1.0, 1.0)
    latent = torch.tensor([14.0, 20.0, 40.0])
    value = ours.latent_to_value(latent)
    assert bool(
        ours.support.check(value).all()
    )  # the specified edge: never on the bound, always to be scored
    assert value[2] == torch.nextafter(torch.tensor(1.0), torch.tensor(0.0))
    assert bool(((ours.value_to_latent(value) - latent)[1:].abs() > 2).all())
    from_value, from_latent = ours.log_prob(value), ours.log_prob_latent(latent)
    exact = LogitNormal(*double(14.0, 1.0), -1.0, 1.0).log_prob_latent(latent.double())
    torch.testing.assert_close(from_latent.double(), exact, rtol=1e-6, atol=1e-5)
    assert bool(((from_value - from_latent)[1:].abs() > 5).all())


def test_on_a_bound_the_log_density_is_minus_infinity_or_an_error() -> None:
    bounds = torch.tensor([-1.0, 1.0])
    with pytest.raises(ValueError, match="rsample_latent"):
        LogitNormal(0.0, 1.0, -1.0, 1.0).log_prob(bounds)
    lax = LogitNormal(0.0, 1.0, -1.0, 1.0, validate_args=False)
    assert lax.log_prob(bounds).tolist() == [-math.inf, -math.inf]
    assert lax.cdf(torch.tensor([-3.0, -1.0, 0.0, 1.0, 3.0])).tolist() == [0.0, 0.0, 0.5, 1.0, 1.0]


def test_cdf_and_icdf_invert_and_differentiate() -> None:
    ours = law(0.5, 0.2, -1.0, 2.0)
    probability = torch.linspace(0.01, 0.99, 21, dtype=torch.float64)
    value = ours.icdf(probability).requires_grad_()
    torch.testing.assert_close(ours.cdf(value), probability)
    density = torch.autograd.grad(ours.cdf(value).sum(), value)[0]
    torch.testing.assert_close(density, ours.log_prob(value).exp())
    assert float(ours.icdf(*double(0.5))) == pytest.approx(float(ours.median))
    assert bool(ours.support.check(ours.icdf(torch.tensor([0.0, 1.0]).double())).all())
    assert bool(ours.icdf(torch.tensor([-0.1, 1.1])).isnan().all())


def test_cdf_keeps_its_lower_tail() -> None:
    value = torch.tensor(1e-12, dtype=torch.float64)
    exact = scipy.stats.norm.logcdf(math.log(1e-12) / 1.5)
    assert math.log(float(law(0.0, math.log(1.5)).cdf(value))) == relatively(exact, rel=1e-10)


# ---- mean, variance, entropy


@pytest.mark.parametrize(("loc", "log_scale"), [p for i, p in enumerate(DOMAIN) if (i + i // 6) % 2])
def test_moments_against_mpmath(loc: float, log_scale: float) -> None:
    """Good to 1e-10 over −10 ≤ log σ ≤ 1, |μ| ≤ 15; the variance relatively, down to log σ = −10."""
    ours = law(loc, log_scale)
    mean, variance, entropy = exact_moments(loc, log_scale)
    assert float(ours.mean) == relatively(mean, rel=1e-12)
    assert float(ours.variance) == relatively(variance, rel=1e-11)
    assert float(ours.stddev) == relatively(math.sqrt(variance), rel=1e-11)
    assert float(ours.entropy()) == pytest.approx(entropy, rel=1e-13, abs=1e-13)


@few
@given(floats(-6, 6), floats(-2, 1))
def test_mean_satisfies_its_recurrence(loc: float, log_scale: float) -> None:
    """m(μ) = 1 − exp(σ²/2 − μ) m(μ − σ²), and Var = m(1 − m) − m'(μ), on the unit interval (Pirjol 2013)."""
    variance = math.exp(2 * log_scale)
    location, scale = double(loc, math.exp(log_scale))
    shifted = LogitNormal(location - variance, scale).mean
    mean = LogitNormal(location.requires_grad_(), scale).mean
    (slope,) = torch.autograd.grad(mean, location)
    mean = mean.detach()
    assert float(mean) == pytest.approx(1 - math.exp(variance / 2 - loc) * float(shifted), abs=1e-9)
    law = LogitNormal(location.detach(), scale)
    assert float(law.variance) == pytest.approx(float(mean * (1 - mean) - slope), abs=1e-12)


@pytest.mark.parametrize("scale", [0.3, 1.0, math.e])
def test_mean_is_a_finite_sum_at_multiples_of_the_variance(scale: float) -> None:
    for k in range(6):
        terms = [(-1) ** j * math.exp(-(scale**2) * (j * k - j**2 / 2)) for j in range(k)]
        exact = sum(terms) + 0.5 * (-1) ** k * math.exp(-(scale**2) * k**2 / 2)
        assert float(LogitNormal(*double(k * scale**2, scale)).mean) == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize(("loc", "scale"), [(0.7, 1e6), (-1e5, 1e6), (0.0, 1e-8), (40.0, 1.0)])
def test_moments_at_extreme_parameters(loc: float, scale: float) -> None:
    """A very wide law is a coin on the two bounds; a very narrow one a Normal with the sigmoid's slope."""
    ours = LogitNormal(*double(loc, scale), -1.0, 1.0)
    if scale > 100:
        heads = scipy.stats.norm.cdf(loc / scale)
        assert float(ours.mean) == pytest.approx(2 * heads - 1, abs=1e-6)
        assert float(ours.variance) == relatively(4 * heads * (1 - heads), rel=1e-5)
        normal = math.log(2 * math.pi * math.e * scale**2) / 2
        folded = scipy.stats.foldnorm.mean(abs(loc) / scale, scale=scale)  # E|z|
        assert float(ours.entropy()) == relatively(normal - folded + math.log(2), rel=1e-8)
    else:
        slope = math.exp(-abs(loc)) / (1 + math.exp(-abs(loc))) ** 2
        linear = 4 * (scale * slope) ** 2 * (math.e * (math.e - 1) if loc == 40.0 else 1)
        assert float(ours.variance) == relatively(linear, rel=1e-6)  # at μ = 40: the log-normal of 1 − x


def test_derivatives_of_the_moments_in_the_whole_domain() -> None:
    """First derivatives of mean and entropy against the expectations that they are, by another rule."""
    points = torch.tensor(DOMAIN, dtype=torch.float64)
    loc, scale = points[:, 0].clone().requires_grad_(), points[:, 1].exp().requires_grad_()
    ours = LogitNormal(loc, scale)
    x = torch.linspace(-12, 12, 4001, dtype=torch.float64)
    weights = torch.from_numpy(scipy.stats.norm.pdf(x.numpy())) * (x[1] - x[0])
    z = (loc.unsqueeze(-1) + scale.unsqueeze(-1) * x).detach()
    s = torch.sigmoid(z)
    slope, curve = s * torch.sigmoid(-z), s * torch.sigmoid(-z) * (1 - 2 * s)
    d_mean = torch.autograd.grad(ours.mean.sum(), (loc, scale), create_graph=True)
    torch.testing.assert_close(d_mean[0], (weights * slope).sum(-1), rtol=0, atol=1e-13)
    torch.testing.assert_close(d_mean[1], (weights * slope * x).sum(-1), rtol=0, atol=1e-13)
    second = torch.autograd.grad(d_mean[1].sum(), (loc, scale))
    torch.testing.assert_close(second[0], (weights * curve * x).sum(-1), rtol=0, atol=1e-12)
    torch.testing.assert_close(second[1], (weights * curve * x * x).sum(-1), rtol=0, atol=1e-12)
    d_entropy = torch.autograd.grad(ours.entropy().sum(), (loc, scale))
    torch.testing.assert_close(d_entropy[0], 1 - 2 * (weights * s).sum(-1), rtol=0, atol=1e-12)
    expected = 1 / scale.detach() - 2 * (weights * s * x).sum(-1)
    torch.testing.assert_close(d_entropy[1], expected, rtol=1e-12, atol=1e-12)


@few
@given(floats(-3, 3), floats(-2, 1), intervals())
def test_entropy_is_minus_the_mean_log_density(
    loc: float, log_scale: float, bounds: tuple[float, float]
) -> None:
    """Fact: entropy = ½log(2πeσ²) + μ − 2E[softplus(z)] + log(high − low), = −∫ p log p over *values*."""
    ours = law(loc, log_scale, *bounds)
    edges = ours.latent_to_value(torch.linspace(-34, 34, 8001, dtype=torch.float64))
    log_prob = ours.log_prob(edges)
    assert float(ours.entropy()) == pytest.approx(
        float(-torch.trapezoid(log_prob.exp() * log_prob, edges)), abs=1e-3
    )
    unit = law(loc, log_scale)
    assert float(ours.entropy() - unit.entropy()) == pytest.approx(math.log(bounds[1] - bounds[0]), abs=1e-12)


def test_entropy_depends_on_loc_and_has_a_maximum_in_scale() -> None:
    """Fact: the entropy is largest at a finite σ, where the density is bimodal already; a Normal's grows forever."""
    scale = torch.linspace(0.1, 40.0, 4000, dtype=torch.float64)
    entropy = LogitNormal(torch.zeros_like(scale), scale).entropy()
    best = int(entropy.argmax())
    assert 0 < best < len(scale) - 1
    assert bool((entropy[: best + 1].diff() > 0).all())
    assert bool((entropy[best:].diff() < 0).all())
    assert bool(LogitNormal(0.0, scale[best]).is_bimodal)
    assert float(entropy[best]) < 0  # the uniform law, entropy 0, is not of the family
    assert float(law(2.0, 0.0).entropy()) < float(law(0.0, 0.0).entropy())


# ---- mode, median, mean


def brute_force_modes(loc: float, scale: float) -> tuple[int, float]:
    """Count the local maxima of p over values, and return the latent of the highest, on a fine grid."""
    reach = abs(loc) + scale**2 + 5
    z = np.linspace(-reach, reach, 200001)
    log_density = -(((z - loc) / scale) ** 2) / 2 + np.logaddexp(z, 0) + np.logaddexp(-z, 0)
    rising = np.diff(log_density) > 0
    return int((rising[:-1] & ~rising[1:]).sum()), float(z[log_density.argmax()])


@few
@given(floats(-6, 6), floats(-2, 1.2))
def test_mode_and_bimodality_against_brute_force(loc: float, log_scale: float) -> None:
    """Fact: two modes iff σ² > 2 and |μ| < σ²k − 2 artanh k; the mode is the higher one."""
    scale = math.exp(log_scale)
    k = math.sqrt(max(0.0, 1 - 2 / scale**2))
    assume(abs(abs(loc) - (scale**2 * k - 2 * math.atanh(k))) > 1e-2)
    assume(abs(loc) > 1e-3)
    ours = law(loc, log_scale)
    count, latent = brute_force_modes(loc, scale)
    assert bool(ours.is_bimodal) == (count == 2)
    assert float(ours.mode_latent) == pytest.approx(latent, abs=2e-3)


@few
@given(floats(0.45, 1.2), st.sampled_from([-1.05, -0.95, 0.95, 1.05]))
def test_two_modes_become_one_at_the_stated_location(log_scale: float, factor: float) -> None:
    """Fact: at |μ| = σ²k − 2 artanh k the lower mode vanishes; five per cent to either side it counts."""
    scale = math.exp(log_scale)
    k = math.sqrt(1 - 2 / scale**2)
    loc = factor * (scale**2 * k - 2 * math.atanh(k))
    count, _ = brute_force_modes(loc, scale)
    assert count == (2 if abs(factor) < 1 else 1)
    assert bool(law(loc, log_scale).is_bimodal) == (count == 2)


@pytest.mark.parametrize(("loc", "scale"), [(0.0, 1.4), (0.0, 1.45), (1e-3, 1.6), (0.3, 1e6), (0.3, 1e9)])
def test_bimodality_at_the_margins(loc: float, scale: float) -> None:
    for dtype in (torch.float32, torch.float64):
        ours = LogitNormal(torch.tensor(loc, dtype=dtype), torch.tensor(scale, dtype=dtype))
        assert bool(ours.is_bimodal) == (scale > math.sqrt(2)), dtype


@few
@given(floats(-15, 15), floats(-10, 2.5))
def test_mode_is_stationary(loc: float, log_scale: float) -> None:
    """z = μ + σ² tanh(z/2), on μ's side, and the density is no higher at the mirrored root."""
    scale = math.exp(log_scale)
    ours = law(loc, log_scale)
    z = float(ours.mode_latent)
    assert z - loc - scale**2 * math.tanh(z / 2) == pytest.approx(0.0, abs=1e-12 * (1 + scale**2 + abs(loc)))
    assert z * loc >= 0
    assert abs(z) >= abs(loc)  # the mode is pushed out, towards the bound
    both = ours.log_prob_latent(torch.tensor([z, -z], dtype=torch.float64))
    assert both[0] >= both[1] - 1e-9 * abs(both[0])


def test_mode_ties_and_cusp() -> None:
    """At a tie the upper mode; at the cusp (μ = 0, σ² = 2) and below it the centre; finite everywhere."""
    tie = law(0.0, 0.8, -1.0, 1.0)
    assert bool(tie.is_bimodal)
    assert float(tie.mode) > 0.9
    assert float(law(0.0, 0.2, -1.0, 1.0).mode) == pytest.approx(0.0, abs=1e-15)
    cusp = LogitNormal(*double(0.0, math.sqrt(2.0)), -1.0, 1.0)
    assert float(cusp.mode) == pytest.approx(0.0, abs=1e-4)
    slope = torch.tensor(0.0, dtype=torch.float64, requires_grad=True)
    (gradient,) = torch.autograd.grad(LogitNormal(slope, 1.0).mode_latent, slope)
    assert float(gradient) == pytest.approx(2.0)  # 1/(1 − σ²/2), through the origin


def test_mode_derivatives() -> None:
    """gradcheck and gradgradcheck, and the implicit-function theorem, away from cusp and ties."""
    loc, scale = double([-8.0, -0.8, 0.3, 1.0, 2.0, 12.0], [0.4, 1.0, 2.0, 2.7, 1.5, 2.7])
    loc, scale = loc.requires_grad_(), scale.requires_grad_()

    def mode(m: Tensor, s: Tensor) -> tuple[Tensor, Tensor]:
        ours = LogitNormal(m, s, -1.0, 2.0)
        return ours.mode, ours.mode_latent

    assert torch.autograd.gradcheck(mode, (loc, scale))
    assert torch.autograd.gradgradcheck(mode, (loc, scale))
    z = LogitNormal(loc, scale).mode_latent
    gradients = torch.autograd.grad(z.sum(), (loc, scale))
    z, sigma = z.detach(), scale.detach()
    curvature = 1 - sigma**2 / 2 * (1 - torch.tanh(z / 2) ** 2)
    torch.testing.assert_close(gradients[0], 1 / curvature)
    torch.testing.assert_close(gradients[1], 2 * sigma * torch.tanh(z / 2) / curvature)


@few
@given(floats(-4, 4), floats(-2, 1))
def test_only_the_median_is_invariant(loc: float, log_scale: float) -> None:
    """Fact: the median is the image of μ. Mean and mode are not: they fall on opposite sides of it."""
    ours, scale = law(loc, log_scale), math.exp(log_scale)
    assert float(ours.median) == relatively(1 / (1 + math.exp(-loc)), rel=1e-14)
    assume(abs(loc) > 0.1 and scale > 0.3)
    mean, median, mode = float(ours.mean), float(ours.median), float(ours.mode)
    assert abs(mean - 0.5) < abs(median - 0.5) < abs(mode - 0.5)


def test_the_mode_jumps_across_the_interval() -> None:
    """Fact: for σ² > 2 the mode jumps from bound to bound as μ crosses zero; mean and median glide."""
    left, right = (law(m, 1.0, -1.0, 1.0) for m in (-1e-6, 1e-6))
    assert float(right.mode - left.mode) > 1.99
    assert float(right.median - left.median) < 1e-5
    assert float(right.mean - left.mean) < 1e-5


# ---- invariance


def test_kl_is_that_of_the_latents_and_of_the_values() -> None:
    """Fact: KL is invariant. The closed form of the Normals equals the integral over *values*."""
    p, q = law(0.4, 0.1, -2.0, 1.0), law(-0.5, 0.3, -2.0, 1.0)
    edges = p.latent_to_value(torch.linspace(-30, 30, 8001, dtype=torch.float64))
    log_ratio = p.log_prob(edges) - q.log_prob(edges)
    integral = torch.trapezoid(p.log_prob(edges).exp() * log_ratio, edges)
    closed = kl_divergence(p, q)
    assert float(closed) == pytest.approx(float(integral), abs=1e-6)
    torch.testing.assert_close(closed, kl_divergence(Normal(p.loc, p.scale), Normal(q.loc, q.scale)))
    assert float(kl_divergence(q, p)) != pytest.approx(float(closed), rel=1e-3)  # the order matters


@few
@given(floats(-3, 3), floats(-2, 1), floats(-5, 5))
def test_ratio_and_score_are_those_of_the_latents(loc: float, log_scale: float, latent: float) -> None:
    """Fact: density ratio and score of the logit-normal at a are those of the Normal at z."""
    (mu, sigma, z) = double(loc, math.exp(log_scale), latent)
    mu, sigma = mu.requires_grad_(), sigma.requires_grad_()
    new, old = LogitNormal(mu, sigma, -1.0, 2.0), LogitNormal(*double(0.1, 1.1), -1.0, 2.0)
    value = new.latent_to_value(z)
    log_ratio = new.log_prob(value) - old.log_prob(value)
    latent_ratio = Normal(mu, sigma).log_prob(z) - Normal(*double(0.1, 1.1)).log_prob(z)
    torch.testing.assert_close(log_ratio, latent_ratio, rtol=1e-9, atol=1e-9)
    score = torch.autograd.grad(log_ratio, (mu, sigma))
    latent_score = torch.autograd.grad(latent_ratio, (mu, sigma))
    torch.testing.assert_close(score, latent_score, rtol=1e-8, atol=1e-8)


def test_fisher_is_the_hessian_of_the_kl_and_that_of_the_latents() -> None:
    """Fact: the KL's Hessian at home is the Fisher matrix, diag(1, 2)/σ², as for the Normal."""
    parameters = torch.tensor([0.7, 1.3], dtype=torch.float64)

    def divergence(theta: Tensor) -> Tensor:
        home = LogitNormal(parameters[0], parameters[1], -1.0, 2.0)
        return kl_divergence(home, LogitNormal(theta[0], theta[1], -1.0, 2.0))

    hessian = torch.autograd.functional.hessian(divergence, parameters)
    expected = torch.diag(torch.tensor([1.0, 2.0], dtype=torch.float64)) / 1.3**2
    torch.testing.assert_close(hessian, expected)
