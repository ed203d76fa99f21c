import dataclasses

import pytest
import torch

from inbounds.learning import PPOConfig, Trainer, policy_gradient, ppo
from inbounds.learning.updates.minibatches import Minibatch
from tests.learning.point import PointEnv
from tests.learning.small import FAMILIES, small_config, small_run, weights


def started(family: str = "gaussian", **options) -> tuple:
    """A trainer, its first rollout and that rollout as one minibatch."""
    trainer = Trainer(small_config("ppo", family, dtype="float64", **options), PointEnv)
    rollout = trainer.collector.collect(128)
    advantage, return_ = rollout.advantages(0.99, 0.95)
    batch = Minibatch(rollout.obs, rollout.latent, rollout.log_prob, advantage, return_)
    return trainer, rollout, batch


@pytest.mark.parametrize("family", FAMILIES)
def test_the_first_gradient_is_the_policy_gradient(family: str) -> None:
    trainer, rollout, batch = started(family)
    nets = trainer.networks
    ours = torch.autograd.grad(ppo.loss(nets, batch, trainer.config.algorithm), nets.actor.parameters)
    vanilla = policy_gradient.loss(nets, rollout, batch.advantage, trainer.config.algorithm.entropy_coef)
    for a, b in zip(ours, torch.autograd.grad(vanilla, nets.actor.parameters), strict=True):
        assert torch.allclose(a, b, rtol=1e-9, atol=1e-12)


def test_clipping_removes_the_incentive_and_only_that() -> None:
    log_ratio = torch.tensor([[-0.5, -0.1, 0.1, 0.5]], dtype=torch.float64, requires_grad=True)
    for sign, flat in ((1.0, [False, False, False, True]), (-1.0, [True, False, False, False])):
        advantage = torch.full((1, 4), sign, dtype=torch.float64)
        value = ppo.clipped_surrogate(log_ratio, torch.zeros_like(log_ratio), advantage, 0.2)
        (gradient,) = torch.autograd.grad(value.sum(), log_ratio)
        assert [g == 0 for g in gradient[0].tolist()] == flat


def test_the_loss_is_what_the_docstring_says() -> None:
    trainer, _, batch = started("beta", entropy_coef=0.1, clip_range=0.05)
    nets, config = trainer.networks, trainer.config.algorithm
    nets.actor.theta.add_(0.05 * torch.randn_like(nets.actor.theta))
    by_hand = 0.0
    for s in range(3):
        parameters = nets.parameters(batch.obs)
        law = torch.distributions.Beta(parameters.concentration1[s], parameters.concentration0[s])
        ratio = (law.log_prob(batch.latent[s]).sum(-1) - batch.log_prob[s]).exp()
        surrogate = torch.min(ratio * batch.advantage[s], ratio.clip(0.95, 1.05) * batch.advantage[s]).mean()
        entropy = (law.entropy() + torch.log(torch.tensor(2.0))).sum(-1).mean()
        error = (nets.values(batch.obs)[s] - batch.return_[s]).square().mean()
        by_hand = by_hand - (surrogate + 0.1 * entropy - 0.5 * error)
    assert torch.allclose(ppo.loss(nets, batch, config), by_hand, rtol=1e-9)


def test_no_seed_sees_anothers_gradient() -> None:
    trainer, _, batch = started()
    nets, config = trainer.networks, trainer.config.algorithm
    before = torch.autograd.grad(ppo.loss(nets, batch, config), nets.actor.parameters)
    nets.actor.theta[0] = torch.nan
    after = torch.autograd.grad(ppo.loss(nets, batch, config), nets.actor.parameters)
    for a, b in zip(before, after, strict=True):
        assert torch.equal(a[1:], b[1:])


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_it_learns(family: str) -> None:
    config = small_config("ppo", family, epochs=12, horizon=256, num_epochs=10, learning_rate=3e-3)
    run = small_run(config)
    first, last = run.records[0]["return_mean"].mean(), run.records[-1]["return_mean"].mean()
    assert last > 0.7 * first  # returns are negative: at least 30 % of the cost is gone
    assert (run.records[-1]["explained_variance"] > 0.3).all()


def test_without_an_incentive_nothing_moves() -> None:
    """No advantage, no entropy: the policy stays, to the last bit."""
    trainer, rollout, _ = started(entropy_coef=0.0, normalize_advantage=False)
    still = dataclasses.replace(
        rollout, reward=0 * rollout.reward, value=0 * rollout.value, bootstrap=0 * rollout.value
    )
    before = trainer.networks.actor.theta.clone()
    shuffles = [stream.shuffle for stream in trainer.streams]
    result = ppo.update(trainer.networks, trainer.optimizer, still, shuffles, trainer.config.algorithm)
    assert torch.equal(trainer.networks.actor.theta, before)
    assert not result["clip_fraction"].any()
    assert torch.allclose(result["kl"], torch.zeros(3).double(), atol=1e-12)


def test_diagnostics_measure_the_change() -> None:
    run = small_run(small_config(epochs=1, num_epochs=10, learning_rate=1e-2))
    record = run.records[0]
    assert (record["kl"] > 1e-3).all()
    assert ((record["clip_fraction"] > 0) & (record["clip_fraction"] < 1)).all()
    assert (abs(record["approx_kl"] - record["kl"]) < 0.5 * record["kl"]).all()


def test_steps_beyond_either_side_of_the_clip_are_counted() -> None:
    trainer = Trainer(small_config(epochs=1, num_epochs=10, learning_rate=1e-2, dtype="float64"), PointEnv)
    record, rollout = trainer.epoch(), trainer.rollout
    loc, log_scale = trainer.networks.parameters(rollout.obs)
    log_prob = torch.distributions.Normal(loc, log_scale.exp()).log_prob(rollout.latent).sum(-1)
    ratio = (log_prob - rollout.log_prob).exp()
    above, below = (ratio > 1.2).double().mean(1), (ratio < 0.8).double().mean(1)
    assert ((above > 0.05) & (below > 0.05)).all()
    assert record["clip_fraction"] == pytest.approx((above + below).detach().numpy(), abs=1e-12)


def test_gradient_clipping_changes_the_run_and_none_means_none() -> None:
    runs = [small_run(small_config(max_grad_norm=norm, epochs=1)) for norm in (None, 1e9, 0.01)]
    assert torch.equal(weights(runs[0]), weights(runs[1]))
    assert not torch.equal(weights(runs[0]), weights(runs[2]))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"minibatch_size": 60}, "2048 = 34 × 60"),
        ({"minibatch_size": 1}, "one advantage has no standard deviation"),
        ({"gamma": 1.1}, r"gamma must lie in \[0, 1\], got 1.1"),
        ({"clip_range": 0.0}, "clip_range must be positive"),
        ({"entropy_coef": -1.0}, "entropy_coef must not be negative"),
        ({"max_grad_norm": 0.0}, "max_grad_norm must be positive, or None"),
    ],
)
def test_the_configuration_is_checked(wrong: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        PPOConfig(**wrong)
