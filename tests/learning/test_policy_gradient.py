"""REINFORCE, and what clipping does to it: one step, one action, a gradient known by quadrature."""

import pytest
import torch

from inbounds.distributions import expectation, trapezoid
from inbounds.learning import FAMILIES, PolicyGradientConfig, Trainer, policy_gradient, ppo, preset, trpo
from inbounds.learning.families import NormalParameters
from tests.learning.point import PointEnv
from tests.learning.small import FAMILIES as NAMES
from tests.learning.small import small_config, small_run

N = 200_000
LOC, LOG_SCALE = 0.6, -0.2


def reward(action: torch.Tensor) -> torch.Tensor:
    return -(action + 0.4).square() + 0.5 * torch.sin(3 * action)


def true_gradient(family: str) -> torch.Tensor:
    """∇ E[reward(executed action)] in (loc, log_scale), by quadrature of the expected reward."""
    p = torch.tensor([LOC, LOG_SCALE], dtype=torch.float64, requires_grad=True)
    to_unit = FAMILIES[family].to_unit
    value = expectation(
        lambda z: reward(to_unit(z, torch).clamp(-1, 1)), p[0], p[1].exp(), trapezoid(200_001, 9.0)
    )
    return torch.autograd.grad(value, p)[0]


def one_step_gradients(family: str) -> torch.Tensor:
    """[N, 2] single-sample policy gradients."""
    p = NormalParameters(
        *(torch.full((N, 1), x, dtype=torch.float64, requires_grad=True) for x in (LOC, LOG_SCALE))
    )
    z = LOC + torch.tensor(LOG_SCALE).double().exp() * torch.randn(N, 1, dtype=torch.float64)
    action = FAMILIES[family].to_unit(z, torch).clamp(-1, 1)
    score = torch.autograd.grad(FAMILIES[family].law.log_prob(p, z).sum(), list(p))
    return torch.cat(score, 1) * reward(action)


@pytest.mark.parametrize("family", ["gaussian", "clipped-gaussian", "logit-normal"])
def test_the_policy_gradient_is_unbiased(family: str) -> None:
    gradients = one_step_gradients(family)
    error = gradients.std(0) / N**0.5
    assert ((gradients.mean(0) - true_gradient(family)).abs() < 4 * error).all()


@pytest.mark.parametrize("family", NAMES)
def test_the_loss_has_the_policy_gradient(family: str) -> None:
    trainer = Trainer(small_config("policy-gradient", family, dtype="float64", hidden=(4,)), PointEnv)
    rollout = trainer.collector.collect(32)
    nets, law = trainer.networks, trainer.networks.policy.law
    advantage = torch.randn(3, 32).double()
    loss = policy_gradient.loss(nets, rollout, advantage, entropy_coef=0.0)
    ours = torch.autograd.grad(loss, nets.actor.parameters)[-1]
    log_prob = law.log_prob(nets.parameters(rollout.obs), rollout.latent)
    for s in range(3):
        scores = [
            torch.autograd.grad(x, nets.actor.parameters[-1], retain_graph=True)[0][s] for x in log_prob[s]
        ]
        by_hand = sum(score * a for score, a in zip(scores, advantage[s], strict=True)) / 32
        assert torch.allclose(ours[s], -by_hand, rtol=1e-9)


def test_it_learns_and_takes_one_policy_step_per_epoch() -> None:
    run = small_run(
        small_config("policy-gradient", epochs=30, horizon=256, num_epochs=5, policy_learning_rate=1e-2)
    )
    first = sum(r["return_mean"].mean() for r in run.records[:3])
    last = sum(r["return_mean"].mean() for r in run.records[-3:])
    assert last > 0.8 * first
    steps = run.optimizer.actor.state_dict()["state"][0]["step"]
    assert steps == 30


def test_the_configuration_is_checked() -> None:
    with pytest.raises(ValueError, match="policy_learning_rate must be positive"):
        PolicyGradientConfig(policy_learning_rate=0.0)


@pytest.mark.parametrize("algorithm", [policy_gradient, ppo, trpo])
def test_a_rollout_that_minibatches_do_not_divide_changes_nothing(algorithm) -> None:
    name = algorithm.__name__.rpartition(".")[2].replace("_", "-")
    trainer = Trainer(preset("common", "Hopper-v5", algo=name, seeds=1))
    before = trainer.networks.actor.theta.clone()
    rollout, shuffles = trainer.collector.collect(100), [stream.shuffle for stream in trainer.streams]
    with pytest.raises(ValueError, match=r"100 = 1 × 64 \+ 36; 50 would"):
        algorithm.update(trainer.networks, trainer.optimizer, rollout, shuffles, trainer.config.algorithm)
    assert torch.equal(before, trainer.networks.actor.theta)
