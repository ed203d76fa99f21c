import math
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from torch.distributions import Beta, Normal, kl_divergence

from inbounds.distributions import ClippedNormal, LogitNormal, ScaledBeta
from inbounds.learning.families import (
    BETA,
    CLIPPED_NORMAL,
    NORMAL,
    BetaParameters,
    Limits,
    NormalParameters,
    Parameters,
)

LAWS = {"normal": NORMAL, "clipped": CLIPPED_NORMAL, "beta": BETA}
real = st.floats(-3, 3)
quick = settings(deadline=None, max_examples=25)


def parameters_of(law: str, a: float, b: float, n: int = 3) -> Parameters:
    """Parameters [n] from two numbers, different along the axis."""
    outputs = torch.tensor([a, b], dtype=torch.float64).repeat_interleave(n)
    outputs = outputs + torch.linspace(-0.3, 0.3, 2 * n, dtype=torch.float64)
    return LAWS[law].parameters(outputs, Limits())


def latents(law: str, n: int = 3) -> torch.Tensor:
    return torch.linspace(0.1, 0.9, n).double() if law == "beta" else torch.linspace(-2.0, 1.5, n).double()


@quick
@given(real, real)
def test_normal_log_prob_and_kl_are_torchs(a: float, b: float) -> None:
    p, q = parameters_of("normal", a, b), parameters_of("normal", b, a)
    ours, theirs = NORMAL.log_prob(p, latents("normal")), Normal(p.loc, p.log_scale.exp())
    assert torch.allclose(ours, theirs.log_prob(latents("normal")).sum(-1), rtol=1e-12)
    kl = kl_divergence(theirs, Normal(q.loc, q.log_scale.exp())).sum(-1)
    assert torch.allclose(NORMAL.kl(p, q), kl, rtol=1e-9, atol=1e-12)


@quick
@given(real, real)
def test_beta_log_prob_and_kl_are_torchs(a: float, b: float) -> None:
    p, q = parameters_of("beta", a, b), parameters_of("beta", b, a)
    assert torch.allclose(
        BETA.log_prob(p, latents("beta")), Beta(*p).log_prob(latents("beta")).sum(-1), rtol=1e-9
    )
    assert torch.allclose(BETA.kl(p, q), kl_divergence(Beta(*p), Beta(*q)).sum(-1), rtol=1e-7, atol=1e-9)


def test_clipped_law_scores_the_executed_action() -> None:
    p = parameters_of("clipped", 0.4, -0.2, n=4)
    z = torch.tensor([-7.0, -0.5, 0.9, 1.3], dtype=torch.float64)
    law = ClippedNormal(p.loc, p.log_scale.exp(), -1.0, 1.0)
    assert torch.allclose(CLIPPED_NORMAL.log_prob(p, z), law.log_prob(z.clamp(-1, 1)).sum(-1))
    assert CLIPPED_NORMAL.kl(p, parameters_of("clipped", 0.0, 0.0, n=4)) < NORMAL.kl(
        p, parameters_of("normal", 0.0, 0.0, n=4)
    )


@pytest.mark.parametrize("law", LAWS)
def test_kl_is_the_expected_log_ratio(law: str) -> None:
    p, q = parameters_of(law, 0.3, -0.4, n=1), parameters_of(law, -0.2, 0.1, n=1)
    rng = np.random.default_rng(0)
    draw = LAWS[law].sampler([rng], 200, 1000, np.float64)
    many = p.each(lambda x: np.full((1, 1000), x.item()))
    z = torch.from_numpy(np.stack([draw(many, t) for t in range(200)]).reshape(-1, 1))
    log_ratio = LAWS[law].log_prob(p, z) - LAWS[law].log_prob(q, z)
    error = log_ratio.std() / math.sqrt(len(log_ratio))
    assert abs(log_ratio.mean() - LAWS[law].kl(p, q)) < 4 * error


@pytest.mark.parametrize("law", LAWS)
def test_each_seed_draws_its_law_from_its_own_generator(law: str) -> None:
    p = parameters_of(law, 0.5, -0.5, n=2)
    both = p.each(lambda x: np.tile(x.numpy(), (2, 1)))

    def draws(seeds: tuple[int, int], dtype: type) -> np.ndarray:
        draw = LAWS[law].sampler([np.random.default_rng(s) for s in seeds], 2000, 2, dtype)
        cast = both.each(lambda x: x.astype(dtype))
        return np.stack([draw(cast, t) for t in range(2000)], 1)  # [S, T, A]

    sample = draws((1, 2), np.float64)
    for a in range(2):
        first, second = (x[a].item() for x in p)
        law_a = stats.beta(first, second) if law == "beta" else stats.norm(first, math.exp(second))
        assert stats.kstest(sample[0, :, a], law_a.cdf).pvalue > 1e-3
    other = draws((1, 3), np.float64)
    assert np.array_equal(sample[0], other[0])
    assert not np.array_equal(sample[1], other[1])
    assert draws((1, 2), np.float32).dtype == np.float32


def test_beta_latents_stay_inside_and_a_nan_seed_harms_no_other() -> None:
    extreme = BetaParameters(np.array([[80.0], [np.nan], [80.0]]), np.array([[1.0], [1.0], [1.0]]))
    draw = BETA.sampler([np.random.default_rng(s) for s in range(3)], 2000, 1, np.float32)
    sample = np.stack([draw(extreme, t) for t in range(2000)], 1)
    assert np.isnan(sample[1]).all()
    assert ((sample[[0, 2]] > 0) & (sample[[0, 2]] < 1)).all()
    rest = extreme.each(lambda x: x[[0, 2]])
    draw = BETA.sampler([np.random.default_rng(s) for s in (0, 2)], 2000, 1, np.float32)
    assert np.array_equal(sample[[0, 2]], np.stack([draw(rest, t) for t in range(2000)], 1))


@pytest.mark.parametrize("law", LAWS)
def test_parameters_agree_between_numpy_and_torch_and_respect_the_limits(law: str) -> None:
    outputs = torch.tensor([[-50.0, 0.0, 200.0, -50.0, 0.3, 200.0]], dtype=torch.float64)
    limits = Limits(log_std_min=-3.0, log_std_max=0.5, concentration_max=20.0)
    ours, acting = (
        LAWS[law].parameters(outputs, limits),
        LAWS[law].parameters(outputs.numpy(), limits, np),
    )
    for a, b in zip(ours, acting, strict=True):
        assert np.allclose(a.numpy(), b, rtol=1e-14)
    if law == "beta":
        assert torch.equal(ours.concentration1[0, [0, 2]], torch.tensor([1.0, 20.0]).double())
        assert abs(ours.concentration0[0, 1] - 1 - math.log1p(math.exp(0.3))) < 1e-12
    else:
        assert ours.log_scale[0].tolist() == [-3.0, pytest.approx(0.3), 0.5]


def test_the_hard_clip_of_log_std_has_no_gradient_outside() -> None:
    outputs = torch.tensor([0.0, 0.0, -11.0, 0.5], requires_grad=True)
    NORMAL.log_prob(NORMAL.parameters(outputs, Limits()), torch.ones(2)).backward()
    assert outputs.grad is not None
    assert outputs.grad[2] == 0
    assert outputs.grad[3] != 0


def test_latent_ratios_are_action_ratios() -> None:
    """What lets an algorithm see the law only: the map's Jacobian cancels."""
    p, q = parameters_of("normal", 0.3, -0.4), parameters_of("normal", -0.2, 0.1)
    z = latents("normal")
    p_action, q_action = (LogitNormal(x.loc, x.log_scale.exp(), -1.0, 1.0) for x in (p, q))
    action = torch.tanh(z / 2)
    expected = (p_action.log_prob(action) - q_action.log_prob(action)).sum()
    assert torch.allclose(NORMAL.log_prob(p, z) - NORMAL.log_prob(q, z), expected, rtol=1e-10)
    x = latents("beta")
    p, q = parameters_of("beta", 0.3, -0.4), parameters_of("beta", -0.2, 0.1)
    scaled = (ScaledBeta(*b, -1.0, 1.0).log_prob(2 * x - 1) for b in (p, q))
    first, second = (law.sum() for law in scaled)
    assert torch.allclose(BETA.log_prob(p, x) - BETA.log_prob(q, x), first - second, rtol=1e-10)


@pytest.mark.parametrize(
    "wrong",
    [
        {"log_std_min": 1.0, "log_std_max": 0.0},
        {"concentration_max": 1.0},
        {"concentration_max": np.inf},
        {"concentration_max": None},
        {"log_std_min": "x"},
    ],
    ids=str,
)
def test_limits_are_checked(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(wrong))} must"):
        Limits(**wrong)


def test_what_is_recorded_of_parameters() -> None:
    """Two seeds, one motor: quantiles by sorting, shares by counting."""
    loc = np.array([np.arange(-50.0, 51.0), np.zeros(101)])[:, :, None]  # [S, T, A]
    log_scale = np.array([np.linspace(-2.0, 1.0, 101), np.full(101, -2.0)])[:, :, None]
    told = NORMAL.describe(NormalParameters(loc, log_scale), Limits(log_std_min=-2.0, log_std_max=1.0))
    assert told["abs_loc_q50"].tolist() == [25.0, 0.0]
    assert told["abs_loc_q99"].tolist() == [50.0, 0.0]
    assert told["scale_q50"].tolist() == pytest.approx([math.exp(-0.5), math.exp(-2)])
    assert told["scale_q99"][0] == pytest.approx(math.exp(1.0 - 0.03))
    assert told["at_log_std_min"].tolist() == pytest.approx([1 / 101, 1.0])
    assert told["at_log_std_max"].tolist() == pytest.approx([1 / 101, 0.0])
    alpha, beta = 1 + np.abs(loc), np.full_like(loc, 3.0)
    told = BETA.describe(BetaParameters(alpha, beta), Limits(concentration_max=51.0))
    assert told["alpha_q50"].tolist() == [26.0, 1.0]
    assert told["beta_q99"].tolist() == [3.0, 3.0]
    assert told["at_alpha_max"].tolist() == pytest.approx([2 / 101, 0.0])
    assert told["at_beta_max"].tolist() == [0.0, 0.0]
