"""A template for a task of your own. Copy this file, replace what is marked YOURS, and keep the order of `main`.

    python my_task.py --policy logit-normal --seeds 10 --epochs 60 --out runs/first

First come the checks, then what needs no learning, then training, and at last days that nobody has used: it prints
what each earns there, and the lead over your rule with a 95 % interval. `--out` keeps the policies, and training that
was interrupted goes on from there; take another folder after every change of the task. The task that stands here is a
tank whose level shall be held at one metre while the demand goes up and down. It needs `inbounds` and nothing else.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from numpy.typing import NDArray

from inbounds.book.exercises.checks.environment import complaints
from inbounds.book.own_task import best_of, compare, constant, greedy, noisy, play
from inbounds.learning import FAMILIES, TrainConfig, preset, save_run, train
from inbounds.study.statistics import Estimate

# ---- YOURS: the box in your units, what a policy sees, how long an episode lasts

LOW, HIGH = np.array([0.0], np.float32), np.array([3.0], np.float32)  # inflow [litres per second]
SEEN = 3  # level, demand now, time left
STEPS = 100


class MyTask(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """YOURS. Draw everything that is random from `self.np_random`: it is the generator that the seed reaches."""

    observation_space = spaces.Box(-np.inf, np.inf, (SEEN,), np.float32)
    action_space = spaces.Box(LOW, HIGH, dtype=np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode: return what is seen."""
        super().reset(seed=seed)
        self.level = self.np_random.uniform(0.5, 1.5)
        self.phase = self.np_random.uniform(0, 2 * np.pi)
        self.time = 0
        return self._seen(), {}

    def step(self, action: NDArray[Any]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Go one step: return what is seen, the reward, whether all is lost, whether only the clock has run out."""
        inflow = float(np.clip(action, LOW, HIGH)[0])
        self.level += 0.1 * (inflow - self._demand())
        self.time += 1
        reward = float(np.exp(-((4 * (self.level - 1)) ** 2)))  # of the order of one
        lost = not 0 < self.level < 2  # dry, or over the brim: terminated
        return self._seen(), reward, lost, self.time == STEPS, {}  # the clock: truncated

    def _demand(self) -> float:
        return 1.5 + float(np.sin(self.phase + self.time / 5))

    def _seen(self) -> NDArray[np.float32]:
        return np.array([self.level, self._demand(), 1 - self.time / STEPS], np.float32)


def rule(gain: float) -> Any:
    """YOURS: what you would do without learning, in two lines."""
    return lambda obs: np.clip(1.5 + gain * (1 - obs[:, :1]), LOW, HIGH).astype(np.float32)


NOTHING = constant([0.0])
CONSTANTS = {f"constant {a:g}": constant([a]) for a in np.linspace(0, 3, 13)}
RULES = {f"rule {gain:g}": rule(gain) for gain in (1, 2, 4, 8, 16, 32)}

# ---- the days: for choosing, and for the table alone. Training draws its own, and never these.

CHOSEN_BY, TESTED = range(1000, 1020), range(2000, 2050)


def make_envs(num_envs: int) -> SyncVectorEnv:
    """Return as many tasks as seeds, side by side. If your simulator can step many at once, write them as one."""
    return SyncVectorEnv([MyTask] * num_envs, autoreset_mode=AutoresetMode.SAME_STEP)


def plan(policy: str, seeds: int | tuple[int, ...], epochs: int) -> TrainConfig:
    """YOURS: horizon (several episodes), γ (1 / (1 − γ) steps ahead matter), Adam's step size, noise at the start."""
    config = preset("common", "my task", policy=policy, seeds=seeds, epochs=epochs)
    return dataclasses.replace(
        config,
        policy=dataclasses.replace(config.policy, initial_std=0.4),
        algorithm=dataclasses.replace(config.algorithm, horizon=512, gamma=0.95, learning_rate=1e-3),
    )


def told(mean: Estimate, lead: Estimate | None) -> str:
    """Say a row of the table."""
    first = f"{mean.value:8.1f} [{mean.low:.1f}, {mean.high:.1f}]"
    return first if lead is None else f"{first}   {lead.value:+.1f} [{lead.low:+.1f}, {lead.high:+.1f}]"


def main(arguments: Sequence[str] | None = None) -> None:
    """Check, play what needs no learning, train, compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--policy", default="logit-normal", choices=FAMILIES)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--epochs", type=int, default=60)
    parser.add_argument("--out", metavar="FOLDER", help="where to keep the run; nowhere by default")
    asked = parser.parse_args(arguments)
    if asked.seeds < 2:
        parser.error(f"--seeds {asked.seeds}: an interval needs two at least")

    for check, wrong in complaints(make_envs).items():
        raise SystemExit(f"check {check!r}: {wrong}")
    best_constant, _ = best_of(CONSTANTS, make_envs, CHOSEN_BY)
    best_rule, _ = best_of(RULES, make_envs, CHOSEN_BY)
    by_hand = {"nothing": NOTHING, best_constant: CONSTANTS[best_constant], best_rule: RULES[best_rule]}
    returns = {name: play(act, make_envs, TESTED) for name, act in by_hand.items()}

    run = train(plan(asked.policy, asked.seeds, asked.epochs), run_dir=asked.out, make_envs=make_envs)
    if asked.out:
        save_run(asked.out, run)  # load_policy(asked.out).act(obs, greedy="median") uses it
    for way, acting in (("greedy", greedy), ("noisy", noisy)):
        each = [play(acting(policy), make_envs, TESTED) for policy in run.policies]
        returns[f"{asked.policy}, {way}"] = np.stack(each)

    print(f"{'return of a day':>36}   lead over {best_rule!r}")
    for name, row in compare(returns, best_rule).items():
        print(f"{name:24}{told(*row)}")


if __name__ == "__main__":
    main()
