"""The logit-normal in stable-baselines3: it scores actions, stores latents, and is a Gaussian behind a sigmoid."""

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st
from sb3_contrib import TRPO, RecurrentPPO
from scipy import integrate, stats
from stable_baselines3 import A2C, PPO, SAC, TD3
from stable_baselines3.common.distributions import kl_divergence
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn

from inbounds.integrations.stable_baselines3 import (
    LogitNormalActor,
    LogitNormalDistribution,
    LogitNormalPolicy,
)
from tests.integrations.tank import HIGH, LOW, BehindSigmoid, Tank

SMALL = {"device": "cpu", "seed": 3, "n_steps": 128}


def law(loc: list[list[float]], log_std: list[float]) -> LogitNormalDistribution:
    found = LogitNormalDistribution(LOW, HIGH)
    return found.proba_distribution(
        torch.tensor(loc, dtype=torch.float64), torch.tensor(log_std, dtype=torch.float64)
    )


@settings(deadline=None, max_examples=25)
@given(
    z=st.tuples(*2 * [st.floats(-12, 12)]),
    loc=st.tuples(*2 * [st.floats(-3, 3)]),
    log_std=st.tuples(*2 * [st.floats(-2, 1)]),
)
def test_a_latent_is_scored_as_its_action(z, loc, log_std) -> None:
    latent = torch.tensor([z], dtype=torch.float64)
    ours = law([list(loc)], list(log_std))
    action = ours.action(latent).numpy()[0]
    unit = (action - LOW) / (HIGH - LOW)
    expected = 0.0  # change of variables, by SciPy
    for i in range(2):
        density = stats.norm.logpdf(z[i], loc[i], np.exp(log_std[i]))
        expected += density - np.log(unit[i]) - np.log(1 - unit[i]) - np.log(float(HIGH[i] - LOW[i]))
    assert np.isclose(ours.log_prob(latent).item(), expected, rtol=1e-5, atol=1e-5)
    assert (action > LOW).all()
    assert (action < HIGH).all()


def test_entropy_is_that_of_the_action() -> None:
    ours = law([[0.7, -1.2]], [0.0, 0.5])

    def surprise(z: float, i: int) -> float:
        at = torch.full((1, 2), z, dtype=torch.float64)
        each = ours.distribution.log_prob_latent(at)[0, i].item()
        return -each * stats.norm.pdf(z, (0.7, -1.2)[i], np.exp((0.0, 0.5)[i]))

    expected = sum(integrate.quad(surprise, -20, 20, args=(i,))[0] for i in range(2))
    assert ours.entropy().item() == pytest.approx(expected, abs=1e-6)


def test_a_saturated_action_keeps_its_score() -> None:
    """In single precision, at latents whose actions are on the bound to the last bit."""
    ours = LogitNormalDistribution(LOW, HIGH)
    loc = torch.tensor([[28.0, -28.0]], requires_grad=True)
    latent = torch.tensor([[30.0, -31.0]])
    ours.proba_distribution(loc, torch.zeros(2)).log_prob(latent).sum().backward()
    assert loc.grad is not None
    assert loc.grad.tolist() == [[2.0, -3.0]]  # (z − μ)/σ²


@pytest.mark.parametrize("algorithm", [PPO, A2C, TRPO])
def test_the_buffer_holds_latents_and_the_tank_gets_their_actions(algorithm) -> None:
    tank = Tank()
    model = algorithm(LogitNormalPolicy, tank, **SMALL).learn(128)
    latent = model.rollout_buffer.actions.reshape(-1, 2).astype(np.float64)
    expected = LOW + (HIGH - LOW) / (1 + np.exp(-latent))
    assert np.allclose(np.array(tank.asked[-128:]), expected, rtol=1e-5, atol=1e-6)
    assert latent.std() > 0.5  # not actions: σ starts at 1


@pytest.mark.parametrize("algorithm", [PPO, A2C])
def test_it_is_a_gaussian_behind_a_sigmoid(algorithm) -> None:
    """Without an entropy bonus both have one trajectory of weights, up to the rounding of the Jacobian."""
    ours = algorithm(LogitNormalPolicy, Tank(), ent_coef=0.0, **SMALL).learn(256)
    theirs = algorithm("MlpPolicy", BehindSigmoid(), ent_coef=0.0, **SMALL).learn(256)
    fresh = algorithm("MlpPolicy", BehindSigmoid(), ent_coef=0.0, **SMALL).policy.state_dict()
    for name, weight in theirs.policy.state_dict().items():
        moved = (weight - fresh[name]).abs().max()
        assert moved > 1e-4
        assert (ours.policy.state_dict()[name] - weight).abs().max() < 0.02 * moved, name


def test_trpo_has_the_exact_divergence() -> None:
    p, q = law([[0.7, -1.2]], [0.0, 0.5]), law([[0.1, 0.3]], [0.2, -0.5])
    normals = [torch.distributions.Normal(d.distribution.loc, d.distribution.scale) for d in (p, q)]
    expected = torch.distributions.kl_divergence(*normals)
    assert torch.allclose(kl_divergence(p, q), expected)
    before = TRPO(LogitNormalPolicy, Tank(), **SMALL).policy.state_dict()
    model = TRPO(LogitNormalPolicy, Tank(), **SMALL).learn(128)
    moved = (model.policy.state_dict()["action_net.weight"] - before["action_net.weight"]).abs().max()
    assert moved > 0


def test_deterministic_is_the_median_and_survives_the_disk(tmp_path) -> None:
    model = PPO(LogitNormalPolicy, Tank(), **SMALL).learn(128)
    with torch.no_grad():  # away from the middle, where mean, median and mode are one
        model.policy.action_net.bias += torch.tensor([1.0, -0.7])
    obs = np.float32([[0.3, 0.5], [-1.0, 0.0]])
    action, _ = model.predict(obs, deterministic=True)
    samples = model.predict(np.repeat(obs, 4000, 0))[0].reshape(2, 4000, 2)
    assert np.allclose((samples < action[:, None]).mean(1), 0.5, atol=0.04)
    assert action.dtype == np.float32
    model.save(tmp_path / "model")
    again, _ = PPO.load(tmp_path / "model", device="cpu").predict(obs, deterministic=True)
    assert np.array_equal(action, again)


@pytest.mark.parametrize(
    "space",
    [
        spaces.Discrete(3),
        spaces.Box(-1.0, 1.0, (2, 2)),
        spaces.Box(-np.inf, np.inf, (2,)),
        spaces.Box(0, 3, (2,), np.int64),
        spaces.Box(np.float32([-1, 2]), np.float32([1, 2])),
    ],
    ids=str,
)
def test_other_action_spaces_are_refused_with_the_fix(space: spaces.Space) -> None:
    with pytest.raises(ValueError, match=r"gymnasium\.wrappers\."):
        LogitNormalPolicy(Tank.observation_space, space, lambda _: 1e-3)


@pytest.mark.parametrize(
    ("low", "high", "wrong"),
    [
        (1.0, -1.0, "less than high"),
        (-1.0, np.inf, "finite"),
        (np.nan, 1.0, "finite"),
        (2.0, 2.0, "less than high"),
    ],
)
def test_an_impossible_box_is_refused_at_once(low: float, high: float, wrong: str) -> None:
    with pytest.raises(ValueError, match=wrong):
        LogitNormalDistribution(np.float32([-1.0, low]), np.float32([1.0, high]))


class Unwell(Tank):
    """A tank whose gauge breaks."""

    def _obs(self) -> np.ndarray:
        return super()._obs() if self.elapsed < 5 else np.float32([np.nan, 0.5])


def test_what_is_not_finite_is_no_action() -> None:
    model = PPO(LogitNormalPolicy, Unwell(), n_steps=64, device="cpu")
    with pytest.raises(
        ValueError, match="gives NaN or ∞: look for an observation or a reward that is not finite"
    ):
        model.learn(64)
    with pytest.raises(ValueError, match="gives NaN or ∞"):
        model.predict(np.float32([np.nan, 0]))
    with torch.no_grad():
        model.policy.log_std.fill_(np.inf)
    with pytest.raises(ValueError, match="gives NaN or ∞"):
        model.predict(np.zeros(2, np.float32))


def test_an_action_has_its_latent() -> None:
    policy = PPO(LogitNormalPolicy, Tank(), n_steps=64, device="cpu").policy
    latents = np.float32([[-3.0, 2.0], [0.0, 1.0]])
    actions = policy.unscale_action(latents)
    assert np.allclose(actions, LOW + (HIGH - LOW) / (1 + np.exp(-latents)), rtol=1e-6)
    assert np.allclose(policy.scale_action(actions), latents, atol=1e-5)


def test_its_noise_is_its_own() -> None:
    with pytest.raises(ValueError, match="leave use_sde=False"):
        PPO(LogitNormalPolicy, Tank(), use_sde=True, device="cpu")
    with pytest.raises(ValueError, match="squash_output=False"):
        PPO(LogitNormalPolicy, Tank(), policy_kwargs={"squash_output": True}, device="cpu")


@pytest.mark.parametrize("log_scale", [-200.0, 100.0])
def test_a_spread_beyond_the_numbers_is_named(log_scale: float) -> None:
    options = {"log_std_init": log_scale}
    model = PPO(LogitNormalPolicy, Tank(), n_steps=64, device="cpu", policy_kwargs=options)
    with pytest.raises(ValueError, match="no positive, finite σ: set log_std_init closer to 0"):
        model.policy(torch.zeros(1, 2))


@pytest.mark.parametrize("peer", [SAC, TD3, RecurrentPPO])
def test_who_learns_off_policy_is_told_so(peer: type) -> None:
    with pytest.raises(AttributeError, match="is for A2C, PPO and TRPO"):
        peer(LogitNormalPolicy, Tank(), device="cpu")


class Named(gymnasium.ObservationWrapper):
    """Pendulum, its observation in two parts."""

    def __init__(self) -> None:
        super().__init__(gymnasium.make("Pendulum-v1"))
        box = spaces.Box(-np.inf, np.inf, (2,), np.float32)
        self.observation_space = spaces.Dict({"direction": box, "speed": spaces.Box(-9.0, 9.0, (1,))})

    def observation(self, observation):
        return {"direction": observation[:2], "speed": observation[2:]}


def test_observations_may_have_names() -> None:
    model = PPO(LogitNormalPolicy, Named(), n_steps=32, batch_size=32, n_epochs=1, device="cpu").learn(32)
    obs, _ = Named().reset(seed=0)
    assert abs(model.predict(obs)[0]) < 2


class Seen(gymnasium.Env):
    """A camera's picture, channels last, whose brightness is what there is to see."""

    def __init__(self) -> None:
        self.observation_space = spaces.Box(0, 255, (36, 36, 3), np.uint8)
        self.action_space = spaces.Box(np.float32([0, -2]), np.float32([8, 1]))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.observation_space.sample(), {}

    def step(self, action):
        assert self.action_space.contains(action)
        return self.observation_space.sample(), 0.0, False, False, {}


class Scaled(Seen):
    """The same, scaled to [0, 1], channels first."""

    def __init__(self) -> None:
        super().__init__()
        self.observation_space = spaces.Box(0, 1, (3, 36, 36), np.float32)


@pytest.mark.parametrize("seen", [Seen, Scaled])
def test_observations_may_be_pictures(seen: type[Seen]) -> None:
    small = {"n_steps": 16, "batch_size": 16, "n_epochs": 1, "device": "cpu", "seed": 0}
    options = {"policy_kwargs": {"normalize_images": seen is Seen}}
    model = PPO(LogitNormalPolicy, seen(), **small, **options)
    peer = PPO("CnnPolicy", seen(), **small, **options)
    kinds = [type(each) for each in model.policy.modules() if not isinstance(each, LogitNormalPolicy)]
    assert kinds == [type(each) for each in list(peer.policy.modules())[1:]]
    model.learn(16)


def test_numbers_of_any_kind_are_mapped_and_actions_have_the_boxs_type() -> None:
    class Fine(Tank):
        action_space = spaces.Box(-0.3, 0.3, (2,), np.float64)

    model = PPO(LogitNormalPolicy, Fine(), **SMALL)
    assert not hasattr(model.policy, "actor")  # what asks for it is told why; see above
    assert model.predict(np.float32([0.3, 0.5]))[0].dtype == np.float64
    latents = np.array([1, -1])
    actions = model.policy.unscale_action(latents)
    assert np.allclose(actions, 0.3 * np.tanh(latents / 2))
    assert np.allclose(model.policy.scale_action(actions), latents)
    assert np.array_equal(model.policy.scale_action(np.zeros(2, int)), np.zeros(2))


@pytest.mark.parametrize("shared", [True, False])
def test_what_is_deployed_does_what_the_model_does(shared: bool) -> None:
    options = {"share_features_extractor": shared}
    model = PPO(LogitNormalPolicy, Tank(), policy_kwargs=options, **SMALL).learn(128)
    obs = np.random.default_rng(0).normal(size=(50, *Tank().observation_space.shape)).astype(np.float32)
    given = torch.from_numpy(obs)
    batch = {0: torch.export.Dim("batch", min=1, max=1024)}
    exported = torch.export.export(LogitNormalActor(model.policy), (given,), dynamic_shapes=(batch,))
    assert "nextafter" not in str(exported.graph)  # ONNX has no such operator
    deployed = exported.module()
    expected, _ = model.predict(obs, deterministic=True)
    np.testing.assert_array_equal(deployed(given).detach().numpy(), expected)
    one = model.predict(obs[0], deterministic=True)[0]
    np.testing.assert_array_equal(deployed(given[:1])[0].detach().numpy(), one)
    assert ((expected > LOW) & (expected < HIGH)).all()
    latents = model.policy(given, deterministic=True)[0]  # the trap: no actions
    assert not np.allclose(latents.detach().numpy(), expected)


class Forgetful(BaseFeaturesExtractor):
    """Dropout before the heads."""

    def __init__(self, space: spaces.Box) -> None:
        super().__init__(space, 16)
        self.net = nn.Sequential(nn.Linear(space.shape[0], 16), nn.Dropout(0.5))

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        return self.net(obs)


def test_what_is_deployed_after_learning_forgets_nothing() -> None:
    options = {"features_extractor_class": Forgetful}
    model = PPO(LogitNormalPolicy, Tank(), policy_kwargs=options, **SMALL).learn(128)
    with torch.no_grad():
        model.policy.action_net.weight.mul_(100)
        actor, obs = LogitNormalActor(model.policy), torch.ones(1, Tank().observation_space.shape[0])
        drawn = [actor(obs) for _ in range(3)]
    assert torch.equal(drawn[0], drawn[1])
    assert torch.equal(drawn[0], drawn[2])
    np.testing.assert_array_equal(drawn[0].numpy(), model.predict(obs.numpy(), deterministic=True)[0])


def test_another_policy_is_not_deployed() -> None:
    with pytest.raises(ValueError, match=r"takes a LogitNormalPolicy, as model\.policy"):
        LogitNormalActor(PPO("MlpPolicy", Tank(), **SMALL).policy)
