"""What PPO's clip does, and what it does not: the statements of the chapter on PPO, for the package."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from inbounds.learning import FAMILIES as LAWS
from inbounds.learning import ppo
from inbounds.learning.families import NormalParameters
from tests.learning.small import small_config, small_run, weights


def surrogate(ratio: torch.Tensor, advantage: torch.Tensor, clip_range: float) -> torch.Tensor:
    return ppo.clipped_surrogate(ratio.log(), torch.zeros_like(ratio), advantage, clip_range)


@settings(deadline=None, max_examples=60)
@given(st.floats(1e-3, 50), st.floats(-5, 5), st.floats(0.01, 0.9))
def test_the_surrogate_is_a_capped_gain(ratio: float, advantage: float, clip_range: float) -> None:
    r, a = (torch.tensor([[x]], dtype=torch.float64) for x in (ratio, advantage))
    r.requires_grad_()
    value = surrogate(r, a, clip_range)
    assert value.item() == pytest.approx(min(ratio * advantage, advantage + clip_range * abs(advantage)))
    assert value.item() <= ratio * advantage + 1e-12 * abs(ratio * advantage)
    assert value.item() - advantage <= clip_range * abs(advantage) + 1e-12
    past = math.copysign(1, advantage) * (ratio - 1) - clip_range
    if abs(past) > 1e-9:  # not on the corner
        (slope,) = torch.autograd.grad(value.sum(), r)
        assert slope.item() == pytest.approx(0.0 if past > 0 else advantage)


@pytest.mark.parametrize("family", LAWS)
def test_the_first_step_knows_no_clip_range(family: str) -> None:
    """One minibatch, one pass: the same weights to the last bit; with many they differ."""
    one = {"horizon": 128, "minibatch_size": 128, "num_epochs": 1, "epochs": 1}
    narrow, wide = (small_run(small_config(family=family, clip_range=eps, **one)) for eps in (0.02, 0.2))
    assert torch.equal(weights(narrow), weights(wide))
    many = {"horizon": 128, "num_epochs": 5, "epochs": 1, "learning_rate": 1e-2}
    narrow, wide = (small_run(small_config(family=family, clip_range=eps, **many)) for eps in (0.02, 0.2))
    assert not torch.equal(weights(narrow), weights(wide))


@pytest.mark.parametrize("clip_range", [0.02, 0.2])
def test_at_its_maximum_the_surrogate_bounds_neither_ratio_nor_divergence(clip_range: float) -> None:
    """Two states share a weight w: μ = w φ. The maximum is at w = b, wherever φ(A) = K puts the ratio and the KL."""
    b = math.sqrt(math.log(1 + clip_range))
    w = torch.linspace(-0.5, 1.5, 200_001, dtype=torch.float64)[:, None]
    for k in (2.0, 5.0, 12.0):
        features = torch.tensor([k, 1.0], dtype=torch.float64)
        log_ratio = b * features * w * features - (w * features) ** 2 / 2
        objective = ppo.clipped_surrogate(
            log_ratio, torch.zeros_like(log_ratio), torch.ones(2), clip_range
        ).mean(1)
        best = int(objective.argmax())
        assert w[best].item() == pytest.approx(b, abs=1e-4)
        assert log_ratio[best, 0].item() == pytest.approx(k**2 / 2 * math.log(1 + clip_range), rel=1e-4)
        assert log_ratio[best, 1].exp() < 1 + clip_range  # never clipped
        old, new = (
            NormalParameters(mean[None, :, None], torch.zeros(1, 2, 1, dtype=torch.float64))
            for mean in (0 * features, w[best] * features)
        )
        divergence = LAWS["gaussian"].law.kl(old, new).mean().item()
        assert divergence == pytest.approx((k**2 + 1) / 4 * math.log(1 + clip_range), rel=1e-3)


@pytest.mark.parametrize(
    ("family", "most"), [("clipped-gaussian", 4), ("logit-normal", 2), ("beta", 2), ("gaussian", math.inf)]
)
def test_only_the_gaussians_bonus_has_no_end(family: str, most: float) -> None:
    """Entropies of unit actions: at most log 2 with a density, log 4 with two atoms; a Gaussian's grows with log σ."""
    first, second = (
        x.reshape(-1, 1) for x in torch.meshgrid(*[torch.linspace(-3, 3, 61)] * 2, indexing="ij")
    )
    if family == "beta":
        first, second = 1 + first.exp(), 1 + second.exp()
    entropy = LAWS[family].entropy(LAWS[family].law.named(first.double(), second.double()))
    if math.isfinite(most):
        assert (entropy < math.log(most) + 1e-3).all()  # the logit-normal's is quick, and right to 1e-3
    else:
        expected = second[:, 0].double() + math.log(2 * math.pi * math.e) / 2
        assert torch.allclose(entropy, expected)
