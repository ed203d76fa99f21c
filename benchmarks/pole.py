"""Two exercises that take minutes, answered: how fast the pole is learned by λ, and what a shuffled batch teaches.

Both run a chapter's own program, as the reader would: *Which λ learns fastest?* that of *Advantages of actions*, *What
a shuffled batch teaches* that of *Many steps from one batch*. What was found is in `benchmarks/results/pole.json`, from
which the solutions take their numbers.
"""

from __future__ import annotations

import argparse
import copy
import functools
import json
import multiprocessing
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from types import ModuleType
from typing import Any

from rich.progress import track

from benchmarks.run import machine, versions
from inbounds.book.pages import programs
from inbounds.study.running.many_cells import cores

TARGET = Path(__file__).parent / "results" / "pole.json"
POLE = "InvertedPendulum-v5"
EPOCHS, HORIZON = 40, 1000
LAMBDAS = (0.0, 0.95, 1.0)
STEPS = (0, 1, 3, 10, 30)
EXAMPLES = """
examples:
  python -m benchmarks.pole                 ten seeds each: about ten minutes on two cores
  python -m benchmarks.pole --seeds 1       does it run? prints what it found, and writes nothing
"""


def program(chapter: str) -> ModuleType:
    """Return a chapter's program as a module.

    Args:
        chapter: its notebook's name, without ending.

    Example:
        >>> program("advantages_of_actions").__name__
        'advantages_of_actions'
    """
    module = ModuleType(chapter)
    programs.start(vars(module), chapter)
    return module


def first_without_a_fall(points: Sequence[int]) -> int | None:
    """Return the number of the first batch in which the pole never fell, None if it fell in each.

    Args:
        points: of each batch the points per fall; a batch without one has as many points as steps.

    Example:
        >>> first_without_a_fall([6, 90, HORIZON]), first_without_a_fall([6, 90])
        (3, None)
    """
    return next((number for number, each in enumerate(points, 1) if each >= HORIZON), None)


def points_by_lambda(lam: float, seed: int) -> list[int]:
    """Return the points per fall of each batch while *Advantages of actions* trains with a λ."""
    chapter, points = program("advantages_of_actions"), []
    vars(chapter)["advantages"] = functools.partial(chapter.advantages, lam=lam)
    chapter.train(POLE, epochs=EPOCHS, seed=seed, tell=lambda _, each: points.append(each))
    return points


def falls_after_steps(seed: int) -> dict[str, Any]:
    """Return how often the pole falls in 1000 steps after steps on one batch, its advantages in place or shuffled.

    The policy learns as *Many steps from one batch* does, until a batch has no fall. Then it draws a fresh batch, which
    may have one, and takes the steps on it, without the brake and with a new Adam.

    Returns:
        `batches` before the first without a fall (None if none was, and nothing else), and of `own` and `shuffled` the
        falls after each number of `STEPS`.
    """
    import gymnasium as gym
    import torch

    chapter = program("many_steps_from_one_batch")
    torch.manual_seed(seed)
    env = gym.make(POLE)
    obs, _ = env.reset(seed=seed)
    policy = chapter.Policy(len(obs), env.action_space, chapter.normal, chapter.squash)
    critic = torch.nn.Sequential(chapter.network(len(obs), 1, gain=1.0), torch.nn.Flatten(0))
    adams = [torch.optim.Adam(net.parameters(), lr=0.01) for net in (policy.net, critic)]
    obs, batch = chapter.collect(env, obs, policy, HORIZON)
    trained = 0
    while batch.terminated.any():
        if trained == EPOCHS:
            return {"batches": None}
        chapter.update(policy, critic, adams, batch)
        obs, batch = chapter.collect(env, obs, policy, HORIZON)
        trained += 1
    obs, batch = chapter.collect(env, obs, policy, HORIZON)
    learned = copy.deepcopy(policy.net.state_dict())
    advantage, _ = chapter.advantages(batch, critic)
    own = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    falls: dict[str, Any] = {"batches": trained, "own": [], "shuffled": []}
    for steps in STEPS:
        for name, weight in (("own", own), ("shuffled", own[torch.randperm(HORIZON)])):
            policy.net.load_state_dict(learned)
            before = policy.log_prob(batch.obs, batch.latent).detach()
            adam = torch.optim.Adam(policy.net.parameters(), lr=0.01)
            for _ in range(steps):
                chapter.step(adam, -chapter.surrogate(policy, batch, weight, before))
            _, played = chapter.collect(env, env.reset()[0], policy, HORIZON)
            falls[name].append(int(played.terminated.sum()))
    return falls


def work_off(job: tuple[float | None, int]) -> Any:
    """Run one job: a λ and a seed, or None and a seed for the batches."""
    import torch

    torch.set_num_threads(1)
    lam, seed = job
    return falls_after_steps(seed) if lam is None else points_by_lambda(lam, seed)


def main(arguments: Sequence[str] | None = None) -> Mapping[str, Any]:
    """Run both, print what was found, and store it if all seeds were run."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.pole",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--seeds", type=int, default=10, help="of each (10); with fewer nothing is written")
    parser.add_argument("--workers", type=int, default=cores(), help="processes, one thread each")
    chosen = parser.parse_args(arguments)
    jobs = [(lam, seed) for lam in (*LAMBDAS, None) for seed in range(chosen.seeds)]
    with ProcessPoolExecutor(chosen.workers, multiprocessing.get_context("spawn")) as pool:
        done = dict(zip(jobs, track(pool.map(work_off, jobs), "the pole", len(jobs)), strict=True))
    found: dict[str, Any] = {
        "env": POLE,
        "lambda": {f"{lam:g}": [done[lam, seed] for seed in range(chosen.seeds)] for lam in LAMBDAS},
        "first_without_a_fall": {
            f"{lam:g}": [first_without_a_fall(done[lam, seed]) for seed in range(chosen.seeds)]
            for lam in LAMBDAS
        },
        "steps": STEPS,
        "batches": [done[None, seed] for seed in range(chosen.seeds)],
    }
    for lam, batches in found["first_without_a_fall"].items():
        print(f"λ = {lam}: first batch without a fall {batches}")
    for each in found["batches"]:
        print(each)
    if chosen.seeds >= parser.get_default("seeds"):
        about = {"machine": machine(), "versions": versions({})}
        TARGET.write_text(json.dumps(about | found, indent=1) + "\n", encoding="utf8")
    return found


if __name__ == "__main__":
    main()
