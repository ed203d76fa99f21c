"""The settings that *Which policy?* recommends, in the libraries themselves: trained briefly, they learn."""

import warnings
from collections.abc import Callable

import numpy as np
import pytest
import torch
from scipy import stats
from stable_baselines3 import PPO
from torch import nn

with warnings.catch_warnings():  # the library warns of its own deprecations while it is imported
    warnings.simplefilter("ignore")
    from tensordict import TensorDict
    from torchrl.envs.utils import ExplorationType, set_exploration_type
    from torchrl.modules import ValueOperator
    from torchrl.objectives import ClipPPOLoss

from inbounds.distributions import LogitNormal, ScaledBeta
from inbounds.integrations.stable_baselines3 import LogitNormalPolicy, quiet_start
from inbounds.integrations.stable_baselines3_beta import BetaPolicy
from inbounds.integrations.torchrl import quiet_actor
from tests.integrations.tank import HIGH, HORIZON, LOW, Tank

HALF, MIDDLE = (HIGH - LOW) / 2, (HIGH + LOW) / 2


def returns(act: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Returns of 40 episodes with starts of their own, the same at every call."""
    tank, found = Tank(), []
    for seed in range(40):
        obs, total = tank.reset(seed=seed)[0], 0.0
        for _ in range(HORIZON):
            obs, reward, *_ = tank.step(act(obs))
            total += reward
        found.append(total)
    return np.array(found)


def assert_improved(before: np.ndarray, after: np.ndarray) -> None:
    """Start by start, at one in a thousand, and by more than half of what was lost."""
    assert stats.ttest_rel(after, before, alternative="greater").pvalue < 1e-3
    assert after.mean() > before.mean() / 2


@pytest.mark.slow
@pytest.mark.parametrize("policy", ["MlpPolicy", LogitNormalPolicy, BetaPolicy])
def test_stable_baselines3_learns_from_a_quiet_start(policy) -> None:
    settings = {"n_steps": 512, "gamma": 0.9, "learning_rate": 1e-3, "device": "cpu", "seed": 0}
    model = quiet_start(PPO(policy, Tank(), **settings), 0.4)

    def act(obs: np.ndarray) -> np.ndarray:
        return model.predict(obs, deterministic=True)[0]

    before = returns(act)
    model.learn(10 * 512)
    assert_improved(before, returns(act))


def collect(acting, episodes: int, gamma: float) -> TensorDict:
    """Steps of whole episodes, with their returns to go."""
    tank, steps = Tank(), []
    for episode in range(episodes):
        obs = tank.reset(seed=10_000 + episode)[0]
        own = []
        for _ in range(HORIZON):
            step = acting(TensorDict(observation=torch.from_numpy(obs)[None], batch_size=[1]))
            obs, reward, *_ = tank.step(step["action"][0].numpy())
            own.append((step, reward))
        later = 0.0
        for step, reward in reversed(own):
            later = reward + gamma * later
            step["to_go"] = torch.tensor([[later]])
        steps += [step for step, _ in own]
    return torch.cat(steps)


@pytest.mark.slow
@pytest.mark.parametrize("law", [LogitNormal, ScaledBeta])
def test_torchrl_learns_from_a_quiet_start(law: type) -> None:
    torch.manual_seed(0)
    body = nn.Sequential(nn.Linear(2, 64), nn.Tanh())
    actor, acting = quiet_actor(body, 64, law, LOW, HIGH)
    critic = ValueOperator(nn.Sequential(nn.Linear(2, 64), nn.Tanh(), nn.Linear(64, 1)))
    loss = ClipPPOLoss(actor, critic, entropy_coeff=0.0)
    adam = torch.optim.Adam(loss.parameters(), lr=3e-3)

    @torch.no_grad()
    def act(obs: np.ndarray) -> np.ndarray:
        batch = TensorDict(observation=torch.from_numpy(obs)[None], batch_size=[1])
        with set_exploration_type(ExplorationType.DETERMINISTIC):
            return acting(batch)["action"][0].numpy()

    before = returns(act)
    for _ in range(10):
        with set_exploration_type(ExplorationType.RANDOM), torch.no_grad():
            batch = collect(acting, 32, gamma=0.9)
            advantage = batch["to_go"] - critic(batch.clone())["state_value"]
        batch["advantage"], batch["value_target"] = (
            (advantage - advantage.mean()) / advantage.std(),
            batch["to_go"],
        )
        for _ in range(10):
            terms = loss(batch.clone())
            adam.zero_grad()
            (terms["loss_objective"] + terms["loss_critic"]).backward()
            adam.step()
    assert_improved(before, returns(act))


@pytest.mark.parametrize("std", [0.02, 0.2, 0.4, 0.55])
@pytest.mark.parametrize("law", [LogitNormal, ScaledBeta])
def test_an_untrained_actor_executes_what_is_asked(law: type, std: float) -> None:
    torch.manual_seed(0)
    _, acting = quiet_actor(nn.Sequential(nn.Linear(2, 64), nn.Tanh()), 64, law, LOW, HIGH, std)
    with set_exploration_type(ExplorationType.RANDOM), torch.no_grad():
        action = acting(TensorDict(observation=torch.zeros(40_000, 2), batch_size=[40_000]))["action"].numpy()
    spread = np.sqrt((((action - MIDDLE) / HALF) ** 2).mean(0))
    assert spread == pytest.approx([std, std], abs=0.01)  # five standard errors and the small last layer


def test_what_cannot_be_started_is_refused() -> None:
    with pytest.raises(ValueError, match=r"std=0\.6 is out of reach"):
        quiet_actor(nn.Identity(), 2, ScaledBeta, LOW, HIGH, 0.6)
    with pytest.raises(ValueError, match=r"std=0\.004 is out of reach"):
        quiet_actor(nn.Identity(), 2, LogitNormal, LOW, HIGH, 0.004)
    with pytest.raises(ValueError, match="quiet_actor knows the laws"):
        quiet_actor(nn.Identity(), 2, torch.distributions.Normal, LOW, HIGH)  # type: ignore[arg-type]
