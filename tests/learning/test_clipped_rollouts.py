"""The gradient of a whole rollout: CAPG is the conditional mean of the plain estimate, if the environment is blind.

A rollout leaves open how far beyond a bound a clipped latent was. Latents drawn again under that condition are as
likely as those that were drawn, and rewards that see the clipped action alone do not change.
"""

import dataclasses

import pytest
import torch
from torch import Tensor

from inbounds.learning import Rollout, Trainer
from inbounds.learning.families import CLIPPED_NORMAL, NORMAL, NormalLaw
from inbounds.learning.networks.perceptron import flatten
from tests.learning.point import PointEnv
from tests.learning.small import small_config

REDRAWS = 400


@pytest.fixture(scope="module")
def trainer() -> Trainer:
    config = small_config(family="gaussian", seeds=2, horizon=64, dtype="float64")
    return Trainer(config, PointEnv)


@pytest.fixture(scope="module")
def rollout(trainer: Trainer) -> Rollout:
    return trainer.collector.collect(64)


def gradient(trainer: Trainer, rollout: Rollout, law: NormalLaw, latent: Tensor, advantage: Tensor) -> Tensor:
    """Return the policy gradient of each seed, `[S, P]`."""
    log_prob = law.log_prob(trainer.networks.parameters(rollout.obs), latent)
    weights = trainer.networks.actor.parameters
    return flatten(torch.autograd.grad((log_prob * advantage).sum(), weights))


def redraw(rollout: Rollout, generator: torch.Generator) -> Tensor:
    """Return latents `[S, T, A]` that clip to the same actions, by inversion of the tails."""
    loc, scale = rollout.parameters.loc, rollout.parameters.log_scale.exp()
    uniform = torch.rand(rollout.latent.shape, generator=generator, dtype=torch.float64)
    above = loc - scale * torch.special.ndtri(uniform * torch.special.ndtr((loc - 1) / scale))
    below = loc + scale * torch.special.ndtri(uniform * torch.special.ndtr((-1 - loc) / scale))
    z = rollout.latent
    return torch.where(z > 1, above, torch.where(z < -1, below, z))


def test_capg_is_the_mean_over_what_the_rollout_leaves_open(trainer: Trainer, rollout: Rollout) -> None:
    advantage, _ = rollout.advantages(0.99, 0.95)
    assert 0.2 < float((rollout.latent.abs() > 1).double().mean()) < 0.5
    capg = gradient(trainer, rollout, CLIPPED_NORMAL, rollout.latent, advantage)
    generator = torch.Generator().manual_seed(0)
    plain = torch.stack(
        [gradient(trainer, rollout, NORMAL, redraw(rollout, generator), advantage) for _ in range(REDRAWS)]
    )
    scatter = plain.var(0).sum(1)  # [S]
    assert bool((scatter > 0).all())
    distance = (plain.mean(0) - capg).square().sum(1)
    # Monte Carlo alone gives scatter / REDRAWS on average.
    assert bool((distance < 3 * scatter / REDRAWS).all())
    wrong = gradient(trainer, rollout, NORMAL, rollout.latent.clamp(-1, 1), advantage)
    assert bool(((plain.mean(0) - wrong).square().sum(1) > 10 * scatter / REDRAWS).all())


def test_a_charge_on_the_drawn_action_is_missed(trainer: Trainer, rollout: Rollout) -> None:
    """Rewards that see z beyond the box: the plain estimate moves with the redraw, and CAPG's mean is another."""
    generator = torch.Generator().manual_seed(1)
    bills, plain, capg = [], [], []
    for _ in range(REDRAWS):
        z = redraw(rollout, generator)
        bill = z.square().sum(-1)  # [S, T]
        bills.append(bill)
        plain.append(gradient(trainer, rollout, NORMAL, z, -bill))
        capg.append(gradient(trainer, rollout, CLIPPED_NORMAL, z, -bill))
    assert float(torch.stack(bills).var(0).max()) > 0
    gap = torch.stack(plain) - torch.stack(capg)
    error = (gap.var(0) / REDRAWS).sum(1).sqrt()
    length = gap.mean(0).norm(dim=1)
    assert bool((length > 5 * error).all())
    # The charge narrows the policy; CAPG sees a part of that only: the head's log-scale biases say so.
    outputs = 2 * trainer.networks.policy.act_dim
    log_scale_bias = slice(-outputs // 2, None)
    assert bool(
        (torch.stack(plain).mean(0)[:, log_scale_bias] < torch.stack(capg).mean(0)[:, log_scale_bias]).all()
    )


def test_a_replaced_latent_does_not_move_the_robot(rollout: Rollout) -> None:
    again = dataclasses.replace(rollout, latent=redraw(rollout, torch.Generator().manual_seed(2)))
    assert not torch.equal(again.latent, rollout.latent)
    torch.testing.assert_close(again.latent.clamp(-1, 1), rollout.latent.clamp(-1, 1))
    assert torch.equal(again.action, rollout.action)
