"""Several epochs of PPO, collecting included, are stable-baselines3's, when both draw the same random numbers.

The peer runs its own loop, `learn`, on Gymnasium's own robot: its rollouts, its episode ends, its optimiser from update
to update. It is given three things: the first weights, the actions that our policy drew, and the orders in which we
shuffled. So robots do not drift apart, and what is left to differ is arithmetic. Both robots execute single-precision
actions, as they always do; the peer also rounds rewards to single precision, which is what the tolerances allow for.
"""

import dataclasses

import gymnasium
import numpy as np
import pytest
import torch

from inbounds.learning import Trainer, preset
from inbounds.learning.seeding import SeedStreams
from tests.peers.peer import largest_difference, our_weights, ppo_settings, their_side

ENV, SEEDS, EPOCHS, HORIZON = "HalfCheetah-v5", (0, 1), 5, 448
"""Five rollouts that do not divide the robot's 1000 steps: two truncations, in mid-rollout."""


@pytest.fixture
def trained() -> tuple[Trainer, list, dict]:
    config = preset("common", ENV, policy="gaussian", seeds=SEEDS, epochs=EPOCHS)
    config = dataclasses.replace(
        config,
        policy=dataclasses.replace(config.policy, state_dependent_std=False),
        network=dataclasses.replace(config.network, dtype="float64"),
        algorithm=dataclasses.replace(config.algorithm, entropy_coef=0.0, horizon=HORIZON),
        normalize_obs=False,
    )
    trainer, rollouts = Trainer(config), []
    first = {seed: our_weights(trainer.networks, row) for row, seed in enumerate(SEEDS)}
    for _ in range(EPOCHS):
        trainer.epoch()
        rollouts.append(trainer.rollout)
    assert sum(int(rollout.truncated[0].sum()) for rollout in rollouts) == 2
    return trainer, rollouts, first


@pytest.mark.parametrize("row", range(len(SEEDS)))
def test_training_moves_every_weight_as_the_peers_does(
    trained, row: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    from stable_baselines3 import PPO
    from stable_baselines3.common.distributions import DiagGaussianDistribution

    trainer, rollouts, first = trained
    streams = SeedStreams.of(SEEDS[row])
    actions = iter(torch.cat([rollout.latent[row] for rollout in rollouts]))
    monkeypatch.setattr(DiagGaussianDistribution, "sample", lambda self: next(actions)[None].double())
    monkeypatch.setattr(np.random, "permutation", streams.shuffle.permutation)
    algorithm = trainer.config.algorithm
    peer = their_side(
        PPO,
        trainer.config,
        **ppo_settings(algorithm),
        env=gymnasium.wrappers.TransformAction(gymnasium.make(ENV), lambda a: a.astype(np.float32), None),
    )
    peer.policy.load_state_dict(first[SEEDS[row]])
    peer.env.seed(streams.environment)
    peer.learn(EPOCHS * HORIZON)

    last, seen = rollouts[-1], peer.rollout_buffer  # which its update has flattened
    np.testing.assert_allclose(last.obs[row], seen.observations.reshape(HORIZON, -1), rtol=0, atol=0)
    advantage, _ = last.advantages(algorithm.gamma, algorithm.gae_lambda)
    np.testing.assert_allclose(advantage[row], seen.advantages.ravel(), rtol=0, atol=1e-5)
    after = our_weights(trainer.networks, row)
    moved = max((after[name] - first[SEEDS[row]][name]).abs().max().item() for name in after)
    assert moved > 0.02
    assert largest_difference(after, peer) < 1e-7
