"""The laws of the book in TorchRL: losses read latents, environments get actions, and TanhNormal is an old friend."""

import math
import pickle
import warnings

import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn
from torch.distributions import kl_divergence

with warnings.catch_warnings():  # the library warns of its own deprecations while it is imported
    warnings.simplefilter("ignore")
    from tensordict import TensorDict
    from torchrl.envs import GymWrapper
    from torchrl.envs.utils import ExplorationType, set_exploration_type
    from torchrl.modules import NormalParamExtractor, TanhNormal, ValueOperator
    from torchrl.objectives import ClipPPOLoss, ReinforceLoss

from inbounds.distributions import ClippedNormal, LogitNormal, ScaledBeta
from inbounds.integrations.torchrl import PARAMETERS, Latents, bounded_actor, quiet_actor
from inbounds.robots import make
from tests.integrations.tank import HIGH, HORIZON, LOW, Tank

LAWS = (LogitNormal, ScaledBeta)
CHECKED_ARGUMENTS = False  # as TorchRL leaves it, and as its own distributions need it


class BetaHead(nn.Module):
    """α and β above one, as the book's Beta policies have them."""

    def forward(self, outputs: torch.Tensor) -> tuple[torch.Tensor, ...]:
        return tuple((1 + nn.functional.softplus(outputs)).chunk(2, -1))


class Given(nn.Module):
    """These outputs, whatever it sees."""

    def __init__(self, outputs: list[float]) -> None:
        super().__init__()
        self.outputs = nn.Parameter(torch.tensor(outputs))

    def forward(self, seen: torch.Tensor) -> tuple[torch.Tensor, ...]:
        return self.outputs.expand(len(seen), -1).chunk(2, -1)


def network(law: type) -> nn.Module:
    torch.manual_seed(0)
    head = NormalParamExtractor() if law is LogitNormal else BetaHead()
    return nn.Sequential(nn.Linear(2, 16), nn.Tanh(), nn.Linear(16, 4), head)


def observations(number: int) -> TensorDict:
    generator = torch.Generator().manual_seed(1)
    return TensorDict(observation=torch.randn(number, 2, generator=generator), batch_size=[number])


@pytest.mark.parametrize("law", LAWS)
def test_the_actor_scores_actions_and_the_environment_gets_them(law: type) -> None:
    _, acting = bounded_actor(network(law), law, LOW, HIGH)
    with torch.no_grad():
        batch = acting(observations(500))
    low, high = torch.from_numpy(LOW), torch.from_numpy(HIGH)
    assert (batch["latent"] - batch[PARAMETERS[law][0]]).std() > 0.1  # it draws, also where nobody says so
    expected = low + (high - low) * torch.sigmoid(batch["latent"])
    assert torch.allclose(batch["action"], expected, rtol=1e-5, atol=1e-5)
    first, second = (batch[name].double() for name in PARAMETERS[law])
    exact = law(first, second, low.double(), high.double(), validate_args=False)
    action = exact.latent_to_value(batch["latent"].double())
    assert torch.allclose(batch["latent_log_prob"].double(), exact.log_prob(action).sum(-1), atol=1e-3)


def test_the_network_may_read_other_names() -> None:
    module = network(LogitNormal)
    _, acting = bounded_actor(module, LogitNormal, LOW, HIGH, in_keys=("state",))
    given = observations(3)
    found = acting(TensorDict(state=given["observation"], batch_size=[3]))
    assert torch.equal(found["loc"], module(given["observation"])[0])


@pytest.mark.parametrize("law", LAWS)
def test_at_the_old_policy_the_loss_has_the_policy_gradient(law: type) -> None:
    actor, acting = bounded_actor(network(law), law, LOW, HIGH)
    critic = ValueOperator(nn.Linear(2, 1))
    with torch.no_grad():
        batch = acting(observations(64))
    batch["advantage"] = torch.randn(64, 1, generator=torch.Generator().manual_seed(2))
    batch["value_target"] = torch.zeros(64, 1)
    loss = ClipPPOLoss(actor, critic, entropy_coeff=0.01)
    found = loss(batch)
    assert found["clip_fraction"].item() == 0
    assert abs(found["kl_approx"].item()) < 1e-6
    parameters = list(loss.actor_network_params.values(True, True))
    gradient = torch.autograd.grad(found["loss_objective"], parameters)
    log_prob = actor.get_dist(batch).log_prob(batch["latent"])
    direct = torch.autograd.grad(-(batch["advantage"][:, 0] * log_prob).mean(), list(actor.parameters()))
    assert sum(g.abs().sum() for g in direct) > 0
    for ours, theirs in zip(sorted(gradient, key=_key), sorted(direct, key=_key), strict=True):
        assert torch.allclose(ours, theirs, atol=1e-6)
    entropy = actor.get_dist(batch).entropy().mean()  # exact: TorchRL need not sample for it
    assert torch.allclose(found["entropy"], entropy, atol=1e-5)


@pytest.mark.parametrize("law", LAWS)
def test_reinforce_scores_latents_once_it_is_told(law: type) -> None:
    actor, acting = bounded_actor(network(law), law, LOW, HIGH)
    with torch.no_grad():
        batch = acting(observations(64))
    batch["advantage"] = torch.randn(64, 1, generator=torch.Generator().manual_seed(2))
    batch["value_target"] = torch.zeros(64, 1)
    loss = ReinforceLoss(actor, ValueOperator(nn.Linear(2, 1)))
    assert loss.tensor_keys.action == "action"  # else the docstring need not speak of it
    loss.set_keys(action="latent")
    parameters = list(loss.actor_network_params.values(True, True))
    gradient = torch.autograd.grad(loss(batch)["loss_actor"], parameters)
    log_prob = actor.get_dist(batch).log_prob(batch["latent"])
    direct = torch.autograd.grad(-(batch["advantage"][:, 0] * log_prob).mean(), list(actor.parameters()))
    for ours, theirs in zip(sorted(gradient, key=_key), sorted(direct, key=_key), strict=True):
        assert torch.allclose(ours, theirs, atol=1e-6)


def _key(tensor: torch.Tensor) -> tuple:
    return tuple(tensor.shape)


@settings(deadline=None, max_examples=20)
@given(loc=st.floats(-3, 3), log_std=st.floats(-2, 1), latent=st.floats(-6, 6))
def test_torchrls_tanh_normal_is_the_logit_normal_of_twice_the_parameters(loc, log_std, latent) -> None:
    mu, sigma = torch.tensor([loc], dtype=torch.float64), torch.tensor([log_std], dtype=torch.float64).exp()
    low, high = (torch.tensor([float(bound[0])], dtype=torch.float64) for bound in (LOW, HIGH))
    ours = LogitNormal(mu, sigma, low, high)
    theirs = TanhNormal(mu / 2, sigma / 2, low=low, high=high)
    action = ours.latent_to_value(torch.tensor([latent], dtype=torch.float64))
    assert torch.allclose(theirs.log_prob(action), ours.log_prob(action).sum(), atol=1e-6)
    assert torch.allclose(theirs.deterministic_sample, ours.median, atol=1e-9)


def test_the_deterministic_latent_of_a_beta_is_finite_where_its_mean_rounds_to_a_bound() -> None:
    law = ScaledBeta(torch.tensor([0.7, 3e8]), torch.tensor([2.0, 1.0]), -1.0, 1.0)
    latent = Latents(law).deterministic_sample
    assert law.mean[1] == 1
    assert torch.allclose(latent, torch.tensor([0.35, 3e8]).log())


def test_a_saturated_action_keeps_its_score_only_in_its_latent() -> None:
    low, high = torch.from_numpy(LOW[:1]), torch.from_numpy(HIGH[:1])
    loc = torch.tensor([18.0], requires_grad=True)
    latents = Latents(LogitNormal(loc, torch.ones(1), low, high))
    (score,) = torch.autograd.grad(latents.log_prob(torch.tensor([20.0])), loc)
    assert score.item() == 2.0  # (z − μ)/σ²
    peer = TanhNormal(loc / 2, torch.full((1,), 0.5), low=low, high=high)
    action = latents.law.latent_to_value(torch.tensor([20.0])).detach()
    (score,) = torch.autograd.grad(peer.log_prob(action), loc)
    assert abs(score.item() - 2.0) > 0.5  # read back from the rounded action


@pytest.mark.parametrize("law", LAWS)
def test_a_rollout_in_a_batch_of_environments(law: type) -> None:
    """Latents, actions in the box, and the *final* observation where an episode ends, not that of the reset."""
    tanks = SyncVectorEnv(3 * [Tank], autoreset_mode=AutoresetMode.SAME_STEP)
    env = GymWrapper(tanks)
    env.set_seed(0)
    _, acting = bounded_actor(network(law), law, LOW, HIGH)
    with torch.no_grad():
        batch = env.rollout(3 * HORIZON, acting, break_when_any_done=False)
    asked = np.stack([tank.asked[-3 * HORIZON :] for tank in tanks.envs])
    assert np.array_equal(batch["action"].numpy(), asked)
    assert (asked > LOW).all()
    assert (asked < HIGH).all()
    over = batch["next", "truncated"][..., 0]
    assert over.sum() == 9
    assert not batch["next", "terminated"].any()
    assert (batch["next", "observation"][over][:, 1] == 1).all()  # the clock at the end of an episode
    assert (batch["observation"][:, HORIZON, 1] == 0).all()


@pytest.mark.parametrize("law", LAWS)
def test_an_actor_can_be_saved(law: type) -> None:
    _, acting = bounded_actor(network(law), law, LOW, HIGH)
    again = pickle.loads(pickle.dumps(acting))
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        assert torch.equal(again(observations(5))["action"], acting(observations(5))["action"])


def test_a_mean_of_latents_is_refused() -> None:
    _, acting = bounded_actor(network(LogitNormal), LogitNormal, LOW, HIGH)
    with set_exploration_type(ExplorationType.MEAN), pytest.raises(ValueError, match="no mean of actions"):
        acting(observations(5))
    with set_exploration_type(ExplorationType.MODE), pytest.raises(ValueError, match="no mode of actions"):
        acting(observations(5))


def test_a_median_is_that_of_the_actions() -> None:
    actor, acting = bounded_actor(network(LogitNormal), LogitNormal, LOW, HIGH)
    with torch.no_grad(), set_exploration_type(ExplorationType.MEDIAN):
        batch = acting(observations(5))
    assert torch.allclose(batch["action"], actor.get_dist(batch).law.median)
    actor, acting = bounded_actor(network(ScaledBeta), ScaledBeta, LOW, HIGH)
    with torch.no_grad(), set_exploration_type(ExplorationType.MEDIAN):
        batch = acting(observations(5))
    assert torch.allclose(batch["action"], actor.get_dist(batch).law.median)


def test_the_packages_own_robots_are_an_environment_there() -> None:
    """The observation that ends an episode is the old episode's; the next one starts within the noise of a reset."""
    env = GymWrapper(make("Swimmer-v5", 3, max_episode_steps=20))
    env.set_seed(0)
    box = env.single_action_space
    body = nn.Sequential(nn.Linear(8, 8, dtype=torch.float64), nn.Tanh())
    _, acting = quiet_actor(body, 8, LogitNormal, box.low, box.high)
    with torch.no_grad():
        batch = env.rollout(61, acting, break_when_any_done=False)
    assert batch["action"].abs().max() < 1
    over = batch["next", "truncated"][..., 0]
    assert over.nonzero()[:, 1].tolist() == 3 * [19, 39, 59]
    assert (batch["next", "observation"][over].abs().amax(-1) > 0.2).all()
    assert (batch["observation"][:, [0, 20, 40, 60]].abs() <= 0.1).all()


@pytest.mark.parametrize("law", LAWS)
def test_acting_without_noise(law: type) -> None:
    actor, acting = bounded_actor(network(law), law, LOW, HIGH)
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        batch = acting(observations(5))
    exact = actor.get_dist(batch).law
    centre = exact.median if law is LogitNormal else exact.mean
    assert torch.allclose(batch["action"], centre, atol=1e-4)


@pytest.mark.parametrize("law", LAWS)
def test_the_divergence_is_exact(law: type) -> None:
    first, second = torch.tensor([[1.5, 2.0]]), torch.tensor([[1.2, 3.0]])
    p, q = (law(a, b, LOW, HIGH) for a, b in ((first, second), (second, first)))
    assert torch.allclose(kl_divergence(Latents(p), Latents(q)), kl_divergence(p, q).sum(-1))


@pytest.mark.parametrize("law", LAWS)
def test_a_network_of_another_size_is_refused(law: type) -> None:
    """It would be broadcast: one law for all components."""
    _, acting = bounded_actor(network(law), law, [-1.0, -2.0, -3.0], [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="parameters of 2 components, and the box has 3: it needs 6 outputs"):
        acting(observations(4))


@pytest.mark.parametrize(
    ("law", "outputs", "wrong"),
    [
        (
            LogitNormal,
            [0.0, 0.0, 1.0, -0.1],
            "a scale that is not positive: let it end in softplus, or take quiet_actor",
        ),
        (ScaledBeta, [1.0, 0.0, 1.0, 1.0], "a concentration1 that is not positive"),
        (ScaledBeta, [1.0, 1.0, -1.0, 1.0], "a concentration0 that is not positive"),
        (LogitNormal, [math.nan, 0.0, 1.0, 1.0], "NaN or ∞ for loc: look for an observation or a reward"),
        (ScaledBeta, [1.0, 1.0, math.inf, 1.0], "NaN or ∞ for concentration0"),
    ],
)
def test_parameters_that_make_no_law_are_refused(law: type, outputs: list[float], wrong: str) -> None:
    _, acting = bounded_actor(Given(outputs), law, [0.0, -2.0], [8.0, 1.0])
    with pytest.raises(ValueError, match=wrong):
        acting(observations(5))


def test_other_laws_are_refused() -> None:
    with pytest.raises(ValueError, match="LogitNormal and ScaledBeta"):
        bounded_actor(network(LogitNormal), ClippedNormal, LOW, HIGH)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    ("low", "high", "wrong"),
    [
        (1.0, -1.0, "less than high"),
        (-1.0, np.inf, "finite"),
        (np.nan, 1.0, "finite"),
        (2.0, 2.0, "less than high"),
        (1e9, 1e9 + 64, "lies strictly between"),
    ],
)
def test_an_impossible_box_is_refused_at_once(law: type, low: float, high: float, wrong: str) -> None:
    """Although TorchRL has switched off the checks of every distribution."""
    with pytest.raises(ValueError, match=wrong):
        bounded_actor(network(law), law, [-1.0, low], [1.0, high])


@pytest.mark.parametrize("law", LAWS)
def test_a_box_of_float64_keeps_what_a_network_of_float64_does_inside(law: type) -> None:
    """The float32 nearest to 0.3 is larger."""
    low, high = np.full(2, -0.3), np.full(2, 0.3)
    head = NormalParamExtractor() if law is LogitNormal else BetaHead()
    last = nn.Linear(2, 4, dtype=torch.float64)
    with torch.no_grad():
        last.bias.copy_(
            torch.tensor([80.0, -80.0, 0.0, 0.0] if law is LogitNormal else [0.0, 80.0, 80.0, 0.0])
        )
    _, acting = bounded_actor(nn.Sequential(last, head), law, low, high)
    seen = TensorDict(observation=torch.zeros(1000, 2).double(), batch_size=[1000])
    action = acting(seen)["action"].detach().numpy()
    assert ((low < action) & (action < high)).all()
    assert np.ptp(action) > 0.59


def test_a_narrow_box_needs_a_network_that_resolves_it() -> None:
    low, high = np.array([1e9, 1e9]), np.array([1e9, 1e9]) + 1e-3
    with pytest.raises(ValueError, match=r"in torch\.float32.* use float64"):
        bounded_actor(network(LogitNormal), LogitNormal, low, high)
    bounded_actor(network(LogitNormal).double(), LogitNormal, low, high)


def test_bounds_of_several_axes_are_refused_and_one_name_will_do() -> None:
    with pytest.raises(ValueError, match=r"the shape \[2, 2\].*action_spec_unbatched\.space.* flatten"):
        bounded_actor(network(LogitNormal), LogitNormal, -np.ones((2, 2)), np.ones((2, 2)))
    actor, _ = bounded_actor(network(LogitNormal), LogitNormal, LOW, HIGH, in_keys="observation")
    assert actor(observations(3))["latent"].shape == (3, 2)
