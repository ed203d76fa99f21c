"""PPO and TRPO as files to take home: alone in a folder, no longer than promised, and the package's updates."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch

from inbounds.book.exercises import advantages_of_actions
from inbounds.book.exercises import ppo as ppo_graders
from inbounds.book.exercises import trpo as trpo_graders
from inbounds.book.pages import programs
from inbounds.learning import PPOConfig, TRPOConfig, ppo, trpo
from inbounds.learning.families.policy import Policy, PolicyConfig
from inbounds.learning.networks import ActorCritic, NetworkConfig
from tests.book import by_hand
from tests.book.test_program_in_sixty_lines import WITHOUT_THE_PACKAGE, as_rollout, packed

NOTEBOOKS = Path(__file__).resolve().parents[2] / "notebooks"
MOST = {"ppo": 170, "trpo": 220}
TEXTS = {name: programs.assemble(NOTEBOOKS / f"{name}.ipynb") for name in MOST}
POLICIES = ("logit-normal", "gaussian", "beta")


@pytest.fixture(scope="module", params=MOST)
def named(request: pytest.FixtureRequest) -> tuple[str, dict[str, Any]]:
    return request.param, by_hand.run(TEXTS[request.param])


@pytest.mark.parametrize(("name", "most"), MOST.items())
def test_a_file_is_no_longer_than_promised(name: str, most: int) -> None:
    assert len([line for line in TEXTS[name].splitlines() if line.strip()]) <= most
    assert "inbounds" not in TEXTS[name]
    assert ";" not in TEXTS[name]


def test_the_two_differ_in_the_update_and_what_only_it_calls() -> None:
    one, other = (programs.program_of(NOTEBOOKS / f"{name}.ipynb").blocks for name in MOST)
    assert {name for name in one if name in other and one[name] != other[name]} == {"update", "surrogate"}
    assert set(one) - set(other) == {"loss"}
    assert set(other) - set(one) == {"conjugate_gradient", "natural_step", "line_search"}
    for blocks, only in ((one, {"loss"}), (other, set(other) - set(one))):
        rest = "\n".join(text for name, text in blocks.items() if name not in only | {"update"})
        assert [name for name in only if re.search(rf"\b{name}\(", rest)] == []


def alone(folder: Path, name: str, *arguments: str) -> Iterator[int]:
    """Scores, batch by batch, of the file run where the package cannot be imported, until no more are wanted."""
    (folder / f"{name}.py").write_text(TEXTS[name], encoding="utf8")
    code = f"{WITHOUT_THE_PACKAGE}runpy.run_path('{name}.py', run_name='__main__')"
    command = [sys.executable, "-u", "-W", "error", "-c", code, "x", *arguments]
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as running:
        try:
            for line in running.stdout or ():
                yield int(line.split()[1])
            assert running.wait() == 0, running.stderr and running.stderr.read()
        finally:
            running.kill()


@pytest.mark.parametrize("name", MOST)
def test_a_file_runs_alone_with_a_robot(tmp_path: Path, name: str) -> None:
    (score,) = alone(tmp_path, name, "--env", "HalfCheetah-v5", "--policy", "beta", "--epochs", "1")
    assert -1000 < score < 0


@pytest.mark.slow
@pytest.mark.parametrize(("name", "policy"), [("ppo", "logit-normal"), ("ppo", "beta"), ("trpo", "gaussian")])
def test_a_file_holds_the_pole(tmp_path: Path, name: str, policy: str) -> None:
    """An episode has at most 1000 steps; 2048 points of a batch over two or fewer ends are 1000 at least.

    Each file and each law once: TRPO's chapter does it with the other two, and the updates are the package's below.
    """
    epochs = "30" if name == "ppo" else "60"
    scores = alone(tmp_path, name, "--policy", policy, "--epochs", epochs)
    assert 2 < next(scores) < 30
    assert any(score >= 1000 for score in scores)


def test_the_parts_pass_their_graders(named: tuple[str, dict[str, Any]]) -> None:
    name, program = named
    graders: Any = {"ppo": ppo_graders, "trpo": trpo_graders}[name]
    parts = {"ppo": ("surrogate", "loss", "update"),
             "trpo": ("conjugate_gradient", "natural_step", "line_search", "update")}[name]  # fmt: skip
    for part in parts:
        assert getattr(graders, part)(program[part]).passed is True
    assert advantages_of_actions.advantages(program["advantages"]).passed is True
    assert ppo_graders.policy(program["Policy"]).passed is True


class Shuffles:
    """What the package calls a generator, drawing as the program does."""

    def permutation(self, length: int) -> np.ndarray:
        return torch.randperm(length).numpy()


@pytest.mark.parametrize("family", POLICIES)
def test_an_update_agrees_with_the_package(named: tuple[str, dict[str, Any]], family: str) -> None:
    """In double precision, every weight of both networks; the program's bonus is the latent's entropy, so without."""
    name, program = named
    torch.manual_seed(3)
    env = gym.make("HalfCheetah-v5")
    box, obs = env.action_space, env.reset(seed=3)[0]
    policy = program["Policy"](len(obs), box, *program["POLICIES"][family])
    critic = torch.nn.Sequential(program["network"](len(obs), 1, 1.0), torch.nn.Flatten(0))
    _, batch = program["collect"](env, obs, policy, horizon=256)
    ends = batch.terminated.clone(), batch.truncated.clone()
    ends[0][50], ends[1][100] = 1.0, 1.0  # an end and a cut, which HalfCheetah has not in so few steps
    batch = program["Batch"](*(c.double() for c in batch._replace(terminated=ends[0], truncated=ends[1])))
    policy.net.double(), critic.double()

    bound = Policy(PolicyConfig(family), box.low, box.high)
    networks = ActorCritic(bound, len(obs), NetworkConfig(dtype="float64"), [torch.Generator()])
    packed(networks, policy, critic)
    rollout = as_rollout(networks, batch)
    algorithm: Any = {"ppo": ppo, "trpo": trpo}[name]
    config = {"ppo": PPOConfig, "trpo": TRPOConfig}[name](horizon=256, num_epochs=3, entropy_coef=0.0)
    torch.manual_seed(8)
    algorithm.update(networks, algorithm.make_optimizer(networks, config), rollout, [Shuffles()], config)

    weights = [*policy.net.parameters(), *critic.parameters()]
    before = torch.cat([p.detach().flatten().clone() for p in weights])
    adam = torch.optim.Adam(weights, lr=3e-4, eps=1e-5)
    torch.manual_seed(8)
    program["update"](
        policy, critic, adam, batch, passes=3, **({"entropy_coef": 0.0} if name == "ppo" else {})
    )
    after = torch.cat([p.detach().flatten() for p in weights])
    theirs = torch.cat([networks.actor.theta[0], networks.critic.theta[0]]).detach()
    assert (after - before).abs().max() > 1e-3
    torch.testing.assert_close(after, theirs, rtol=1e-6, atol=1e-9)


def test_the_bonus_of_a_gaussian_agrees_too() -> None:
    """`inbounds.book.exercises.ppo.update` compares with a bonus; here the two entropies, law by law."""
    program = by_hand.run(TEXTS["ppo"])
    box, obs = gym.make("HalfCheetah-v5").action_space, torch.randn(8, 17)
    for family in POLICIES:
        policy = program["Policy"](17, box, *program["POLICIES"][family])
        bound = Policy(PolicyConfig(family), box.low, box.high)
        found = policy.net(obs)[None]
        theirs = bound.family.entropy(bound.parameters(found))[0]
        off = theirs - policy.entropy(obs)
        if family == "logit-normal":  # the action's entropy: it has an end, the latent's has none
            assert (off < 0).all()
        else:  # the package's Beta is on [−1, 1]: log 2 a dimension, a constant
            constant = 0.0 if family == "gaussian" else 6 * np.log(2)
            torch.testing.assert_close(off, torch.full_like(off, constant), rtol=1e-4, atol=1e-4)
