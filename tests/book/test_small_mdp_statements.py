"""What the chapters on the policy gradient and on the surrogate state, on random processes and random policies."""

from typing import NamedTuple

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from inbounds.book.small_mdp import SmallMDP, squashed_moments

many = settings(max_examples=40, deadline=None)
seeds = st.integers(0, 2**32 - 1)


def random_process(rng: np.random.Generator) -> SmallMDP:
    """Two to six states, any transitions, episodes that end by chance."""
    states = int(rng.integers(2, 7))

    def transitions() -> Tensor:
        rows = rng.dirichlet(np.full(states, 0.5), states) * rng.uniform(0.7, 1.0, (states, 1))
        return torch.from_numpy(rows)

    reward = torch.from_numpy(rng.normal(size=(states, 3)))
    start = torch.from_numpy(rng.dirichlet(np.ones(states)))
    return SmallMDP(transitions(), transitions(), reward, start, float(rng.uniform(0.3, 0.97)))


def random_theta(rng: np.random.Generator, states: int) -> Tensor:
    """μ and log σ of a logit-normal policy in every state, `[2, N]`."""
    return torch.from_numpy(np.stack([rng.normal(0, 1, states), rng.uniform(-1.5, 0.5, states)]))


def expected(coefficients: Tensor, mean: Tensor, square: Tensor) -> Tensor:
    """E[c₀ + c₁a + c₂a²] in every state."""
    constant, linear, quadratic = coefficients.T
    return constant + linear * mean + quadratic * square


class Pair(NamedTuple):
    """An old and a new policy in one process, and what the statements speak of."""

    process: SmallMDP
    old: tuple[Tensor, Tensor]
    new: tuple[Tensor, Tensor]
    action_values: Tensor
    gain: Tensor
    """E[A_old(s, a)] for a from the new policy, `[N]`."""
    variation: Tensor
    """Total variation between the two in every state, `[N]`."""
    divergence: Tensor
    """KL(old‖new) in every state, `[N]`."""

    @property
    def surrogate(self) -> Tensor:
        return self.process.performance(*self.old) + self.process.occupancy(self.old[0]) @ self.gain


def pair_of(rng: np.random.Generator, reach: float = 1.0) -> Pair:
    process = random_process(rng)
    old, other = (random_theta(rng, process.num_states) for _ in range(2))
    new = old + reach * (other - old)
    moments = [squashed_moments(*theta) for theta in (old, new)]
    values = process.values(*moments[0])
    q = process.action_values(values)
    z = torch.linspace(-14, 14, 20_001, dtype=torch.float64)[:, None]
    laws = [torch.distributions.Normal(theta[0], theta[1].exp()) for theta in (old, new)]
    densities = [law.log_prob(z).exp() for law in laws]
    variation = torch.trapezoid((densities[0] - densities[1]).abs(), z, dim=0) / 2
    divergence = torch.distributions.kl_divergence(*laws)
    return Pair(process, *moments, q, expected(q, *moments[1]) - values, variation, divergence)


class Gradient(NamedTuple):
    """A random process, a random policy that autograd follows, and the policy's gradient by the linear algebra."""

    process: SmallMDP
    theta: Tensor
    moments: tuple[Tensor, Tensor]
    action_values: Tensor
    truth: Tensor


def process_and_gradient(seed: int) -> Gradient:
    rng = np.random.default_rng(seed)
    process = random_process(rng)
    theta = random_theta(rng, process.num_states).requires_grad_()
    moments = squashed_moments(*theta)
    (truth,) = torch.autograd.grad(process.performance(*moments), theta, retain_graph=True)
    with torch.no_grad():
        q = process.action_values(process.values(*moments))
    return Gradient(process, theta, moments, q, truth)


@given(seed=seeds)
@many
def test_the_policy_gradient_theorem(seed: int) -> None:
    """Σ ρ(s) ∇E[Q(s, a)], Q held, is the derivative of the linear algebra."""
    process, theta, moments, q, truth = process_and_gradient(seed)
    with torch.no_grad():
        visits = process.occupancy(moments[0])
    (theorem,) = torch.autograd.grad(visits @ expected(q, *moments), theta)
    torch.testing.assert_close(theorem, truth, rtol=1e-8, atol=1e-10)


@given(seed=seeds)
@many
def test_without_the_discount_each_state_is_rescaled(seed: int) -> None:
    """Parameters of its own for each state: the usual update is the gradient times ρ¹(s)/ρ(s), so it points uphill."""
    process, theta, moments, q, truth = process_and_gradient(seed)
    with torch.no_grad():
        visits, undiscounted = (process.occupancy(moments[0], gamma) for gamma in (None, 1.0))
    (usual,) = torch.autograd.grad(undiscounted @ expected(q, *moments), theta)
    torch.testing.assert_close(usual, truth * undiscounted / visits, rtol=1e-7, atol=1e-9)
    assert (usual * truth).sum() > 0


@given(seed=seeds, gae_lambda=st.floats(0, 1))
@many
def test_the_bias_of_gae(seed: int, gae_lambda: float) -> None:
    """The expected sum of residuals, by a linear system, against advantage, own error and the errors ahead."""
    rng = np.random.default_rng(seed)
    process = random_process(rng)
    mean, square = squashed_moments(*random_theta(rng, process.num_states))
    transitions, _ = process.dynamics(mean, square)
    values = process.values(mean, square)
    error = torch.from_numpy(rng.normal(size=process.num_states))
    ahead = torch.eye(process.num_states) - process.gamma * gae_lambda * transitions
    action = float(rng.uniform(-1, 1))
    powers = torch.tensor([1.0, action, action**2], dtype=torch.float64)
    after = (1 - action) / 2 * process.left + (1 + action) / 2 * process.right  # P(s' | s, a)

    guess = values + error
    residual = process.action_values(guess) @ powers - guess  # δ(s, a)
    policy_residual = expected(process.action_values(guess), mean, square) - guess
    later = torch.linalg.solve(ahead, policy_residual)  # Σ (γλ)^l E[δ_{t+l}] from the next state on
    found = residual + process.gamma * gae_lambda * after @ later

    advantage = process.action_values(values) @ powers - values
    bias = process.gamma * (1 - gae_lambda) * after @ torch.linalg.solve(ahead, error)
    torch.testing.assert_close(found, advantage - error + bias, rtol=1e-8, atol=1e-9)


@given(seed=seeds)
@many
def test_the_performance_difference(seed: int) -> None:
    pair = pair_of(np.random.default_rng(seed))
    process = pair.process
    difference = process.performance(*pair.new) - process.performance(*pair.old)
    torch.testing.assert_close(process.occupancy(pair.new[0]) @ pair.gain, difference, rtol=1e-7, atol=1e-9)


@given(seed=seeds)
@many
def test_the_surrogate_touches_the_return_once(seed: int) -> None:
    """At the old policy the gap vanishes with its slope: it is of second order in the step."""
    state = np.random.default_rng(seed).bit_generator.state
    gaps = []
    for reach in (1e-3, 2e-3):
        rng = np.random.default_rng()
        rng.bit_generator.state = state
        pair = pair_of(rng, reach)
        gaps.append((pair.process.performance(*pair.new) - pair.surrogate).item())
    assert abs(gaps[1] - 4 * gaps[0]) < 0.1 * abs(gaps[1]) + 1e-8


@given(seed=seeds)
@many
def test_no_step_is_too_far_if_no_state_pays(seed: int) -> None:
    rng = np.random.default_rng(seed)
    process = random_process(rng)
    mean, square = squashed_moments(*random_theta(rng, process.num_states))
    values = process.values(mean, square)
    actions = torch.linspace(-1, 1, 101, dtype=torch.float64)
    powers = torch.stack([actions**0, actions, actions**2])
    table = process.action_values(values) @ powers  # [N, 101]
    better = [rng.choice(np.flatnonzero(row >= v)) for row, v in zip(table, values, strict=True)]
    jump = actions[torch.tensor(better)]  # in each state any action that is no worse than the policy
    assert process.performance(jump, jump**2) >= process.performance(mean, square) - 1e-9


@given(seed=seeds, reach=st.sampled_from([0.01, 0.1, 1.0]))
@many
def test_visits_shift_no_further_than_the_lemma_allows(seed: int, reach: float) -> None:
    pair = pair_of(np.random.default_rng(seed), reach)
    old, new = (pair.process.occupancy(policy[0]) for policy in (pair.old, pair.new))
    gamma = pair.process.gamma
    assert (new - old).abs().sum() <= 2 * gamma / (1 - gamma) * old @ pair.variation + 1e-9


@given(seed=seeds, reach=st.sampled_from([0.01, 0.1, 1.0]))
@many
def test_the_three_performance_bounds_hold_in_order(seed: int, reach: float) -> None:
    pair = pair_of(np.random.default_rng(seed), reach)
    process, gamma = pair.process, pair.process.gamma
    gap = (process.performance(*pair.new) - pair.surrogate).abs().item()
    actions = torch.linspace(-1, 1, 2001, dtype=torch.float64)
    powers = torch.stack([actions**0, actions, actions**2])
    largest = (pair.action_values @ powers - process.values(*pair.old)[:, None]).abs().max().item()
    mean_variation = (process.occupancy(pair.old[0]) @ pair.variation).item()
    bounds = [
        2 * gamma * pair.gain.abs().max().item() / (1 - gamma) * mean_variation,
        4 * gamma * largest / (1 - gamma) ** 2 * pair.variation.max().item() ** 2,
        2 * gamma * largest / (1 - gamma) ** 2 * pair.divergence.max().item(),
    ]
    slack = 1e-9 + 1e-6 * bounds[-1]  # the grid of actions, the quadrature
    assert gap <= bounds[0] + slack
    assert bounds[0] <= bounds[1] + slack
    assert bounds[1] <= bounds[2] + slack


@given(loc=st.floats(-2, 2), scale=st.floats(0.3, 1.3))
@many
def test_the_second_moment_of_the_ratio(loc: float, scale: float) -> None:
    old, new = (torch.distributions.Normal(*map(torch.tensor, law)) for law in ((0.0, 1.0), (loc, scale)))
    a = torch.linspace(-40, 40, 200_001, dtype=torch.float64)
    second = torch.trapezoid((2 * new.log_prob(a) - old.log_prob(a)).exp(), a).item()
    room = 2 - scale**2
    assert np.isclose(second, np.exp(loc**2 / room) / (scale * np.sqrt(room)), rtol=1e-5)
    wide = torch.distributions.Normal(torch.tensor(0.0), torch.tensor(2**0.5 + 0.01))
    assert (2 * wide.log_prob(a[-1]) - old.log_prob(a[-1])).exp() > 0.1  # does not vanish far out
