"""From an empty cell: the chapter's own cells, and the imports that it names, are a working PPO without the package."""

from pathlib import Path
from typing import Any

import gymnasium as gym
import nbformat
import numpy as np
import pytest
import torch

from inbounds.book import graders_ppo

CHAPTER = Path(__file__).resolve().parents[2] / "notebooks" / "10_ppo.ipynb"
TAG = "ppo-by-hand"


def program_text() -> str:
    """The imports as the prose prints them, and every cell that the chapter calls its own."""
    cells = nbformat.read(CHAPTER, as_version=4).cells
    (prose,) = (c.source for c in cells if c.cell_type == "markdown" and "```python\nimport math" in c.source)
    imports = prose.partition("```python\n")[2].partition("```")[0]
    own = [c.source for c in cells if TAG in c.metadata.get("tags", [])]
    return "\n\n".join([imports, *own])


@pytest.fixture(scope="module")
def program() -> dict[str, Any]:
    namespace: dict[str, Any] = {}
    exec(compile(program_text(), "the chapter", "exec"), namespace)
    return namespace


def test_the_program_does_without_the_package() -> None:
    text = program_text()
    assert "inbounds" not in text
    assert len([line for line in text.splitlines() if line.strip()]) < 200


def test_its_loss_and_its_update_pass_the_graders(program: dict[str, Any]) -> None:
    assert graders_ppo.clipped_surrogate(program["clipped_surrogate"]).passed is True
    assert graders_ppo.ppo_loss(program["ppo_loss"]).passed is True
    assert graders_ppo.ppo_update(program["ppo_update"]).passed is True


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
