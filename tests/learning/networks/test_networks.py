import copy
import itertools
import math
import pickle

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from inbounds.learning import ActorCritic, Mlp, NetworkConfig, Policy, PolicyConfig, PPOConfig
from inbounds.learning.networks.adam import SeedAdam
from inbounds.learning.networks.perceptron import initialize_orthogonal, initialize_pytorch, tanh

SIZES = (5, 16, 16, 4)


def generators(seeds: range | tuple[int, ...] = range(3)) -> list[torch.Generator]:
    return [torch.Generator().manual_seed(s) for s in seeds]


def network(num_seeds: int = 3, dtype: torch.dtype = torch.float64) -> Mlp:
    net = Mlp(num_seeds, SIZES, dtype)
    initialize_pytorch(net, generators(range(num_seeds)))
    return net


def torch_twin(net: Mlp, seed: int) -> torch.nn.Sequential:
    """The same network as an ordinary torch module."""
    modules: list[torch.nn.Module] = []
    for layer in net.layers:
        linear = torch.nn.Linear(layer.weight.shape[2], layer.weight.shape[1], dtype=layer.weight.dtype)
        linear.weight.data, linear.bias.data = (
            layer.weight[seed].detach().clone(),
            layer.bias[seed, :, 0].detach().clone(),
        )
        modules += [linear, torch.nn.Tanh()]
    return torch.nn.Sequential(*modules[:-1])


def test_each_seed_is_an_ordinary_torch_network() -> None:
    net, obs = network(), torch.randn(3, 7, 5, dtype=torch.float64)
    out = net(obs)
    gradients = torch.autograd.grad(out.square().sum(), net.parameters)
    for s in range(3):
        twin = torch_twin(net, s)
        expected = twin(obs[s])
        assert torch.allclose(out[s], expected, rtol=1e-12)
        theirs = torch.autograd.grad(expected.square().sum(), list(twin.parameters()))
        for ours, their in zip(gradients, theirs, strict=True):
            assert torch.allclose(ours[s].squeeze(-1) if their.dim() == 1 else ours[s], their, rtol=1e-10)


def test_acting_in_numpy_is_the_same_function_and_sees_updates() -> None:
    net, obs = network(dtype=torch.float32), torch.randn(3, 5)
    assert np.allclose(net.act(obs.numpy()), net(obs[:, None])[:, 0].detach().numpy(), atol=1e-6)
    net.theta.mul_(1.1)
    assert np.allclose(net.act(obs.numpy()), net(obs[:, None])[:, 0].detach().numpy(), atol=1e-6)


def test_layers_are_views_of_theta() -> None:
    net = network()
    assert net.theta.shape == (3, sum((i + 1) * o for i, o in itertools.pairwise(SIZES)))
    rows = torch.cat([p.detach().flatten(1) for p in net.parameters], 1)
    assert torch.equal(rows, net.theta)
    net.store_gradients([torch.full_like(p, i) for i, p in enumerate(net.parameters)])
    assert net.padded.grad is not None
    assert net.padded.grad[1, 0] == 0
    assert net.padded.grad[1, net.theta.shape[1] - 1] == len(net.parameters) - 1


@settings(deadline=None, max_examples=10)
@given(st.integers(2, 20), st.integers(2, 20), st.floats(0.01, 2.0))
def test_orthogonal_initialisation_is_orthogonal_per_slice(n_in: int, n_out: int, head_gain: float) -> None:
    net = Mlp(3, (n_in, n_out, n_in), torch.float64)
    initialize_orthogonal(net, generators(), head_gain)
    for layer, gain in zip(net.layers, (math.sqrt(2), head_gain), strict=True):
        assert not layer.bias.any()
        for weight in layer.weight.detach():
            rows, columns = weight.shape
            square = weight @ weight.T if rows <= columns else weight.T @ weight
            assert torch.allclose(square, gain**2 * torch.eye(len(square)).double(), atol=1e-10)
    assert not torch.equal(net.theta[0], net.theta[1])


@pytest.mark.parametrize("initialize", [initialize_pytorch, lambda n, g: initialize_orthogonal(n, g, 1.0)])
def test_a_seeds_first_weights_are_its_own(initialize) -> None:
    first, second = (Mlp(2, SIZES) for _ in range(2))
    initialize(first, generators((7, 1)))
    initialize(second, generators((3, 7)))
    assert torch.equal(first.theta[0], second.theta[1])
    assert not torch.equal(first.theta[1], second.theta[0])


def test_pytorch_initialisation_is_that_of_a_linear_layer() -> None:
    net = Mlp(50, (16, 8))
    initialize_pytorch(net, generators(range(50)))
    weight = net.layers[0].weight.detach()
    assert weight.abs().max() <= 0.25
    assert weight.std() == pytest.approx(0.25 / math.sqrt(3), rel=0.05)
    assert net.layers[0].bias.detach().std() == pytest.approx(0.25 / math.sqrt(3), rel=0.15)


def test_tanh_has_its_derivatives() -> None:
    x = torch.linspace(-3, 3, 9, dtype=torch.float64, requires_grad=True)
    assert torch.allclose(tanh(x), torch.tanh(x), rtol=1e-14)
    assert torch.autograd.gradcheck(tanh, x)
    assert torch.autograd.gradgradcheck(tanh, x)


def actor_critic(config: PolicyConfig, dtype: str = "float64") -> ActorCritic:
    policy = Policy(config, -np.ones(2), np.ones(2))
    return ActorCritic(policy, 5, NetworkConfig(hidden_sizes=(16,), dtype=dtype), generators())


def test_each_head_has_its_own_gain() -> None:
    policy = Policy(PolicyConfig("gaussian"), -np.ones(2), np.ones(2))
    for config, gains in (
        (NetworkConfig(dtype="float64"), (0.01, 1.0)),
        (NetworkConfig(policy_head_gain=0.3, value_head_gain=5.0, dtype="float64"), (0.3, 5.0)),
    ):
        nets = ActorCritic(policy, 5, config, generators())
        for net, gain in zip(nets.networks, gains, strict=True):
            singular = torch.linalg.svdvals(net.layers[-1].weight.detach())
            assert torch.allclose(singular, torch.full_like(singular, gain), rtol=1e-9)


def test_initial_std_sets_the_heads_bias() -> None:
    nets = actor_critic(PolicyConfig("logit-normal", initial_std=0.4166))
    parameters = nets.parameters(torch.zeros(3, 1, 5).double())
    assert torch.allclose(parameters.log_scale, torch.zeros(()).double(), atol=2e-3)
    assert not parameters.loc.any()


def test_state_independent_std_is_one_number_that_learns() -> None:
    nets = actor_critic(PolicyConfig("gaussian", state_dependent_std=False))
    nets.actor.theta.add_(0.1 * torch.randn_like(nets.actor.theta))  # even if something moved the hidden rows
    log_std = nets.parameters(torch.randn(3, 6, 5).double()).log_scale
    assert torch.equal(log_std, log_std[:, :1].expand_as(log_std))
    gradients = torch.autograd.grad(log_std.sum(), nets.actor.parameters)
    assert gradients[-1][:, 2:].eq(6).all()  # the bias, once per state
    assert not any(gradient.any() for gradient in gradients[:-1])
    fresh = actor_critic(PolicyConfig("gaussian", state_dependent_std=False))
    assert not fresh.parameters(torch.randn(3, 6, 5).double()).log_scale.any()  # σ = 1
    assert np.array_equal(fresh.actor.act(np.ones((3, 5)))[:, 2:], np.zeros((3, 2)))


def test_named_tensors_rebuild_the_network() -> None:
    nets = actor_critic(PolicyConfig("gaussian"))
    tensors = nets.actor.named_tensors("policy") | nets.critic.named_tensors("value")
    assert set(tensors) == {
        f"{n}.{i}.{k}" for n in ("policy", "value") for i in (0, 1) for k in ("weight", "bias")
    }
    obs = torch.randn(3, 5).double()
    hidden = torch.tanh(torch.einsum("soi,si->so", tensors["value.0.weight"], obs) + tensors["value.0.bias"])
    value = torch.einsum("soi,si->so", tensors["value.1.weight"], hidden) + tensors["value.1.bias"]
    assert torch.allclose(nets.values(obs[:, None]), value)


@pytest.mark.parametrize(
    "wrong",
    [
        {"hidden_sizes": ()},
        {"hidden_sizes": (0,)},
        {"hidden_sizes": (16.0, 16)},
        {"hidden_sizes": 64},
        {"initialization": "xavier"},
        {"dtype": "float16"},
        {"dtype": ["float32"]},
        {"policy_head_gain": "0.1"},
        {"value_head_gain": math.inf},
    ],
    ids=str,
)
def test_network_config_is_checked(wrong: dict) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        NetworkConfig(**wrong)


def test_a_list_of_sizes_is_the_tuple_that_a_file_gives_back() -> None:
    assert NetworkConfig(hidden_sizes=[np.int64(64), 64]) == NetworkConfig()
    assert hash(NetworkConfig(hidden_sizes=[64, 64])) == hash(NetworkConfig())


def test_what_clips_nothing_may_be_infinite() -> None:
    assert PPOConfig(clip_range=math.inf, max_grad_norm=math.inf).clip_range == math.inf


def test_a_copied_optimiser_trains_the_copied_network() -> None:
    net = Mlp(2, (3, 4, 1))
    torch.nn.init.normal_(net.theta)
    optimiser = SeedAdam([net], 0.1, eps=1e-8, max_grad_norm=None)
    before = net.theta.clone()
    twin, other = copy.deepcopy((net, optimiser))
    obs = torch.ones(2, 5, 3)
    other.minimize(twin(obs).square().sum())
    assert torch.equal(net.theta, before)
    assert not torch.equal(twin.theta, before)
    assert np.allclose(twin.act(obs[:, 0].numpy()), twin(obs)[:, 0].detach().numpy(), rtol=1e-5)
    assert torch.equal(pickle.loads(pickle.dumps(twin.seed(1))).theta, twin.theta[1:])


def test_a_seed_may_be_counted_from_the_end_and_must_be_there() -> None:
    for nets in (network(), actor_critic(PolicyConfig("gaussian"))):
        assert weights_of(nets.seed(-1)).tolist() == weights_of(nets)[-1:].tolist()
        for wrong in (len(weights_of(nets)), -1 - len(weights_of(nets))):
            with pytest.raises(
                IndexError, match=f"no seed {wrong}: choose one of the {len(weights_of(nets))}, from 0"
            ):
                nets.seed(wrong)


def weights_of(nets: Mlp | ActorCritic) -> torch.Tensor:
    return nets.theta if isinstance(nets, Mlp) else nets.actor.theta
