"""The Beta in stable-baselines3: it scores actions, stores latents, acts by its median, and starts quietly."""

from pathlib import Path

import numpy as np
import pytest
import torch
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st
from sb3_contrib import TRPO, RecurrentPPO
from scipy import special, stats
from stable_baselines3 import A2C, PPO, SAC
from stable_baselines3.common.distributions import kl_divergence

from inbounds.integrations.stable_baselines3 import LogitNormalActor, quiet_start
from inbounds.integrations.stable_baselines3_beta import BetaDistribution, BetaPolicy
from tests.integrations.tank import HIGH, LOW, Tank

HALF, MIDDLE = (HIGH - LOW) / 2, (HIGH + LOW) / 2
SMALL = {"device": "cpu", "seed": 3, "n_steps": 128}
OUTPUTS = [[0.7, -1.2, 0.3, 2.0]]


def law(outputs: list[list[float]]) -> BetaDistribution:
    return BetaDistribution(LOW, HIGH).proba_distribution(torch.tensor(outputs, dtype=torch.float64))


def betas(outputs: list[float]) -> list:
    """The same laws of the fraction of the way through the box, by SciPy."""
    alpha, beta = np.split(1 + np.logaddexp(0, outputs), 2)
    return [stats.beta(a, b) for a, b in zip(alpha, beta, strict=True)]


@settings(deadline=None, max_examples=25)
@given(z=st.tuples(*2 * [st.floats(-12, 12)]), outputs=st.tuples(*4 * [st.floats(-4, 6)]))
def test_a_latent_is_scored_as_its_action(z, outputs) -> None:
    latent = torch.tensor([z], dtype=torch.float64)
    ours = law([list(outputs)])
    action = ours.action(latent).numpy()[0]
    assert np.allclose(action, LOW + (HIGH - LOW) * special.expit(z), rtol=1e-6, atol=1e-6)
    width = np.log(np.float64(HIGH) - LOW)
    expected = sum(
        beta.logpdf(special.expit(each)) - log_length
        for beta, each, log_length in zip(betas(outputs), z, width, strict=True)
    )
    assert np.isclose(ours.log_prob(latent).item(), expected, rtol=1e-6, atol=1e-6)
    assert (action > LOW).all()
    assert (action < HIGH).all()


def test_entropy_is_that_of_the_action() -> None:
    expected = sum(beta.entropy() for beta in betas(OUTPUTS[0])) + np.log(np.float64(HIGH) - LOW).sum()
    assert law(OUTPUTS).entropy().item() == pytest.approx(expected, abs=1e-9)


def test_a_saturated_action_keeps_its_score() -> None:
    """In single precision, at latents whose actions are on the bound to the last bit."""
    outputs = torch.tensor(OUTPUTS, requires_grad=True)
    latent = torch.tensor([[30.0, -31.0]])
    ours = BetaDistribution(LOW, HIGH).proba_distribution(outputs)
    ours.log_prob(latent).sum().backward()
    alpha, beta = np.split(1 + np.logaddexp(0, OUTPUTS[0]), 2)
    towards_high = np.array([0.0, -31.0]) - special.digamma(alpha) + special.digamma(alpha + beta)
    towards_low = np.array([-30.0, 0.0]) - special.digamma(beta) + special.digamma(alpha + beta)
    score = np.concatenate([towards_high, towards_low]) * special.expit(OUTPUTS[0])
    np.testing.assert_allclose(outputs.grad, [score], rtol=1e-5)


def test_trpo_has_the_exact_divergence() -> None:
    p, q = law(OUTPUTS), law([[0.1, 0.3, 0.2, -0.5]])
    plain = [
        torch.distributions.Beta(d.distribution.concentration1, d.distribution.concentration0) for d in (p, q)
    ]
    assert torch.allclose(kl_divergence(p, q), torch.distributions.kl_divergence(*plain))


@pytest.mark.parametrize("algorithm", [PPO, A2C, TRPO])
def test_the_buffer_holds_latents_and_the_tank_gets_their_actions(algorithm) -> None:
    tank = Tank()
    fresh = algorithm(BetaPolicy, tank, **SMALL).policy.state_dict()
    model = algorithm(BetaPolicy, tank, **SMALL).learn(128)
    latent = model.rollout_buffer.actions.reshape(-1, 2).astype(np.float64)
    expected = LOW + (HIGH - LOW) * special.expit(latent)
    assert np.allclose(np.array(tank.asked[-128:]), expected, rtol=1e-5, atol=1e-6)
    assert latent.std() > 0.8  # not actions: α = β = 1 + log 2
    assert not torch.equal(fresh["action_net.weight"], model.policy.action_net.weight)  # learned
    assert not hasattr(model.policy, "log_std")  # which the peer would report


def test_deterministic_is_the_median_and_survives_the_disk(tmp_path: Path) -> None:
    model = PPO(BetaPolicy, Tank(), **SMALL).learn(128)
    with torch.no_grad():  # away from the middle, where mean, median and mode are one
        model.policy.action_net.bias += torch.tensor([5.0, -5.0, -5.0, 5.0])
    obs = np.float32([[0.3, 0.5], [-1.0, 0.0]])
    action, _ = model.predict(obs, deterministic=True)
    samples = model.predict(np.repeat(obs, 4000, 0))[0].reshape(2, 4000, 2)
    assert np.allclose((samples < action[:, None]).mean(1), 0.5, atol=0.04)
    model.save(tmp_path / "model")
    again, _ = PPO.load(tmp_path / "model", device="cpu").predict(obs, deterministic=True)
    assert np.array_equal(action, again)


@pytest.mark.parametrize("std", [0.1, 0.4, 0.57])
def test_it_starts_quietly_in_a_lopsided_box(std: float) -> None:
    model = quiet_start(PPO(BetaPolicy, Tank(), **SMALL), std)
    actions, _ = model.predict(np.zeros((40_000, 2), np.float32))
    spread = np.sqrt((((actions - MIDDLE) / HALF) ** 2).mean(0))
    assert spread == pytest.approx([std, std], abs=0.01)  # five standard errors
    again = quiet_start(model, 0.3).policy.action_net.bias.clone()
    other = quiet_start(PPO(BetaPolicy, Tank(), **SMALL), 0.3).policy.action_net.bias
    assert torch.equal(again, other)


def test_what_cannot_be_started_is_refused() -> None:
    model = PPO(BetaPolicy, Tank(), **SMALL)
    with pytest.raises(ValueError, match=r"std=0\.6 is out of reach: a Beta"):
        quiet_start(model, 0.6)
    with pytest.raises(ValueError, match="std is one number"):
        quiet_start(model, [0.4, 0.2])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="quiet_start is for an untrained policy"):
        quiet_start(model.learn(128))


def test_what_is_not_for_it_is_refused() -> None:
    with pytest.raises(ValueError, match="BetaPolicy draws its own noise"):
        PPO(BetaPolicy, Tank(), use_sde=True, device="cpu")
    with pytest.raises(ValueError, match="a Beta has no σ"):
        PPO(BetaPolicy, Tank(), policy_kwargs={"log_std_init": -1.0}, device="cpu")
    with pytest.raises(ValueError, match=r"gymnasium\.wrappers\."):
        BetaPolicy(Tank.observation_space, spaces.Discrete(3), lambda _: 1e-3)
    for peer in (SAC, RecurrentPPO):
        with pytest.raises(AttributeError, match="BetaPolicy is for A2C, PPO and TRPO"):
            peer(BetaPolicy, Tank(), device="cpu")
    model = PPO(BetaPolicy, Tank(), **SMALL)
    with pytest.raises(ValueError, match="gives NaN or ∞"):
        model.predict(np.float32([np.nan, 0]))
    with pytest.raises(ValueError, match="takes a LogitNormalPolicy"):
        LogitNormalActor(model.policy)  # type: ignore[arg-type]
