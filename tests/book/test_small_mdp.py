"""The small decision process against definitions: sums over time, averages over episodes, other libraries' moments."""

import dataclasses

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from inbounds.book import small_mdp
from inbounds.book.small_mdp import SmallMDP, ledge, slope, squashed_moments
from inbounds.distributions import LogitNormal

PROCESSES = {"ledge": ledge(), "slope": slope(), "short": ledge(cells=3, gamma=0.5)}
few = settings(max_examples=15, deadline=None)


def random_policy(seed: int, cells: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Moments of a logit-normal policy with its own parameters in each cell."""
    rng = np.random.default_rng(seed)
    loc, log_scale = rng.normal(0, 1.5, cells), rng.uniform(-2, 0.7, cells)
    return squashed_moments(torch.from_numpy(loc), torch.from_numpy(log_scale))


def by_definition(process: SmallMDP, mean: torch.Tensor, square: torch.Tensor, gamma: float):
    """Values and visits as sums over 3000 steps, with loops over states."""
    states = process.num_states
    transitions = np.zeros((states, states))
    rewards = np.zeros(states)
    for s in range(states):
        right = (1 + mean[s].item()) / 2
        transitions[s] = (1 - right) * process.left[s].numpy() + right * process.right[s].numpy()
        constant, linear, quadratic = process.reward[s].tolist()
        rewards[s] = constant + linear * mean[s].item() + quadratic * square[s].item()
    value, ahead = np.zeros(states), np.eye(states)
    visits, now = np.zeros(states), process.start.numpy().copy()
    for t in range(3000):
        value += gamma**t * ahead @ rewards
        visits += gamma**t * now
        ahead, now = ahead @ transitions, now @ transitions
    return value, visits


@pytest.mark.parametrize("name", PROCESSES)
@given(seed=st.integers(0, 2**32 - 1), discounted=st.booleans())
@few
def test_values_and_visits_are_sums_over_time(name: str, seed: int, discounted: bool) -> None:
    process = PROCESSES[name]
    mean, square = random_policy(seed, process.num_states)
    gamma = process.gamma if discounted else 1.0
    value, visits = by_definition(process, mean, square, gamma)
    given_gamma = None if discounted else 1.0
    np.testing.assert_allclose(process.values(mean, square, given_gamma), value, rtol=1e-8)
    np.testing.assert_allclose(process.occupancy(mean, given_gamma), visits, rtol=1e-8, atol=1e-12)
    _, rewards = process.dynamics(mean, square)
    total = process.performance(mean, square, given_gamma).item()
    assert np.isclose(total, process.start.numpy() @ value)
    assert np.isclose(total, visits @ rewards.numpy())


@pytest.mark.parametrize("name", PROCESSES)
@given(seed=st.integers(0, 2**32 - 1))
@few
def test_the_policy_averages_action_values_to_values(name: str, seed: int) -> None:
    process = PROCESSES[name]
    mean, square = random_policy(seed, process.num_states)
    values = process.values(mean, square)
    constant, linear, quadratic = process.action_values(values).T
    torch.testing.assert_close(constant + linear * mean + quadratic * square, values)


def test_action_values_by_definition() -> None:
    process, values = slope(), torch.arange(6, dtype=torch.float64)
    coefficients = process.action_values(values)
    for action in (-1.0, 0.3, 1.0):
        found = coefficients @ torch.tensor([1.0, action, action**2], dtype=torch.float64)
        step = (1 - action) / 2 * process.left + (1 + action) / 2 * process.right
        reward = process.reward @ torch.tensor([1.0, action, action**2], dtype=torch.float64)
        torch.testing.assert_close(found, reward + process.gamma * step @ values)


def test_many_policies_at_once_are_each_by_itself() -> None:
    process = ledge()
    moments = [random_policy(seed, 6) for seed in range(4)]
    means, squares = (torch.stack(column) for column in zip(*moments, strict=True))
    values, visits = process.values(means, squares), process.occupancy(means)
    q = process.action_values(values)
    for k, (mean, square) in enumerate(moments):
        torch.testing.assert_close(values[k], process.values(mean, square))
        torch.testing.assert_close(visits[k], process.occupancy(mean))
        torch.testing.assert_close(q[k], process.action_values(values[k]))


@given(loc=st.floats(-5, 5), log_scale=st.floats(-3, 1))
@few
def test_moments_are_those_of_the_logit_normal(loc: float, log_scale: float) -> None:
    parameters = torch.tensor([loc, log_scale], dtype=torch.float64)
    mean, square = squashed_moments(*parameters)
    law = LogitNormal(parameters[0], parameters[1].exp(), -1.0, 1.0)
    torch.testing.assert_close(mean, law.mean, rtol=1e-7, atol=1e-9)
    torch.testing.assert_close(square, law.variance + law.mean**2, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("name", PROCESSES)
def test_sampled_episodes_have_the_expected_return_and_visits(name: str) -> None:
    process = PROCESSES[name]
    rng = np.random.default_rng(1)
    loc = np.linspace(0.5, -0.5, process.num_states)

    def draw(state):
        latent = loc[state] + rng.standard_normal(state.shape)
        return latent, np.tanh(latent / 2)

    played = process.sample(draw, (20_000,), 120, rng)
    zeros = torch.zeros(process.num_states, dtype=torch.float64)
    mean, square = squashed_moments(torch.from_numpy(loc), zeros)
    returns = played.reward @ process.gamma ** np.arange(120)
    error = returns.std() / np.sqrt(len(returns))
    assert abs(returns.mean() - process.performance(mean, square).item()) < 4 * error
    counts = (played.state[..., None] == np.arange(process.num_states)) & played.alive[..., None]
    weighted = (counts * (process.gamma ** np.arange(120))[:, None]).sum(1)
    error = weighted.std(0) / np.sqrt(len(weighted))
    assert (abs(weighted.mean(0) - process.occupancy(mean).numpy()) < 4 * error).all()


def test_episodes_fit_together() -> None:
    process, rng = ledge(), np.random.default_rng(0)
    played = process.sample(
        lambda s: (0.0 * s, rng.uniform(-1, 1, s.shape)), shape=(3, 200), steps=50, rng=rng
    )
    assert all(column.shape == (3, 200, 50) for column in played)
    going = played.alive[..., 1:]
    assert (played.alive[..., :-1] >= going).all()  # nobody rises from the dead
    assert (played.next_state[..., :-1] == played.state[..., 1:])[going].all()
    assert (played.next_state[..., :-1][played.alive[..., :-1] & ~going] == -1).all()
    assert (played.reward[~played.alive] == 0).all()
    assert (abs(np.diff(played.state, axis=-1))[going] <= 1).all()
    assert (played.state[..., 0] == 0).all()
    falls = played.alive & (played.next_state < 0) & (played.state == 5)
    assert falls.any()


def test_a_fall_is_charged_by_its_probability() -> None:
    steep, flat = ledge(fall=10.0), ledge(fall=0.0)
    charge = (flat.reward - steep.reward)[-1] @ torch.tensor([1.0, 0.5, 0.25], dtype=torch.float64)
    assert np.isclose(charge.item(), 10.0 * 0.8 * 0.75)
    assert torch.equal(steep.reward[:-1], flat.reward[:-1])
    assert np.isclose(1 - steep.right[-1].sum().item() / 0.98, 0.8)  # battery apart, it falls


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"left": torch.eye(5)}, r"\[6, 6\]"),
        ({"reward": torch.zeros(6, 2)}, "coefficients of 1, a and a²"),
        ({"right": 2 * torch.eye(6)}, "right must hold probabilities"),
        ({"start": -torch.ones(6)}, "start must hold probabilities"),
        ({"start": torch.full((6,), 0.1)}, "start must sum to one"),
        ({"left": torch.full((6, 6), torch.nan)}, "left must hold probabilities"),
        ({"gamma": 1.0}, r"gamma must be in \[0, 1\)"),
    ],
)
def test_bad_processes_are_refused(change: dict, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        dataclasses.replace(ledge(), **change)


def test_the_discount_can_be_exchanged() -> None:
    assert small_mdp.ledge().with_gamma(0.5).gamma == 0.5
