"""One TRPO update is sb3-contrib's, policy step and value regression, once the two meanings of KL are matched.

What corresponds to what (sb3-contrib 2.9, `TRPO.train`):

| Here                                    | There                                                                      |
|-----------------------------------------|----------------------------------------------------------------------------|
| KL summed over action dimensions A      | `kl_divergence(…).mean()` of a `Normal` that keeps its action axis: KL / A |
| `max_kl` δ                              | `target_kl` = δ / A                                                        |
| `damping` d, added to F                 | `cg_damping` = d / A, added to F / A                                       |
| KL(old‖new), as in the paper            | KL(new‖old)                                                                |
| conjugate gradients start at 0          | they start at 1e-4 · N(0, 1) noise; here made 0                            |
| `backtrack_coef`, `max_backtracks`      | `line_search_shrinking_factor`, `line_search_max_iter`                     |
| KL ≤ δ and the surrogate improves       | KL < δ and the surrogate improves                                          |
| advantages normalised over the rollout  | the same, with the unbiased deviation                                      |
| `entropy_coef=0`                        | no entropy bonus                                                           |
| Adam on the value network, no clipping  | Adam on all, the policy's gradients set to None, no clipping               |

At the old policy both directions of the KL have one Hessian, the Fisher information: gradient, search direction and
full step agree exactly. The directions differ in the line search only, to third order in the step: after the steps
below by one to two per cent of δ. Where both searches stop at the same length the new policies are equal; where they
do not, exchanging the peer's arguments makes them so. Both cases are tested, and so is how far the noise carries.
"""

import dataclasses

import numpy as np
import pytest
import torch

from inbounds.learning import preset, trpo
from tests.peers.peer import (
    ACT_DIM,
    ENV,
    hand_over,
    largest_difference,
    our_side,
    our_weights,
    shuffler,
    their_side,
    trpo_settings,
)

SEEDS = (0, 1, 2)


@pytest.fixture
def no_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """The peer's conjugate gradients start where ours do. Nothing else in its update draws with `randn_like`."""
    monkeypatch.setattr(torch, "randn_like", torch.zeros_like)


@pytest.fixture
def exchanged(monkeypatch: pytest.MonkeyPatch) -> None:
    """The peer measures KL(old‖new), as we do."""
    module = pytest.importorskip("sb3_contrib.trpo.trpo")
    theirs = module.kl_divergence
    monkeypatch.setattr(module, "kl_divergence", lambda new, old: theirs(old, new))


def make_config(**algorithm):
    config = preset("common", ENV, policy="gaussian", algo="trpo", seeds=SEEDS)
    numbers = {"entropy_coef": 0.0, "max_grad_norm": None, "learning_rate": 1e-3, "backtrack_coef": 0.8}
    return dataclasses.replace(
        config,
        policy=dataclasses.replace(config.policy, state_dependent_std=False),
        network=dataclasses.replace(config.network, dtype="float64"),
        algorithm=dataclasses.replace(config.algorithm, **numbers | algorithm),
        normalize_obs=False,
    )


def both(config):
    """Update both sides from one start; return our networks, our diagnostics and the peers."""
    from sb3_contrib import TRPO

    trainer, rollout = our_side(config)
    algorithm = config.algorithm
    shufflers, peers = [shuffler(s) for s in SEEDS], []
    for s in SEEDS:
        peer = their_side(
            TRPO,
            config,
            **trpo_settings(algorithm),
        )
        hand_over(peer, trainer.networks, rollout, s)
        np.random.set_state(shufflers[s].get_state())  # noqa: NPY002
        peer.train()
        shufflers[s].permutation(
            rollout.horizon
        )  # the peer shuffles the whole batch, too, before the policy's step
        peers.append(peer)
    diagnostics = trpo.update(trainer.networks, trainer.optimizer, rollout, shufflers, algorithm)
    return trainer.networks, diagnostics, peers


def their_kl(peer) -> float:
    """Return the KL divergence that the peer accepted, summed over action dimensions."""
    return ACT_DIM * peer.logger.name_to_value["train/kl_divergence_loss"]


@pytest.mark.usefixtures("no_noise")
def test_the_step_and_the_values_are_the_peers() -> None:
    """With the usual damping both line searches accept the full step, whatever the direction of their KL."""
    networks, diagnostics, peers = both(make_config())
    assert diagnostics["step_fraction"].tolist() == [1.0] * len(SEEDS)
    for s, kl in zip(SEEDS, diagnostics["kl"].tolist(), strict=True):
        assert largest_difference(our_weights(networks, s), peers[s]) < 1e-9  # the requirement is 1e-5
        assert 0 < abs(kl - their_kl(peers[s])) < 0.02 * 0.01


@pytest.mark.usefixtures("no_noise", "exchanged")
@pytest.mark.parametrize("max_kl", [0.01, 0.2])
def test_the_line_search_is_the_peers_under_the_papers_direction(max_kl: float) -> None:
    """Without damping the quadratic model spends δ in full, and the search has to shorten the step."""
    networks, diagnostics, peers = both(make_config(max_kl=max_kl, damping=1e-8))
    assert (diagnostics["step_fraction"] < 1).any()
    for s, kl in zip(SEEDS, diagnostics["kl"].tolist(), strict=True):
        assert largest_difference(our_weights(networks, s), peers[s]) < 1e-9
        assert kl == pytest.approx(their_kl(peers[s]), rel=1e-9)


@pytest.mark.usefixtures("no_noise")
def test_where_the_directions_disagree_the_peer_leaves_the_papers_trust_region() -> None:
    """Without damping KL(new‖old) ≤ δ < KL(old‖new) for some seed's full step: the peer takes it, we shorten it."""
    _, diagnostics, peers = both(make_config(damping=1e-8))
    shortened = [s for s in SEEDS if diagnostics["step_fraction"][s] < 1 and their_kl(peers[s]) > 0.0095]
    assert shortened
    assert all(diagnostics["kl"][s] < 0.8 * 0.01 < their_kl(peers[s]) < 0.01 for s in shortened)


def test_the_peers_starting_noise_is_all_that_is_left() -> None:
    """Ten iterations do not forget a start of 1e-4 · N(0, 1): some weights differ in the fifth decimal."""
    networks, _, peers = both(make_config())
    for s in SEEDS:
        assert 1e-7 < largest_difference(our_weights(networks, s), peers[s]) < 1e-3
