"""The first program of the book: sixty lines, alone in a folder, as good as the package's policy gradient."""

import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch

from inbounds.book.pages.cells import read_cells
from inbounds.book.pages.programs import EXTENSION_TAG, TAG, assemble, has_program, program_cells
from inbounds.learning import PolicyGradientConfig, policy_gradient
from inbounds.learning.families.policy import Policy, PolicyConfig
from inbounds.learning.networks import ActorCritic, NetworkConfig
from inbounds.learning.rollout import Rollout
from tests.book import by_hand
from tools import assemble_program

NOTEBOOK = Path(__file__).resolve().parents[2] / "notebooks" / "policy_that_learns.ipynb"
TEXT = assemble(NOTEBOOK)
WITHOUT_THE_PACKAGE = "import runpy, sys; sys.modules['inbounds'] = None; sys.argv = sys.argv[1:]; "


@pytest.fixture(scope="module")
def program() -> dict[str, Any]:
    return by_hand.run(TEXT)


def test_it_has_sixty_lines_beside_the_imports() -> None:
    lines = "\n".join(program_cells(read_cells(NOTEBOOK), extensions=False)).splitlines()
    written = [line for line in lines if line.strip() and not re.match(r"(?:import|from) ", line)]
    assert len(written) <= 60
    assert "inbounds" not in "\n".join(lines)
    assert ";" not in "\n".join(lines)


def run(folder: Path, *arguments: str) -> list[int]:
    """Scores, batch by batch, of the file run where the package cannot be imported."""
    (folder / "program.py").write_text(TEXT, encoding="utf8")
    code = f"{WITHOUT_THE_PACKAGE}runpy.run_path('program.py', run_name='__main__')"
    command = [sys.executable, "-W", "error", "-c", code, "program.py", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return [int(line.split()[1]) for line in done.stdout.splitlines()]


def test_the_file_learns_without_the_package(tmp_path: Path) -> None:
    scores = run(tmp_path, "--epochs", "12", "--seed", "1")
    assert len(scores) == 12
    assert max(scores[-3:]) > 5 * scores[0]


def test_another_policy_is_one_argument(tmp_path: Path) -> None:
    assert len(run(tmp_path, "--epochs", "1", "--policy", "gaussian")) == 1


def test_an_import_of_the_package_would_be_noticed(tmp_path: Path) -> None:
    code = f"{WITHOUT_THE_PACKAGE}import inbounds"
    done = subprocess.run([sys.executable, "-c", code, "x"], capture_output=True, text=True, check=False)
    assert "ModuleNotFoundError" in done.stderr


def packed(networks: ActorCritic, policy: Any, critic: Any) -> None:
    """Give the package's networks, of one seed, the program's weights."""
    for packed_net, net in ((networks.actor, policy.net), (networks.critic, critic[0])):
        for layer, ours in zip(packed_net.layers, net[::2], strict=True):
            layer.weight.data[0], layer.bias.data[0, :, 0] = ours.weight.data, ours.bias.data


def as_rollout(networks: ActorCritic, batch: Any) -> Rollout:
    """The program's batch as the package keeps one."""
    obs, latent, reward, terminated, truncated, next_obs = (column[None] for column in batch)
    with torch.no_grad():
        parameters = networks.parameters(obs)
        cut = truncated.bool() & ~terminated.bool()
        cut[:, -1] |= ~terminated[:, -1].bool()
        bootstrap = torch.where(cut, networks.values(next_obs), 0.0)
        value, log_prob = networks.values(obs), networks.policy.law.log_prob(parameters, latent)
    return Rollout(
        obs, latent, latent, reward, terminated.bool(), truncated.bool(), bootstrap, value, log_prob,
        parameters, np.zeros(1), np.zeros(1), [[]],
    )  # fmt: skip


@pytest.mark.parametrize("family", ["logit-normal", "gaussian"])
def test_an_update_agrees_with_the_package(program: dict[str, Any], family: str) -> None:
    torch.manual_seed(3)
    env = gym.make("InvertedPendulum-v5")
    box, obs = env.action_space, env.reset(seed=3)[0]
    policy = program["Policy"](len(obs), box, *program["POLICIES"][family])
    critic = torch.nn.Sequential(program["network"](len(obs), 1, 1.0), torch.nn.Flatten(0))
    _, batch = program["collect"](env, obs, policy, horizon=256)
    truncated = batch.truncated.clone()
    truncated[100] = 1 - batch.terminated[100]  # a cut in the middle, too
    batch = program["Batch"](*(c.double() for c in batch._replace(truncated=truncated)))
    policy.net.double(), critic.double()

    config = NetworkConfig(dtype="float64")
    bound = Policy(PolicyConfig(family), box.low, box.high)
    networks = ActorCritic(bound, len(obs), config, [torch.Generator()])
    packed(networks, policy, critic)
    rollout = as_rollout(networks, batch)
    np.testing.assert_allclose(policy.to_box(batch.latent), bound.execute(batch.latent.numpy()), rtol=1e-6)
    settings = PolicyGradientConfig(
        horizon=256, policy_learning_rate=0.01, learning_rate=0.01, adam_eps=1e-8, num_epochs=20,
        minibatch_size=256, entropy_coef=0.0, max_grad_norm=None,
    )  # fmt: skip
    optimizer = policy_gradient.make_optimizer(networks, settings)
    policy_gradient.update(networks, optimizer, rollout, [np.random.default_rng(0)], settings)

    before = torch.cat([p.detach().flatten().clone() for p in policy.net.parameters()])
    adams = [torch.optim.Adam(net.parameters(), lr=0.01) for net in (policy.net, critic)]
    program["update"](policy, critic, adams, batch)
    for net, theirs in ((policy.net, networks.actor), (critic, networks.critic)):
        ours = torch.cat([p.detach().flatten() for p in net.parameters()])
        torch.testing.assert_close(ours, theirs.theta[0].detach(), rtol=1e-5, atol=1e-8)
    assert not torch.equal(before, torch.cat([p.detach().flatten() for p in policy.net.parameters()]))


def test_programs_are_assembled_from_tagged_cells_alone(tmp_path: Path) -> None:
    cells = [
        SimpleNamespace(source="# Title\n\nText.", tags=[]),
        SimpleNamespace(source="x = 1", tags=[TAG]),
        SimpleNamespace(source="no = 1", tags=[]),
        SimpleNamespace(source="y = 2", tags=[TAG, EXTENSION_TAG]),
    ]
    stored = [{"source": c.source, "metadata": {"tags": c.tags}, "cell_type": "code"} for c in cells]
    assert program_cells(stored) == ["x = 1", "y = 2"]
    assert program_cells(stored, extensions=False) == ["x = 1"]


def test_a_chapter_without_a_program_is_refused() -> None:
    grids = NOTEBOOK.with_name("grids.ipynb")
    assert not has_program(grids)
    with pytest.raises(ValueError, match=r"grids.ipynb has no program"):
        assemble(grids)


def test_the_tool_writes_each_program(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert assemble_program.main([str(tmp_path / "programs")]) == 0
    written = tmp_path / "programs" / f"{NOTEBOOK.stem}.py"
    assert written.read_text(encoding="utf8") == TEXT
    assert str(written) in capsys.readouterr().out


def expectation(values: Any, loc: float) -> float:
    """Of a function of z ~ N(loc, 1), on a fine grid."""
    z = torch.linspace(-12, 12, 100_001, dtype=torch.float64)
    density = torch.exp(-((z - loc) ** 2) / 2) / (2 * torch.pi) ** 0.5
    return torch.trapezoid(density * values(z), z).item()


def test_the_policy_gradient_of_two_steps_is_the_derivative_of_the_return() -> None:
    """Part 2 and 3 where a step depends on the one before: s₁ = z₀, rewards tanh z₀ and cos(z₁ s₁), γ = 0.9."""
    loc, h, nodes = 0.4, 1e-4, torch.linspace(-8, 8, 801, dtype=torch.float64)
    first, second = torch.meshgrid(nodes, nodes, indexing="ij")
    gamma, early, late = 0.9, torch.tanh(first), torch.cos(first * second)

    def mean(values: torch.Tensor, mu: float) -> torch.Tensor:  # z₀ ~ N(μ, 1), z₁ ~ N(μ s₁, 1)
        weight = torch.exp(-((first - mu) ** 2) / 2 - (second - mu * first) ** 2 / 2) / (2 * torch.pi)
        return (values * weight).sum() * (nodes[1] - nodes[0]) ** 2

    slope = (mean(early + gamma * late, loc + h) - mean(early + gamma * late, loc - h)) / (2 * h)
    scores = first - loc, (second - loc * first) * first
    for baseline in (0.0, torch.sin(first)):  # of the state s₁
        weights = early + gamma * late, late - baseline
        found = mean(scores[0] * weights[0] + gamma * scores[1] * weights[1], loc)
        assert found.item() == pytest.approx(slope.item(), rel=1e-5)
    leaky = mean(scores[0] * (early + gamma * late) + gamma * scores[1] * (late - second), loc)
    assert leaky.item() != pytest.approx(slope.item(), rel=1e-2)  # a baseline that looks at the action


def test_the_score_has_mean_zero() -> None:
    assert expectation(lambda z: z - 0.7, 0.7) == pytest.approx(0.0, abs=1e-9)
