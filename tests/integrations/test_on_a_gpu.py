"""The laws in other libraries where these keep their networks when they find one: on a GPU."""

import io
import warnings

import numpy as np
import pytest
import torch
from sb3_contrib import TRPO
from stable_baselines3 import A2C, PPO
from torch import nn

with warnings.catch_warnings():  # the library warns of its own deprecations while it is imported
    warnings.simplefilter("ignore")
    from tensordict import TensorDict
    from torchrl.modules import ValueOperator
    from torchrl.objectives import ClipPPOLoss

from inbounds.distributions import LogitNormal, ScaledBeta
from inbounds.integrations.stable_baselines3 import LogitNormalPolicy, quiet_start
from inbounds.integrations.stable_baselines3_beta import BetaPolicy
from inbounds.integrations.torchrl import quiet_actor
from tests.integrations.tank import HIGH, LOW, Tank

pytestmark = [
    pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU that torch can use"),
    pytest.mark.filterwarnings("ignore:You are trying to run:UserWarning"),  # the peer prefers a CPU for this
]

OBS = np.float32([[0.3, 0.0], [-0.7, 0.5]])


@pytest.mark.parametrize("policy", ["MlpPolicy", LogitNormalPolicy, BetaPolicy])
@pytest.mark.parametrize("algorithm", [PPO, A2C, TRPO])
def test_stable_baselines3_learns_there(algorithm, policy) -> None:
    tank = Tank()
    model = quiet_start(algorithm(policy, tank, n_steps=128, seed=0, device="cuda"))
    start = model.predict(OBS, deterministic=True)[0]
    twin = quiet_start(algorithm(policy, Tank(), n_steps=128, seed=0, device="cpu"))
    twin.policy.load_state_dict(model.policy.state_dict())
    assert np.allclose(start, twin.predict(OBS, deterministic=True)[0], rtol=1e-4, atol=1e-5)
    model.learn(256)
    assert {p.device.type for p in model.policy.parameters()} == {"cuda"}
    asked = np.array(tank.asked)
    assert ((asked >= LOW) & (asked <= HIGH)).all()
    learned = model.predict(OBS, deterministic=True)[0]
    assert not np.allclose(learned, start, rtol=1e-4)
    kept = io.BytesIO()
    model.save(kept)
    kept.seek(0)
    assert np.allclose(
        algorithm.load(kept, device="cpu").predict(OBS, deterministic=True)[0], learned, rtol=1e-4, atol=1e-5
    )


@pytest.mark.parametrize("moved", [False, True], ids=["made there", "moved there"])
@pytest.mark.parametrize("law", [LogitNormal, ScaledBeta])
def test_torchrl_learns_there(law: type, moved: bool) -> None:
    torch.manual_seed(0)
    body = nn.Sequential(nn.Linear(2, 64), nn.Tanh())
    if moved:
        actor, acting = (module.to("cuda") for module in quiet_actor(body, 64, law, LOW, HIGH))
    else:
        low, high = (
            torch.from_numpy(bound).cuda() for bound in (LOW, HIGH)
        )  # as an environment there gives them
        actor, acting = quiet_actor(body.to("cuda"), 64, law, low, high)
    critic = ValueOperator(nn.Linear(2, 1)).to("cuda")
    loss = ClipPPOLoss(actor, critic)
    with torch.no_grad():
        batch = acting(TensorDict(observation=torch.rand(256, 2), batch_size=[256]).to("cuda"))
    action = batch["action"]
    assert action.device.type == "cuda"
    assert bool(
        (action > torch.from_numpy(LOW).cuda()).all() and (action < torch.from_numpy(HIGH).cuda()).all()
    )
    to_first = -action[:, :1]  # the lower the first valve, the better
    batch["advantage"], batch["value_target"] = to_first - to_first.mean(), to_first
    adam = torch.optim.Adam(loss.parameters(), lr=3e-3)
    for _ in range(20):
        terms = loss(batch.clone())
        adam.zero_grad()
        (terms["loss_objective"] + terms["loss_critic"] + terms["loss_entropy"]).backward()
        adam.step()
    with torch.no_grad():
        later = acting(TensorDict(observation=torch.rand(256, 2), batch_size=[256]).to("cuda"))["action"]
    assert later[:, 0].mean() < action[:, 0].mean() - action[:, 0].std() / 16
