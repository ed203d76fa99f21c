"""The pieces of the compiled update, each beside an oracle from elsewhere."""

import importlib
import math
from typing import Any

import mpmath
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import special

from inbounds.learning import RunningNormalizer, normalize_advantage
from inbounds.learning.families import beta_kernel, clipped_gaussian_kernel
from inbounds.learning.families.family import Limits
from inbounds.learning.families.policy import FAMILIES as BY_NAME
from inbounds.learning.networks import kernels
from inbounds.learning.networks.compiled_acting import CompiledActing
from inbounds.learning.networks.kernels import AdamNumbers, Net
from inbounds.learning.ppo import clipped_surrogate
from inbounds.learning.updates.kernels import Batch, normalize, surrogate_slope
from tests.learning.made_up import SHAPES, made_up_networks
from tests.learning.small import FAMILIES


def over(function: Any, x: np.ndarray) -> np.ndarray:
    return np.array([function(float(v)) for v in x])


def test_tanh_in_single_precision() -> None:
    x = np.concatenate([np.linspace(-12, 12, 400_001), np.geomspace(1e-30, 1, 10_001)]).astype(np.float32)
    y = x.copy()
    kernels.tanh(y)
    exact = np.tanh(x.astype(np.float64))
    assert np.abs(y - exact).max() < 4e-7
    assert np.abs(y / np.where(x == 0, 1, exact) - 1)[x != 0].max() < 6e-7
    assert np.abs(y).max() <= 1


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_tanh_keeps_what_is_not_finite(dtype: Any) -> None:
    x = np.array([np.nan, np.inf, -np.inf, 0.0], dtype)
    kernels.tanh(x)
    assert np.array_equal(x, [np.nan, 1, -1, 0], equal_nan=True)


SHAPE_PARAMETERS = np.concatenate([np.geomspace(1, 200, 300), [1.0, 2.0, 80.0, 160.0]])


@pytest.mark.parametrize(
    ("ours", "scipys"),
    [
        (beta_kernel.log_gamma, special.gammaln),
        (beta_kernel.digamma, special.digamma),
        (beta_kernel.trigamma, lambda x: special.polygamma(1, x)),
    ],
    ids=["log gamma", "digamma", "trigamma"],
)
def test_the_betas_functions(ours: Any, scipys: Any) -> None:
    found, expected = over(ours, SHAPE_PARAMETERS), scipys(SHAPE_PARAMETERS)
    assert np.allclose(found, expected, rtol=1e-13, atol=1e-12)


@pytest.mark.parametrize("raw", [-800.0, -30.0, -1.0, 0.0, 3.0, 19.9, 20.1, 78.9, 79.1, 1000.0])
def test_concentrations_are_softplus_capped(raw: float) -> None:
    x = torch.tensor(raw, dtype=torch.float64, requires_grad=True)
    expected = (1 + torch.nn.functional.softplus(x)).clamp(1.0, 80.0)
    (slope,) = torch.autograd.grad(expected, x)
    assert np.allclose(beta_kernel.concentration(raw, 80.0), (expected.item(), slope.item()), rtol=1e-12)


def test_a_concentration_of_nan_is_nan() -> None:
    assert np.isnan(beta_kernel.concentration(math.nan, 80.0)).all()


@pytest.mark.parametrize("t", [-1e4, -300.0, -40.0, -30.001, -29.999, -20.0, -5.0, -1.0, 0.0, 3.0, 9.0])
def test_the_tails_of_the_clipped_normal(t: float) -> None:
    with mpmath.workdps(40):
        log_cdf = mpmath.log(mpmath.erfc(-mpmath.mpf(t) / mpmath.sqrt(2)) / 2)
        slope = mpmath.exp(-(mpmath.mpf(t) ** 2) / 2 - log_cdf) / mpmath.sqrt(2 * mpmath.pi)
    assert clipped_gaussian_kernel.log_cdf(t) == pytest.approx(float(log_cdf), rel=1e-10)
    assert clipped_gaussian_kernel.log_cdf_slope(t) == pytest.approx(float(slope), rel=1e-9)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_laws_score_and_entropy_are_autograds(family: str) -> None:
    """Some outputs are beyond the limits, and some latents of the Normals outside the box."""
    law, kernel = BY_NAME[family].law, importlib.import_module(BY_NAME[family].kernels or "")
    limits, rng = Limits(log_std_min=-3.0), np.random.default_rng(0)
    outputs = np.concatenate([rng.normal(0, 1, (2, 40)), rng.uniform(-2, 1.5, (2, 40))])  # [2A, B]
    outputs[2:, :4] = [[-4.0, 2.0, -3.5, 90.0]] * 2
    latent = rng.uniform(0.01, 0.99, (2, 40)) if family == "beta" else rng.normal(0, 1.5, (2, 40))
    x = torch.from_numpy(outputs.T.copy()).requires_grad_()
    parameters = law.parameters(x, limits)
    log_prob = law.log_prob(parameters, torch.from_numpy(latent.T.copy()))
    (score,) = torch.autograd.grad(log_prob.sum(), x, retain_graph=True)
    (of_entropy,) = torch.autograd.grad(BY_NAME[family].entropy(parameters).sum(), x, allow_unused=True)
    told = limits.log_std_min, limits.log_std_max, limits.concentration_max
    found, slope, entropy_slope = np.zeros(40), np.zeros((4, 40)), np.zeros((4, 40))
    kernel.score(outputs, latent, told, found, slope)
    kernel.entropy_slope(outputs, told, entropy_slope)
    np.testing.assert_allclose(found, log_prob.detach(), rtol=1e-9)
    np.testing.assert_allclose(slope.T, score, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(entropy_slope.T, of_entropy, rtol=1e-9, atol=1e-9)


def batch_of(log_prob: np.ndarray, old: np.ndarray, advantage: np.ndarray) -> Batch:
    size, nothing = len(log_prob), np.zeros((1, 1), log_prob.dtype)
    return Batch(nothing, nothing, old.copy(), advantage.copy(), np.zeros(size), log_prob.copy(), nothing)


@settings(deadline=None, max_examples=60)
@given(st.lists(st.floats(-3, 3), min_size=1, max_size=20), st.floats(0.01, 0.9), st.integers(0, 10**6))
def test_the_slope_of_the_clipped_surrogate_is_autograds(ratios: list[float], clip: float, seed: int) -> None:
    log_prob = np.array(ratios)
    old, advantage = np.random.default_rng(seed).normal(0, [[0.3], [1.0]], (2, len(ratios)))
    distance = np.abs(np.abs(np.exp(log_prob - old) - 1) - clip)
    if (distance < 1e-9).any():
        return  # at the very bound the two might round to different sides
    x = torch.from_numpy(log_prob)[None].requires_grad_()
    objective = clipped_surrogate(x, torch.from_numpy(old)[None], torch.from_numpy(advantage)[None], clip)
    (expected,) = torch.autograd.grad(-objective.mean(), x)
    batch = batch_of(log_prob, old, advantage)
    surrogate_slope(batch, clip)
    assert np.allclose(batch.advantage, expected[0].numpy(), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("advantage", [1.0, -1.0, 0.0])
def test_the_slope_at_the_bound_of_the_clip(side: int, advantage: float) -> None:
    """At 1 ± ε the surrogate still has a slope, as autograd's clamp has it; just beyond it there may be none."""
    log_ratio = np.array([0.2 * side])
    ratio = math.exp(log_ratio[0])
    at = abs(ratio - 1)  # exact, and so is 1 ± at
    nearer = at - np.spacing(1.0)
    for clip, flat in ((at, False), (nearer, advantage * side > 0)):
        batch = batch_of(log_ratio, np.zeros(1), np.array([advantage]))
        surrogate_slope(batch, clip)
        assert batch.advantage[0] == (0 if flat else -ratio * advantage)


def test_a_ratio_or_an_advantage_of_nan_is_not_clipped_away() -> None:
    batch = batch_of(np.array([np.nan, 0.0, 5.0]), np.zeros(3), np.array([1.0, np.nan, np.nan]))
    surrogate_slope(batch, 0.2)
    assert np.isnan(batch.advantage).all()


def test_advantages_are_normalised_as_by_torch() -> None:
    advantage = np.random.default_rng(0).normal(5, 3, 64)
    expected = normalize_advantage(torch.from_numpy(advantage)).numpy()
    normalize(advantage)
    assert np.allclose(advantage, expected, rtol=1e-12)


def test_adam_is_torchs_over_many_steps() -> None:
    rng = np.random.default_rng(0)
    theta = rng.normal(size=16)
    reference = torch.from_numpy(theta.copy()).requires_grad_()
    optimizer = torch.optim.Adam([reference], 1e-2, eps=1e-5)
    nothing = np.zeros((1, 1))
    net = Net(theta, np.zeros(16), np.zeros(16), np.zeros(16), np.array([1]), nothing, nothing)
    for step in range(1, 30):
        gradient = rng.normal(0, 10.0 ** rng.integers(-4, 2), 16)
        net.gradient[:] = gradient
        kernels.descend((net,), AdamNumbers(1e-2, 1e-5, 0.5), step)
        reference.grad = torch.from_numpy(gradient.copy())
        norm = reference.grad.norm()
        reference.grad *= min(1.0, 0.5 / (norm.item() + 1e-6))
        optimizer.step()
    assert np.allclose(theta, reference.detach().numpy(), rtol=1e-10)


def test_statistics_of_observations_are_the_normalisers_to_the_last_bit() -> None:
    rng, networks = np.random.default_rng(0), made_up_networks("beta", (5, 2), "float32")
    acting = CompiledActing(networks)
    ours, theirs = RunningNormalizer(3, 5), RunningNormalizer(3, 5)
    for t in range(50):
        obs = rng.normal(7.0, 3.0, (3, 5))
        obs[2, 4] = np.nan if t > 40 else 1e9
        seen = acting.see(ours, obs)
        with np.errstate(invalid="ignore"):
            theirs.update(obs)
            expected = theirs(obs)
        assert np.array_equal(seen, expected, equal_nan=True)
        assert seen.dtype == expected.dtype
    assert np.array_equal(ours.squares, theirs.squares, equal_nan=True)
    assert ours.count == theirs.count


@pytest.mark.parametrize("shape", SHAPES)
def test_acting_is_numpys(shape: str) -> None:
    networks = made_up_networks("gaussian", SHAPES[shape], "float64")
    obs = np.random.default_rng(0).normal(size=(1, SHAPES[shape][0]))
    acting = CompiledActing(networks)
    assert np.allclose(acting.policy(obs), networks.actor.act(obs), rtol=1e-12, atol=1e-13)
    assert np.allclose(acting.value(obs), networks.critic.act(obs), rtol=1e-12, atol=1e-13)
