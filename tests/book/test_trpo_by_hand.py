"""From an empty cell: the chapter's own cells, and the imports it names, are a working TRPO without the package."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch

from inbounds.book.exercises import trpo as graders
from tests.book import by_hand

TEXT = by_hand.program_text("trpo", tag="trpo-by-hand", first_import="itertools")


@pytest.fixture(scope="module")
def program() -> dict[str, Any]:
    return by_hand.run(TEXT)


def test_the_program_does_without_the_package() -> None:
    assert "inbounds" not in TEXT
    assert len([line for line in TEXT.splitlines() if line.strip()]) < 240


def test_its_step_passes_the_grader(program: dict[str, Any]) -> None:
    assert graders.trpo_step(program["trpo_step"]).passed is True


@pytest.mark.parametrize("law", ["NORMAL", "BETA"])
def test_its_update_keeps_the_divergence_below_the_bound(program: dict[str, Any], law: str) -> None:
    """In single precision too, the default of an empty cell."""
    generator = torch.Generator().manual_seed(0)
    sizes = (3, 8, 4)
    theta = program["initial_weights"](sizes, 0.5, generator)
    obs, latent = torch.randn(64, 3, generator=generator), torch.rand(64, 2, generator=generator)
    advantage = torch.randn(64, generator=generator)
    batch = program["Batch"](obs, latent, advantage, advantage)
    problem = program["make_problem"](program[law], sizes, theta, batch)
    new = program["trpo_step"](*problem, theta, max_kl=0.02)
    surrogate, mean_kl = problem
    assert 0.002 < mean_kl(new) <= 0.02
    assert surrogate(new) > surrogate(theta)


def test_it_learns_to_balance_a_pole(program: dict[str, Any]) -> None:
    """A task that terminates and is truncated, with bounds other than one."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    env = gym.make("InvertedPendulum-v5")
    _, _, curve = program["train"](env, 8, lambda z: 3 * torch.tanh(z / 2), horizon=512, seed=0)
    torch.set_num_threads(before)
    assert np.isfinite(curve).all()
    assert curve[-1] > 2 * curve[0]
