"""From an empty cell: the chapter's own cells, and the imports it names, are a working TRPO without the package."""

from pathlib import Path
from typing import Any

import gymnasium as gym
import nbformat
import numpy as np
import pytest
import torch

from inbounds.book import graders_trpo

CHAPTER = Path(__file__).resolve().parents[2] / "notebooks" / "11_trpo.ipynb"
TAG = "trpo-by-hand"


def program_text() -> str:
    """The imports as the prose prints them, and every cell that the chapter calls its own."""
    cells = nbformat.read(CHAPTER, as_version=4).cells
    (prose,) = (
        c.source for c in cells if c.cell_type == "markdown" and "```python\nimport itertools" in c.source
    )
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
    assert len([line for line in text.splitlines() if line.strip()]) < 240


def test_its_step_passes_the_grader(program: dict[str, Any]) -> None:
    assert graders_trpo.trpo_step(program["trpo_step"]).passed is True


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
