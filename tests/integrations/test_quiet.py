"""A quiet start: the untrained policy executes the standard deviation asked for, in every library."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from gymnasium import spaces
from gymnasium.wrappers import TransformAction
from sb3_contrib import TRPO
from scipy import integrate, stats
from stable_baselines3 import A2C, PPO, SAC
from tensordict import TensorDict
from torch import nn
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.modules import NormalParamExtractor

from inbounds.distributions import ClippedNormal, LogitNormal, ScaledBeta
from inbounds.integrations.quiet import quiet_scale
from inbounds.integrations.stable_baselines3 import LogitNormalPolicy, quiet_start
from inbounds.integrations.torchrl import bounded_actor, quiet_actor
from inbounds.learning import executed_std
from tests.integrations.tank import HIGH, LOW, Tank

HALF, MIDDLE = (HIGH - LOW) / 2, (HIGH + LOW) / 2


def square_mean(unit, scale: float) -> float:
    """E[u(z)²], z ~ N(0, σ²), by quadrature; the clip's kinks are told to it."""
    kinks = {"points": (-1, 1)} if unit is clipped else {}
    reach = 9 * scale
    return integrate.quad(
        lambda z: unit(z) ** 2 * stats.norm.pdf(z, 0, scale), -reach, reach, limit=200, **kinks
    )[0]


def clipped(z: float) -> float:
    return float(np.clip(z, -1, 1))


@pytest.mark.parametrize("std", [0.1, 0.4, 0.55])
@pytest.mark.parametrize(("law", "unit"), [(LogitNormal, lambda z: np.tanh(z / 2)), (ClippedNormal, clipped)])
def test_the_scale_gives_the_noise(law, unit, std) -> None:
    assert square_mean(unit, quiet_scale(law, std)) ** 0.5 == pytest.approx(std, abs=1e-6)


def test_it_is_the_packages_own_inverse() -> None:
    for law, family in ((LogitNormal, "logit-normal"), (ClippedNormal, "gaussian")):
        assert executed_std(family, quiet_scale(law, 0.3)) == pytest.approx(0.3, abs=1e-6)


@pytest.mark.parametrize("algorithm", [PPO, A2C, TRPO])
@pytest.mark.parametrize("policy", ["MlpPolicy", LogitNormalPolicy])
def test_models_of_the_peer_start_so_in_a_lopsided_box(algorithm, policy) -> None:
    model = quiet_start(algorithm(policy, Tank(), n_steps=128, device="cpu", seed=1), 0.4)
    actions, _ = model.predict(np.zeros((40_000, 2), np.float32), deterministic=False)
    spread = np.sqrt((((actions - MIDDLE) / HALF) ** 2).mean(0))
    assert spread == pytest.approx([0.4, 0.4], abs=0.01)  # five standard errors
    with torch.no_grad():
        before = model.policy.log_std.clone()
    model.learn(256)
    assert not torch.equal(before, model.policy.log_std)  # still learned


@pytest.mark.parametrize("half", [0.001, 1.0, 50.0])
def test_the_size_of_the_box_does_not_matter(half: float) -> None:
    """Over observations that are not zero, too: the spread of μ has the box's units."""
    env = TransformAction(Tank(), lambda a: a, spaces.Box(-half, half, (2,)))
    model = quiet_start(PPO("MlpPolicy", env, n_steps=128, device="cpu", seed=1), 0.4)
    obs = np.random.default_rng(0).normal(size=(40_000, 2)).astype(np.float32)
    actions, _ = model.predict(obs, deterministic=False)
    assert (actions / half).std(0) == pytest.approx([0.4, 0.4], abs=0.01)


def test_a_second_call_sets_another_noise_and_nothing_else() -> None:
    env = TransformAction(Tank(), lambda a: a, spaces.Box(-100, 100, (2,)))
    model, again = (PPO("MlpPolicy", env, n_steps=128, device="cpu", seed=1) for _ in range(2))
    quiet_start(model, 0.3), quiet_start(quiet_start(again, 0.4), 0.3)
    for one, other in zip(model.policy.parameters(), again.policy.parameters(), strict=True):
        assert torch.equal(one, other)


def test_a_second_call_after_loading_does_not_scale_again(tmp_path: Path) -> None:
    env = TransformAction(Tank(), lambda a: a, spaces.Box(-100, 100, (2,)))
    model = quiet_start(PPO("MlpPolicy", env, n_steps=128, device="cpu", seed=1), 0.4)
    model.save(tmp_path / "model")
    loaded = quiet_start(PPO.load(tmp_path / "model", device="cpu"), 0.3)
    assert torch.equal(model.policy.action_net.weight, loaded.policy.action_net.weight)
    assert not torch.equal(model.policy.log_std, loaded.policy.log_std)


@pytest.mark.parametrize("policy", ["MlpPolicy", LogitNormalPolicy])
def test_what_has_been_learned_is_not_overwritten(policy) -> None:
    model = PPO(policy, Tank(), n_steps=128, device="cpu", seed=1).learn(128)
    with pytest.raises(ValueError, match=r"has learned \(128 steps here\): call it before `learn`"):
        quiet_start(model)
    heir = PPO(policy, Tank(), n_steps=128, device="cpu", seed=1)
    heir.set_parameters(model.get_parameters())
    with pytest.raises(ValueError, match="quiet_start is for an untrained policy"):
        quiet_start(heir)


@pytest.mark.parametrize("policy", ["MlpPolicy", LogitNormalPolicy])
def test_nor_is_what_another_model_has_learned(policy) -> None:
    """Its weights alone, without their optimiser."""
    model = PPO(policy, Tank(), n_steps=32, batch_size=32, device="cpu", seed=1).learn(32)
    heir = PPO(policy, Tank(), n_steps=32, batch_size=32, device="cpu", seed=1)
    heir.set_parameters({"policy": model.policy.state_dict()}, exact_match=False)
    with pytest.raises(ValueError, match="quiet_start is for an untrained policy"):
        quiet_start(heir)


def test_a_spread_set_by_hand_does_not_hide_the_boxs_size() -> None:
    env = TransformAction(Tank(), lambda a: a, spaces.Box(-0.001, 0.001, (2,)))
    model = PPO("MlpPolicy", env, n_steps=32, batch_size=32, device="cpu", seed=1)
    with torch.no_grad():
        model.policy.log_std.fill_(-1.0)
    quiet_start(model)
    obs = np.random.default_rng(0).normal(size=(40_000, 2)).astype(np.float32)
    actions, _ = model.predict(obs, deterministic=False)
    assert (actions / 0.001).std(0) == pytest.approx([0.4, 0.4], abs=0.01)


def test_a_first_spread_that_is_the_quiet_one_does_not_scale_twice() -> None:
    env = TransformAction(Tank(), lambda a: a, spaces.Box(-100, 100, (2,)))
    first = {"log_std_init": math.log(100 * quiet_scale(ClippedNormal, 0.4))}
    model = PPO("MlpPolicy", env, n_steps=128, device="cpu", seed=1, policy_kwargs=first)
    before = quiet_start(model).policy.action_net.weight.clone()
    assert torch.equal(before, quiet_start(model).policy.action_net.weight)


@pytest.mark.parametrize("std", [[0.4, 0.2], None, np.array([0.4, 0.2]), torch.tensor([0.4, 0.2])])
def test_a_spread_is_one_number(std) -> None:
    with pytest.raises(ValueError, match="std is one number, for all components"):
        quiet_start(PPO(LogitNormalPolicy, Tank(), n_steps=64, device="cpu"), std)
    for law in (LogitNormal, ScaledBeta):
        with pytest.raises(ValueError, match="std is one number, for all components"):
            quiet_actor(nn.Identity(), 2, law, LOW, HIGH, std)


@pytest.mark.parametrize("policy", ["MlpPolicy", LogitNormalPolicy])
def test_a_start_is_centred_whatever_the_bias_was(policy) -> None:
    model = PPO(policy, Tank(), n_steps=128, device="cpu", policy_kwargs={"ortho_init": False})
    with torch.no_grad():
        model.policy.action_net.weight.zero_()
    action, _ = quiet_start(model).predict(np.float32([0.3, 0.5]), deterministic=True)
    assert action == pytest.approx(MIDDLE)


def test_a_number_as_a_bound_does_not_say_how_many_actions_there_are() -> None:
    with pytest.raises(ValueError, match=r"give the \[A\] of each"):
        quiet_actor(nn.Linear(2, 8), 8, LogitNormal, -1.0, 1.0)


def test_a_quiet_actor_reads_several_names_and_takes_the_bodys_dtype() -> None:
    class Both(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.layer = nn.Linear(5, 8, dtype=torch.float64)

        def forward(self, place: torch.Tensor, speed: torch.Tensor) -> torch.Tensor:
            return self.layer(torch.cat([place, speed], -1)).tanh()

    for law in (LogitNormal, ScaledBeta):
        _, acting = quiet_actor(Both(), 8, law, LOW, HIGH, in_keys=("place", "speed"))
        seen = {"place": torch.zeros(4, 2).double(), "speed": torch.zeros(4, 3).double()}
        batch = acting(TensorDict(seen, batch_size=[4]))
        assert batch["action"].shape == (4, 2)
        assert batch["latent_log_prob"].dtype == torch.float64


def test_what_has_no_such_start_is_refused() -> None:
    with pytest.raises(ValueError, match="this policy has SACPolicy"):
        quiet_start(SAC("MlpPolicy", Tank(), device="cpu"))
    with pytest.raises(ValueError, match="StateDependentNoiseDistribution"):
        quiet_start(PPO("MlpPolicy", Tank(), use_sde=True, device="cpu"))
    with pytest.raises(ValueError, match="CategoricalDistribution"):
        quiet_start(PPO("MlpPolicy", "CartPole-v1", device="cpu"))
    for wrong in (PPO("MlpPolicy", Tank(), n_steps=64, device="cpu").policy, PPO):
        with pytest.raises(ValueError, match="takes a model that is set up"):
            quiet_start(wrong)
    with pytest.raises(ValueError, match=r"std=1.5 is out of reach: .* between .* and"):
        quiet_scale(ClippedNormal, 1.5)
    with pytest.raises(ValueError, match=r"not <class 'inbounds\.distributions\.scaled_beta\.ScaledBeta'>"):
        quiet_scale(ScaledBeta)  # type: ignore[arg-type]


def test_torchrls_extractor_starts_with_it() -> None:
    sigma = quiet_scale(LogitNormal, 0.4)
    last = nn.Linear(2, 4)
    nn.init.zeros_(last.weight), nn.init.zeros_(last.bias)
    network = nn.Sequential(last, NormalParamExtractor(scale_mapping=f"biased_softplus_{sigma}"))
    _, acting = bounded_actor(network, LogitNormal, LOW, HIGH)
    torch.manual_seed(0)
    with set_exploration_type(ExplorationType.RANDOM), torch.no_grad():
        action = acting(TensorDict(observation=torch.zeros(40_000, 2), batch_size=[40_000]))["action"]
    spread = np.sqrt((((action.numpy() - MIDDLE) / HALF) ** 2).mean(0))
    assert spread == pytest.approx([0.4, 0.4], abs=0.01)
