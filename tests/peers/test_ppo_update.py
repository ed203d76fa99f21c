"""One whole PPO update is stable-baselines3's, weight for weight.

What corresponds to what (stable-baselines3 2.9, `PPO.train`):

| Here                                        | There                                                              |
|---------------------------------------------|--------------------------------------------------------------------|
| `state_dependent_std=False`                 | always: one free `log_std` per dimension (its clip at 1 inactive)  |
| latent of `gaussian`, unit action           | the unclipped action; the same numbers where the box is [−1, 1]    |
| minibatch normalisation, Σ(Â − m)²/(B − 1)  | `Tensor.std`, the unbiased one; both add 1e-8 to the root          |
| `value_coef` · mean (V − R)²                | `vf_coef` · `mse_loss`                                             |
| `entropy_coef`, entropy of the Normal       | `ent_coef`, the same entropy                                       |
| `max_grad_norm` over both networks, a seed  | `clip_grad_norm_` over all parameters; both divide by norm + 1e-6  |
| one Adam for both networks, ε = 1e-5        | the same                                                           |
| a truncated step: V(final obs) in the TD    | γ V(final obs) added to the reward, and the step counted as done   |
| observations as they are                    | as they are (`VecNormalize` is the caller's business)              |
| no early stop by KL                         | `target_kl=None`                                                   |

Three seeds in lockstep are compared with three runs of the peer: the update of one seed is that of a solo run.
"""

import dataclasses

import numpy as np
import pytest
import torch

from inbounds.learning import ppo, preset
from tests.peers.peer import (
    ENV,
    hand_over,
    largest_difference,
    our_side,
    our_weights,
    ppo_settings,
    shuffler,
    their_side,
)

SEEDS = (0, 1, 2)


@pytest.fixture(scope="module")
def config():
    config = preset("common", ENV, policy="gaussian", seeds=SEEDS)
    return dataclasses.replace(
        config,
        policy=dataclasses.replace(config.policy, state_dependent_std=False),
        network=dataclasses.replace(config.network, dtype="float64"),
        algorithm=dataclasses.replace(config.algorithm, entropy_coef=0.01, learning_rate=1e-3),
        normalize_obs=False,
    )


@pytest.fixture(scope="module")
def their_kind():
    from stable_baselines3 import PPO

    return PPO


def test_advantages_are_the_peers(config, their_kind) -> None:
    trainer, rollout = our_side(config)
    advantage, return_ = rollout.advantages(config.algorithm.gamma, config.algorithm.gae_lambda)
    peer = their_side(their_kind, config)
    for s in SEEDS:
        hand_over(peer, trainer.networks, rollout, s)
        np.testing.assert_allclose(advantage[s], peer.rollout_buffer.advantages[:, 0], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(return_[s], peer.rollout_buffer.returns[:, 0], rtol=1e-9, atol=1e-9)


def test_ten_epochs_of_minibatches_move_every_weight_as_the_peer_does(config, their_kind) -> None:
    trainer, rollout = our_side(config)
    networks, algorithm = trainer.networks, config.algorithm
    before = [our_weights(networks, s) for s in SEEDS]
    peers = []
    for s in SEEDS:
        peer = their_side(
            their_kind,
            config,
            **ppo_settings(algorithm),
        )
        hand_over(peer, networks, rollout, s)
        np.random.set_state(shuffler(s).get_state())  # noqa: NPY002
        peer.train()
        peers.append(peer)

    diagnostics = ppo.update(networks, trainer.optimizer, rollout, [shuffler(s) for s in SEEDS], algorithm)

    assert (diagnostics["clip_fraction"] > 0.02).all()  # the clipped branch was at work
    for s in SEEDS:
        after = our_weights(networks, s)
        moved = max((after[name] - before[s][name]).abs().max().item() for name in after)
        assert moved > 0.02
        assert largest_difference(after, peers[s]) < 1e-9  # the requirement is 1e-5


def test_our_approximate_kl_is_the_peers(config, their_kind) -> None:
    """Both estimate KL by E[(r − 1) − log r]; the peer while it trains, we afterwards: equal for a step of length 0."""
    trainer, rollout = our_side(config)
    still = dataclasses.replace(config.algorithm, learning_rate=1e-30, num_epochs=1)
    peer = their_side(their_kind, dataclasses.replace(config, algorithm=still), n_epochs=1)
    hand_over(peer, trainer.networks, rollout, 0)
    with torch.no_grad():
        peer.policy.log_std += 0.1
        trainer.networks.actor.layers[-1].bias[:, trainer.networks.policy.act_dim :] += 0.1
    peer.train()
    optimizer = ppo.make_optimizer(trainer.networks, still)
    diagnostics = ppo.update(trainer.networks, optimizer, rollout, [shuffler(s) for s in SEEDS], still)
    theirs = peer.logger.name_to_value
    assert float(diagnostics["approx_kl"][0]) == pytest.approx(theirs["train/approx_kl"], rel=1e-9)
    assert float(diagnostics["clip_fraction"][0]) == pytest.approx(theirs["train/clip_fraction"], rel=1e-6)
