"""From an empty cell: the chapter's own cells, and the imports that it names, are a working PPO without the package."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch

from inbounds.book.exercises import ppo as graders
from tests.book import by_hand

TEXT = by_hand.program_text("ppo", tag="ppo-by-hand", first_import="math")


@pytest.fixture(scope="module")
def program() -> dict[str, Any]:
    return by_hand.run(TEXT)


def test_the_program_does_without_the_package() -> None:
    assert "inbounds" not in TEXT
    assert len([line for line in TEXT.splitlines() if line.strip()]) < 200


def test_its_loss_and_its_update_pass_the_graders(program: dict[str, Any]) -> None:
    assert graders.clipped_surrogate(program["clipped_surrogate"]).passed is True
    assert graders.ppo_loss(program["ppo_loss"]).passed is True
    assert graders.ppo_update(program["ppo_update"]).passed is True


@pytest.mark.slow
def test_it_learns_to_balance_a_pole(program: dict[str, Any]) -> None:
    """A task that terminates, as the chapter's robot never does."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    env = gym.make("InvertedPendulum-v5")
    _, _, curve = program["train"](
        env, program["LAWS"]["logit-normal"], lambda z: 3 * torch.tanh(z / 2), epochs=6, seed=0
    )
    torch.set_num_threads(before)
    assert np.isfinite(curve).all()
    assert curve[-1] > 2 * curve[0]
