"""The pieces that PPO, TRPO and REINFORCE share: statistics, advantages, minibatches, Adam."""

import copy
import dataclasses
import threading

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.distributions import Normal, kl_divergence

from inbounds.learning import Mlp, RunningNormalizer, Trainer, gae, normalize_advantage
from inbounds.learning.config import ALGORITHMS
from inbounds.learning.networks.adam import SeedAdam, clip_gradients
from inbounds.learning.networks.perceptron import initialize_pytorch
from inbounds.learning.updates.diagnostics import diagnose
from inbounds.learning.updates.minibatches import minibatches
from inbounds.learning.updates.threads import one_thread
from tests.learning.point import PointEnv
from tests.learning.small import FAMILIES, rng, small_config, small_run


def test_running_statistics_are_those_of_the_whole_sample() -> None:
    data = rng().normal(3.0, 5.0, (200, 2, 4)) + 1e4
    normalizer = RunningNormalizer(2, 4, np.float64)
    for obs in data:
        normalizer.update(obs)
    assert np.allclose(normalizer.mean, data.mean(0), rtol=1e-12)
    assert np.allclose(normalizer.squares / 200, data.var(0), rtol=1e-8)
    assert np.allclose(normalizer(data[-1]), (data[-1] - data.mean(0)) / data.std(0), rtol=1e-6)
    assert (normalizer(data[-1] + 1e6) == 10.0).all()
    assert (normalizer(data[-1] - 1e6) == -10.0).all()


def test_a_normaliser_goes_back_to_its_state() -> None:
    a, b = RunningNormalizer(1, 2), RunningNormalizer(1, 2)
    a.update(np.array([[1.0, 2.0]]))
    b.load_state_dict(copy.deepcopy(a.state_dict()))
    for normalizer in (a, b):
        normalizer.update(np.array([[3.0, -2.0]]))
    assert np.array_equal(a(np.ones((1, 2))), b(np.ones((1, 2))))


def brute_force_gae(reward, value, terminated, truncated, bootstrap, gamma, lam):
    """The O(T²) sum of the definition, one step at a time."""
    T = len(reward)
    advantage = np.zeros(T)
    for t in range(T):
        for k in range(t, T):
            if terminated[k]:
                following = 0.0
            elif truncated[k] or k == T - 1:
                following = bootstrap[k]
            else:
                following = value[k + 1]
            advantage[t] += (gamma * lam) ** (k - t) * (reward[k] + gamma * following - value[k])
            if terminated[k] or truncated[k]:
                break
    return advantage


@settings(deadline=None, max_examples=40)
@given(st.integers(1, 12), st.floats(0, 1), st.floats(0, 1), st.integers(0, 10_000))
def test_gae_is_the_sum_that_defines_it(T: int, gamma: float, lam: float, seed: int) -> None:
    generator = rng(seed)
    reward, value, bootstrap = generator.normal(size=(3, 2, T))
    terminated, truncated = generator.random((2, 2, T)) < 0.2
    tensors = [torch.from_numpy(x) for x in (reward, value, terminated, truncated, bootstrap)]
    advantage, return_ = gae(*tensors, gamma, lam)
    for s in range(2):
        expected = brute_force_gae(reward[s], value[s], terminated[s], truncated[s], bootstrap[s], gamma, lam)
        assert np.allclose(advantage[s], expected, atol=1e-12)
    assert torch.allclose(return_, advantage + tensors[1])


def test_gae_of_a_poisoned_seed_stays_in_its_row() -> None:
    reward = torch.ones(2, 4)
    reward[0, 2] = torch.nan
    never = torch.zeros(2, 4, dtype=torch.bool)
    advantage, _ = gae(reward, 0 * reward.nan_to_num(), never, never, torch.zeros(2, 4), 0.9, 0.9)
    assert torch.isfinite(advantage[1]).all()


def test_advantages_are_normalised_per_row() -> None:
    advantage = (
        torch.randn(4, 3, 50, dtype=torch.float64) * torch.tensor([1.0, 10.0, 100.0]).double()[:, None] + 7
    )
    normalized = normalize_advantage(advantage)
    assert torch.allclose(normalized.mean(-1), torch.zeros(4, 3).double(), atol=1e-12)
    assert torch.allclose(normalized.std(-1), torch.ones(4, 3).double(), atol=1e-6)


def test_minibatches_hold_every_step_once_and_keep_rows_together() -> None:
    run = small_run(small_config(epochs=1))
    rollout = run.collector.collect(128)
    tag = torch.arange(3 * 128.0).view(3, 128)
    batches = list(minibatches(rollout, tag, -tag, 32, [rng(s) for s in range(3)]))
    assert len(batches) == 4
    tags = torch.cat([batch.advantage for batch in batches], 1)
    assert torch.equal(tags.sort(1).values, tag)
    assert not torch.equal(tags[0], tags[1] - 128)  # each seed in its own order
    for batch in batches:
        assert torch.equal(batch.return_, -batch.advantage)
        for s in range(3):
            steps = batch.advantage[s].long() - 128 * s
            assert torch.equal(batch.obs[s], rollout.obs[s, steps])
            assert torch.equal(batch.latent[s], rollout.latent[s, steps])
            assert torch.equal(batch.log_prob[s], rollout.log_prob[s, steps])
    again = list(minibatches(rollout, tag, tag, 32, [rng(s) for s in (5, 1, 6)]))
    assert torch.equal(again[0].advantage[1], batches[0].advantage[1])


def test_one_adam_on_the_rows_is_one_adam_per_seed() -> None:
    def network() -> Mlp:
        net = Mlp(3, (4, 8, 2), torch.float64)
        initialize_pytorch(net, [torch.Generator().manual_seed(s) for s in range(3)])
        return net

    together, reference = network(), network()
    adam = SeedAdam([together], 1e-2, 1e-5, max_grad_norm=0.5)
    singles = [[p[s].detach().clone().requires_grad_() for p in reference.parameters] for s in range(3)]
    adams = [torch.optim.Adam(single, 1e-2, eps=1e-5) for single in singles]
    scale = torch.tensor([0.01, 1.0, 100.0]).double()  # one seed below the clip, two above
    for step in range(5):
        obs = torch.randn(3, 6, 4, generator=torch.Generator().manual_seed(step), dtype=torch.float64)
        adam.minimize((together(obs).square().mean((1, 2)) * scale).sum())
        for s in range(3):
            h = obs[s].T
            (w1, b1, w2, b2) = singles[s]
            out = w2 @ torch.tanh(w1 @ h + b1) + b2
            adams[s].zero_grad()
            (out.square().mean() * scale[s]).backward()
            torch.nn.utils.clip_grad_norm_(singles[s], 0.5)
            adams[s].step()
    for s in range(3):
        expected = torch.cat([p.detach().flatten() for p in singles[s]])
        assert torch.allclose(together.theta[s], expected, rtol=1e-10, atol=1e-13)


def test_clipping_is_joint_over_networks_and_apart_for_seeds() -> None:
    a, b = torch.tensor([[3.0], [torch.nan], [0.1]]), torch.tensor([[4.0], [1.0], [0.2]])
    clip_gradients([a, b], 1.0)
    assert torch.cat([a, b], 1)[0].norm() == pytest.approx(1.0, rel=1e-5)
    assert torch.equal(torch.cat([a, b], 1)[2], torch.tensor([0.1, 0.2]))


@pytest.mark.parametrize("algo", ALGORITHMS)
@pytest.mark.parametrize("family", FAMILIES)
def test_where_no_action_is_better_the_bonus_raises_the_entropy(algo: str, family: str) -> None:
    config = small_config(algo, family, dtype="float64", entropy_coef=1.0)
    trainer = Trainer(config, PointEnv)
    nets, rollout = trainer.networks, trainer.collector.collect(128)
    nothing = torch.zeros_like(rollout.reward)
    still = dataclasses.replace(rollout, reward=nothing, value=nothing, bootstrap=nothing)
    before = nets.policy.family.entropy(rollout.parameters).mean(1)
    shuffles = [stream.shuffle for stream in trainer.streams]
    ALGORITHMS[algo][1].update(nets, trainer.optimizer, still, shuffles, config.algorithm)
    after = nets.policy.family.entropy(nets.parameters(rollout.obs)).mean(1)
    assert (after > before + 1e-4).all()


def test_diagnostics_are_those_of_two_known_laws() -> None:
    """Networks of biases alone: one Normal before the update, another after it, whatever the state."""
    trainer = Trainer(small_config(dtype="float64"), PointEnv)
    nets = trainer.networks
    nets.actor.theta.zero_()

    def law_of(*head: float) -> Normal:
        loc, log_scale = torch.tensor(head, dtype=torch.float64).view(2, 2)
        nets.actor.theta[:, -4:] = torch.cat([loc, log_scale])
        return Normal(loc, log_scale.exp())

    old = law_of(0.3, -0.2, 0.1, -0.4)
    rollout = trainer.collector.collect(128)
    new = law_of(0.1, 0.2, -0.5, 0.3)
    found, ratio = diagnose(nets, rollout, rollout.value)
    log_ratio = (new.log_prob(rollout.latent) - old.log_prob(rollout.latent)).sum(-1)
    assert torch.allclose(ratio, log_ratio.exp())
    assert torch.allclose(found["kl"], kl_divergence(old, new).sum())
    assert torch.allclose(found["approx_kl"], (log_ratio.exp() - 1 - log_ratio).mean(1))
    assert torch.allclose(found["entropy"], new.entropy().sum())
    assert not torch.isclose(kl_divergence(old, new).sum(), kl_divergence(new, old).sum(), rtol=0.1)


def test_overlapping_uses_of_one_thread_leave_as_many_as_there_were() -> None:
    """The second begins within the first and ends after it; a thread begun later has torch's number of the last end."""
    before, inside, over = torch.get_num_threads(), threading.Event(), threading.Event()
    found: list[int] = []

    def second() -> None:
        with one_thread(), one_thread():
            inside.set()
            over.wait(60)
            found.append(torch.get_num_threads())
        found.append(torch.get_num_threads())

    torch.set_num_threads(3)
    try:
        other = threading.Thread(target=second)
        with one_thread():
            other.start()
            inside.wait(60)
            assert torch.get_num_threads() == 1
        assert torch.get_num_threads() == 3
        over.set()
        other.join()
        later = threading.Thread(target=lambda: found.append(torch.get_num_threads()))
        later.start()
        later.join()
    finally:
        over.set()
        torch.set_num_threads(before)
    assert found == [1, 3, 3]
