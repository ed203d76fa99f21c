"""The Beta on an interval against SciPy and mpmath, its KL in float32, its mode at the edges."""

import math

import mpmath
import numpy as np
import pytest
import scipy.integrate
import scipy.special
import scipy.stats
import torch
from hypothesis import assume, given
from torch.distributions import Beta, kl_divergence

from inbounds.distributions import ScaledBeta

from .families import double, few, floats, intervals, relatively

log_concentrations = floats(-2, 4.4)  # up to 80, where the source thesis caps them


def pair(log_alpha: float, log_beta: float) -> tuple[float, float]:
    return math.exp(log_alpha), math.exp(log_beta)


@few
@given(log_concentrations, log_concentrations, intervals(), floats(0.001, 0.999))
def test_density_and_moments_are_scipys(
    log_alpha: float, log_beta: float, bounds: tuple[float, float], fraction: float
) -> None:
    (alpha, beta), (low, high) = pair(log_alpha, log_beta), bounds
    ours = ScaledBeta(*double(alpha, beta), low, high)
    scipys = scipy.stats.beta(alpha, beta, low, high - low)
    value = low + fraction * (high - low)
    assert float(ours.log_prob(*double(value))) == pytest.approx(scipys.logpdf(value), rel=1e-8, abs=1e-8)
    assert float(ours.mean) == relatively(scipys.mean(), rel=1e-12)
    assert float(ours.variance) == relatively(scipys.var(), rel=1e-12)
    assert float(ours.entropy()) == pytest.approx(scipys.entropy(), rel=1e-8, abs=1e-9)


@few
@given(floats(-1, 4), floats(-1, 4), intervals())
def test_half_of_the_mass_lies_below_the_median(
    log_alpha: float, log_beta: float, bounds: tuple[float, float]
) -> None:
    (alpha, beta), (low, high) = pair(log_alpha, log_beta), bounds
    first, second = (x.requires_grad_() for x in double(alpha, beta))
    median = ScaledBeta(first, second, low, high).median
    assert not median.requires_grad
    assert low <= float(median) <= high
    below = scipy.stats.beta(alpha, beta, low, high - low).cdf(float(median))
    assert below == pytest.approx(0.5, abs=1e-6)


def test_the_normaliser_is_the_gamma_function_of_the_sum() -> None:
    """Fact: Γ(α + β) normalises the density. With the incomplete gamma Γ(α, β), as printed, it does not."""
    alpha, beta = 2.5, 1.5
    ours = ScaledBeta(*double(alpha, beta), -1.0, 2.0)
    integral = scipy.integrate.quad(lambda a: float(ours.log_prob(*double(a)).exp()), -1, 2)[0]
    assert integral == pytest.approx(1.0, abs=1e-7)
    incomplete = scipy.special.gammaincc(alpha, beta) * scipy.special.gamma(alpha)
    assert integral * incomplete / scipy.special.gamma(alpha + beta) < 0.5


@few
@given(log_concentrations, log_concentrations, intervals(), floats(-6, 6))
def test_latent_density_is_the_density(
    log_alpha: float, log_beta: float, bounds: tuple[float, float], latent: float
) -> None:
    ours, (z,) = ScaledBeta(*double(*pair(log_alpha, log_beta)), *bounds), double(latent)
    expected = ours.log_prob(ours.latent_to_value(z))
    torch.testing.assert_close(ours.log_prob_latent(z), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("latent", [-40.0, 40.0])
@pytest.mark.parametrize(("alpha", "beta"), [(0.5, 3.0), (1.0, 1.0), (80.0, 2.0)])
def test_finite_at_saturated_latents(dtype: torch.dtype, latent: float, alpha: float, beta: float) -> None:
    a = torch.tensor(alpha, dtype=dtype, requires_grad=True)
    b = torch.tensor(beta, dtype=dtype, requires_grad=True)
    z = torch.tensor(latent, dtype=dtype, requires_grad=True)
    log_prob = ScaledBeta(a, b, -2.0, 3.0).log_prob_latent(z)
    assert log_prob.dtype == dtype
    gradients = torch.autograd.grad(log_prob, (a, b, z))
    with mpmath.workdps(60):
        x = 1 / (1 + mpmath.exp(-mpmath.mpf(latent)))
        exact = (alpha - 1) * mpmath.log(x) + (beta - 1) * mpmath.log(1 - x)
        exact -= mpmath.log(mpmath.beta(alpha, beta) * 5)
        slopes = [
            mpmath.log(x) - mpmath.digamma(alpha) + mpmath.digamma(alpha + beta),
            mpmath.log(1 - x) - mpmath.digamma(beta) + mpmath.digamma(alpha + beta),
            (alpha - 1) * (1 - x) - (beta - 1) * x,
        ]
    accuracy = 1e-6 if dtype == torch.float32 else 1e-12
    for ours, truth in zip((log_prob, *gradients), (exact, *slopes), strict=True):
        assert ours.item() == pytest.approx(float(truth), rel=accuracy, abs=accuracy)


def exact_kl(p: tuple[float, float], q: tuple[float, float]) -> float:
    with mpmath.workdps(50):
        (a, b), (c, d) = ([mpmath.mpf(x) for x in xs] for xs in (p, q))
        divergence = mpmath.log(mpmath.beta(c, d) / mpmath.beta(a, b))
        divergence += (a - c) * mpmath.digamma(a) + (b - d) * mpmath.digamma(b)
        return float(divergence + (c - a + d - b) * mpmath.digamma(a + b))


@few
@given(log_concentrations, log_concentrations, log_concentrations, log_concentrations)
def test_kl_is_torchs_and_mpmaths(a: float, b: float, c: float, d: float) -> None:
    p, q = pair(a, b), pair(c, d)
    divergence = kl_divergence(ScaledBeta(*double(*p), -3.0, 1.0), ScaledBeta(*double(*q), -3.0, 1.0))
    torch.testing.assert_close(
        divergence, kl_divergence(Beta(*double(*p)), Beta(*double(*q))), atol=1e-11, rtol=1e-9
    )
    assert float(divergence) == pytest.approx(exact_kl(p, q), rel=1e-10, abs=1e-11)


def test_kl_is_the_integral_of_the_log_ratio() -> None:
    """Fact: the closed form is KL(P‖Q) with P first, and does not feel the interval."""
    p, q = ScaledBeta(*double(2.0, 5.0), -1.0, 4.0), ScaledBeta(*double(3.0, 1.5), -1.0, 4.0)

    def integrand(a: float) -> float:
        (value,) = double(a)
        return float(p.log_prob(value).exp() * (p.log_prob(value) - q.log_prob(value)))

    integral = scipy.integrate.quad(integrand, -1, 4)[0]
    assert float(kl_divergence(p, q)) == pytest.approx(integral, abs=1e-7)
    assert float(kl_divergence(q, p)) != pytest.approx(integral, rel=1e-2)


def test_the_float32_kl_can_be_trusted() -> None:
    """Fact: in float32 arithmetic the closed form drowns in its terms; through float64 it keeps all its digits."""
    p, q = (79.5, 60.25), (79.75, 60.375)
    exact = exact_kl(p, q)
    assert 0 < exact < 1e-3
    ours = kl_divergence(ScaledBeta(*map(torch.tensor, p)), ScaledBeta(*map(torch.tensor, q)))
    assert ours.dtype == torch.float32
    assert ours.item() == relatively(exact, rel=1e-6)
    torchs = kl_divergence(Beta(*map(torch.tensor, p)), Beta(*map(torch.tensor, q)))
    assert abs(torchs.item() - exact) > exact / 5


def test_fisher_is_the_hessian_of_the_kl() -> None:
    """At home the KL's Hessian is the trigamma matrix: the Beta policy does TRPO like any other."""
    parameters = torch.tensor([2.5, 4.0], dtype=torch.float64)
    home = ScaledBeta(*parameters)
    hessian = torch.autograd.functional.hessian(
        lambda t: kl_divergence(home, ScaledBeta(t[0], t[1])), parameters
    )
    both = scipy.special.polygamma(1, 6.5)
    expected = np.diag(scipy.special.polygamma(1, [2.5, 4.0])) - both
    np.testing.assert_allclose(hessian.numpy(), expected, rtol=1e-8)  # torch's trigamma is good to 1e-9


@pytest.mark.parametrize(
    ("alpha", "beta", "mode"),
    [
        (3.0, 2.0, 2 / 3),
        (1.0, 3.0, 0.0),
        (3.0, 1.0, 1.0),
        (1.0, 1.0, 0.5),
        (0.5, 3.0, 0.0),
        (0.5, 1.0, 0.0),
        (3.0, 0.5, 1.0),
        (0.4, 0.6, 0.0),
        (0.6, 0.4, 1.0),
        (0.5, 0.5, 1.0),
    ],
)
def test_mode_and_its_edges(alpha: float, beta: float, mode: float) -> None:
    ours = ScaledBeta(*double(alpha, beta), -1.0, 3.0)
    assert float(ours.mode) == pytest.approx(-1 + 4 * mode, abs=1e-15)
    probes = torch.linspace(-0.9999, 2.9999, 999, dtype=torch.float64)
    highest = ours.log_prob((ours.mode + 0).clamp(-0.99999, 2.99999))
    assert bool((highest >= ours.log_prob(probes) - 1e-9).all())


def test_mode_gradients_are_finite_at_the_edges() -> None:
    alpha = torch.tensor([1.0, 0.5, 2.0, 1.0], dtype=torch.float64, requires_grad=True)
    beta = torch.tensor([1.0, 0.5, 3.0, 2.0], dtype=torch.float64, requires_grad=True)
    gradients = torch.autograd.grad(ScaledBeta(alpha, beta).mode.sum(), (alpha, beta))
    assert all(bool(g.isfinite().all()) for g in gradients)
    assert float(gradients[0][2]) == pytest.approx(2 / 9)  # (β − 1)/(α + β − 2)²


@few
@given(intervals(), floats(0, 1), floats(0, 200))
def test_from_mode(bounds: tuple[float, float], fraction: float, concentration: float) -> None:
    """α = 1 + ωκ, β = 1 + (1 − ω)κ: the mode comes back, and a larger κ is a narrower law."""
    low, high = bounds
    mode = double(low + fraction * (high - low))[0].clamp(low, high)
    ours = ScaledBeta.from_mode(mode, concentration, low, high)
    omega = (mode - low) / (high - low)
    torch.testing.assert_close(ours.concentration1, 1 + omega * concentration)
    torch.testing.assert_close(ours.concentration0, 1 + (1 - omega) * concentration)
    if concentration > 1e-3:
        torch.testing.assert_close(ours.mode, mode, rtol=1e-9, atol=1e-9)
    narrower = ScaledBeta.from_mode(mode, concentration + 5, low, high)
    assert narrower.stddev < ours.stddev


def test_without_parameters_there_is_no_mode() -> None:
    nan, two = torch.tensor(torch.nan), torch.tensor(2.0)
    for alpha, beta in ((nan, two), (two, nan), (nan, nan)):
        assert ScaledBeta(alpha, beta, validate_args=False).mode.isnan()


def test_from_mode_refuses_what_is_no_mode() -> None:
    with pytest.raises(ValueError, match="the mode must lie within"):
        ScaledBeta.from_mode(1.5, 2.0, -1.0, 1.0)
    for concentration in (-0.1, torch.inf):
        with pytest.raises(ValueError, match=r"must be finite and not negative, got.*clip it"):
            ScaledBeta.from_mode(0.5, concentration)
    with pytest.raises(ValueError, match="must be finite and not negative"):
        ScaledBeta.from_mode(0.5, torch.tensor([1.0, -2.0]), -1.0, 1.0)
    for low, high, wrong in (
        (1.0, 1.0, "less than high"),
        (1.0, -1.0, "Swap"),
        (math.nan, 1.0, "must be finite"),
    ):
        with pytest.raises(ValueError, match=wrong):
            ScaledBeta.from_mode(0.0, 2.0, low, high)
    assert ScaledBeta.from_mode(1.5, 2.0, -1.0, 1.0, validate_args=False).concentration0 == 0.5


def test_from_mode_differentiates() -> None:
    mode, concentration = (t.requires_grad_() for t in double([0.3, -0.5], [4.0, 0.5]))

    def concentrations(m: torch.Tensor, k: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        law = ScaledBeta.from_mode(m, k, -1.0, 1.0)
        return law.concentration1, law.concentration0

    assert torch.autograd.gradcheck(concentrations, (mode, concentration))


def test_tiny_concentrations_sample_both_bounds_and_stay_finite() -> None:
    """Where a Gamma variable underflows its logarithm does not: the latents of Beta(0.01, 0.01) are finite."""
    ours = ScaledBeta(torch.tensor(0.01), 0.01, -1.0, 1.0)
    generator = torch.Generator().manual_seed(0)
    latent = ours.rsample_latent((2000,), generator)
    assert bool(latent.isfinite().all())
    assert latent.abs().max() > 200
    assert bool(ours.log_prob(ours.latent_to_value(latent)).isfinite().all())
    assert bool(ours.log_prob_latent(latent).isfinite().all())
    assert latent.gt(0).float().mean() == pytest.approx(0.5, abs=0.05)


def test_latents_have_the_laws_moments() -> None:
    """E[z] = ψ(α) − ψ(β) and Var[z] = ψ'(α) + ψ'(β)."""
    latent = ScaledBeta(*double(0.3, 2.0)).rsample_latent((20000,), torch.Generator().manual_seed(1))
    mean = scipy.special.digamma(0.3) - scipy.special.digamma(2.0)
    variance = scipy.special.polygamma(1, 0.3) + scipy.special.polygamma(1, 2.0)
    assert float(latent.mean()) == pytest.approx(mean, abs=4 * math.sqrt(variance / 20000))
    assert float(latent.var()) == pytest.approx(variance, rel=0.06)


@few
@given(floats(1, 80), floats(1, 80), intervals())
def test_a_cap_is_a_floor_under_the_variance(alpha: float, beta: float, bounds: tuple[float, float]) -> None:
    """With 1 ≤ α, β ≤ c: c/((c + 1)²(c + 2)) ≤ Var/L² ≤ 1/12, attained at (c, 1) and (1, 1)."""
    low, high = bounds

    def relative_variance(a: float, b: float) -> float:
        law = ScaledBeta(*double(a, b), low, high)
        return float(law.variance / law.width.square())

    floor = 80 / (81**2 * 82)
    assert floor * (1 - 1e-9) <= relative_variance(alpha, beta) <= (1 + 1e-9) / 12
    assert relative_variance(80, 1) == relatively(floor, rel=1e-9)
    assert relative_variance(1, 1) == relatively(1 / 12, rel=1e-9)


@few
@given(floats(0.01, 0.99), floats(0.01, 0.99))
def test_means_and_variances_within_reach(mean: float, share: float) -> None:
    """α = mν, β = (1 − m)ν with ν = m(1 − m)/v − 1; both in [1, c] exactly between the stated variances."""
    variance = share * mean * (1 - mean)
    total = mean * (1 - mean) / variance - 1
    law = ScaledBeta(*double(mean * total, (1 - mean) * total))
    assert float(law.mean) == relatively(mean, rel=1e-9)
    assert float(law.variance) == relatively(variance, rel=1e-9)
    near, far = min(mean, 1 - mean), max(mean, 1 - mean)
    smaller, larger = sorted([float(law.concentration1), float(law.concentration0)])
    assume(not math.isclose(smaller, 1, rel_tol=1e-6) and not math.isclose(larger, 80, rel_tol=1e-6))
    assert (smaller > 1) == (variance < near**2 * far / (1 + near))
    assert (larger < 80) == (variance > near * far**2 / (80 + far))


@few
@given(floats(0, 1), floats(0.01, 70))
def test_entropy_falls_with_the_concentration(omega: float, concentration: float) -> None:
    """H = log L − KL(p‖uniform): it falls along κ at a fixed mode, with the gradient −I(η)(η − 1)."""
    law, uniform = ScaledBeta.from_mode(*double(omega, concentration)), ScaledBeta(*double(1.0, 1.0))
    assert float(law.entropy()) == pytest.approx(-float(kl_divergence(law, uniform)), abs=1e-10)
    assert law.entropy() < ScaledBeta.from_mode(*double(omega, 0.9 * concentration)).entropy()
    alpha, beta = (x.clone().requires_grad_() for x in (law.concentration1, law.concentration0))
    slopes = torch.autograd.grad(ScaledBeta(alpha, beta).entropy(), (alpha, beta))
    a, b = float(law.concentration1), float(law.concentration0)
    both = scipy.special.polygamma(1, a + b) * (a + b - 2)
    for slope, x in zip(slopes, (a, b), strict=True):
        expected = both - scipy.special.polygamma(1, x) * (x - 1)
        assert float(slope) == pytest.approx(expected, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("steps", [1, 3, 5, 9, 1000])
def test_the_mode_stays_in_the_box_where_the_law_is_nearly_uniform(steps: int) -> None:
    """In float32 α + β − 2 would round, and half of the mode's fraction with it."""
    alpha = torch.tensor(1.0) + steps * torch.finfo(torch.float32).eps
    assert ScaledBeta(alpha, 1.0, -1.0, 1.0).mode.item() == 1.0
    assert ScaledBeta(alpha, alpha, -1.0, 1.0).mode.item() == 0.0


def test_a_law_by_its_mode_is_made_and_compared_under_vmap() -> None:
    modes, highs = torch.tensor([-0.5, 0.2]), torch.tensor([1.0, 2.0])
    found = torch.vmap(lambda mode: ScaledBeta.from_mode(mode, 8.0, -1.0, 1.0).entropy())(modes)
    assert torch.equal(found, ScaledBeta.from_mode(modes, 8.0, -1.0, 1.0).entropy())

    def apart(mode: torch.Tensor, high: torch.Tensor) -> torch.Tensor:
        p, q = (ScaledBeta.from_mode(mode, k, -1.0, high, validate_args=False) for k in (8.0, 3.0))
        return kl_divergence(p, q)

    one_by_one = torch.stack([apart(mode, high) for mode, high in zip(modes, highs, strict=True)])
    assert torch.allclose(torch.vmap(apart)(modes, highs), one_by_one)


def test_a_uniform_number_of_zero_is_drawn_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch, "rand", lambda shape, **options: torch.zeros(shape, dtype=options["dtype"]))
    assert ScaledBeta(torch.full((9,), 0.5), 0.5, -1.0, 1.0).rsample_latent().isfinite().all()
