"""Steps of the Python environments, to be repeated in JavaScript: a state, what follows from one action in it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import closing
from typing import Any

import numpy as np

from inbounds.robots.vector_env import RobotVectorEnv
from inbounds.study.grid import Cell
from inbounds.study.store import StudyFolder

TOLERANCES: Mapping[str, float] = {"obs": 1e-9, "obs of Humanoid": 2e-4, "reward": 1e-6, "action": 1e-5}
"""How far a step in JavaScript may be off: an observation and a reward relative to 1 + their size, an action absolute.

Rewards and actions are computed in float32 here and in float64 there. Humanoid's contacts are solved by an iteration
that ends before it has converged, and MuJoCo's versions order it differently.
"""


def steps(cell: Cell, seed: int, count: int = 50, apart: int = 7) -> Iterator[dict[str, Any]]:
    """Yield recorded steps of a trained policy that acts with noise; where an episode ends, the next one goes on.

    Args:
        cell: which keeps its policies.
        seed: with which the policy was trained.
        count: how many steps.
        apart: env steps from one to the next.

    Yields:
        The state before it (`qpos`, `qvel`, `warmstart` of the solver, `position` as last rewarded, the
        observation `seen`), the greedy actions of the policy in it (`mean`, `median`, `mode`), the `action`
        executed, and what came of it (`obs`, `reward`, `terminated`).

    Example:
        >>> from inbounds.study.grid import select
        >>> cell, = select(["standard-hopper-ppo-beta"])
        >>> first, second = steps(cell, 0, count=2)
        >>> len(first["obs"]), len(first["action"]), first["terminated"]
        (11, 3, False)
    """
    policy = StudyFolder.shipped().load_policies(cell)[cell.config.seeds.index(seed)]
    rng = np.random.default_rng(seed)
    with closing(RobotVectorEnv(cell.config.env, 1)) as env:
        obs, _ = env.reset(seed=seed)
        for t in range(count * apart):
            action = policy.act(obs, "sample", rng)  # [1, A]
            before = _state(env) if t % apart == apart - 1 else None
            seen = obs
            obs, reward, terminated, _, infos = env.step(action)
            if before is not None:
                after = infos["final_obs"][0] if "final_obs" in infos else obs[0]
                ways = {way: policy.act(seen[0], way).tolist() for way in ("mean", "median", "mode")}
                yield (
                    before
                    | ways
                    | {
                        "seen": seen[0].tolist(),
                        "action": action[0].tolist(),
                        "obs": np.asarray(after, np.float64).tolist(),
                        "reward": float(reward[0]),
                        "terminated": bool(terminated[0]),
                    }
                )


def _state(env: RobotVectorEnv) -> dict[str, Any]:
    data = env.get_data(0)
    return {
        "qpos": data.qpos.tolist(),
        "qvel": data.qvel.tolist(),
        "warmstart": data.qacc_warmstart.tolist(),
        "position": env.get_state()["position"][0].tolist(),
    }
