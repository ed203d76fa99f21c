"""Small runs: seconds become milliseconds, the code stays the same."""

import dataclasses
from typing import Any

import numpy as np
import torch

from inbounds.learning import TrainConfig, Trainer, preset
from tests.learning.point import PointEnv

FAMILIES = ("gaussian", "clipped-gaussian", "beta", "logit-normal")
ALGORITHMS = ("ppo", "trpo", "policy-gradient")


def small_config(
    algo: str = "ppo",
    family: str = "gaussian",
    *,
    name: str = "common",
    seeds: Any = 3,
    epochs: int = 2,
    horizon: int = 128,
    dtype: str = "float32",
    hidden: tuple[int, ...] = (16, 16),
    policy: dict[str, Any] | None = None,
    action_mode: str = "clip",
    normalize_obs: bool | None = None,
    **algorithm: Any,
) -> TrainConfig:
    config = preset(name, "point", policy=family, algo=algo, seeds=seeds, epochs=epochs)
    numbers = {"horizon": horizon, "minibatch_size": 32, "num_epochs": 2} | algorithm
    return dataclasses.replace(
        config,
        algorithm=dataclasses.replace(config.algorithm, **numbers),
        network=dataclasses.replace(config.network, dtype=dtype, hidden_sizes=hidden),
        policy=dataclasses.replace(config.policy, **(policy or {})),
        action_mode=action_mode,
        normalize_obs=config.normalize_obs if normalize_obs is None else normalize_obs,
    )


def small_run(config: TrainConfig, **env: Any) -> Trainer:
    trainer = Trainer(config, lambda n: PointEnv(n, **env))
    for _ in range(config.epochs):
        trainer.epoch()
    return trainer


def weights(trainer: Trainer) -> torch.Tensor:
    """All weights of a run, a row per seed."""
    return torch.cat([net.theta for net in trainer.networks.networks], 1)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def same_records(a: list[dict], b: list[dict], rows: slice | list[int] = slice(None)) -> bool:
    """Whether two runs' records agree bitwise (NaN equals NaN), wall time apart."""
    timeless = [key for key in a[0] if key != "seconds"]
    return all(
        np.array_equal(np.atleast_1d(x[key])[rows], np.atleast_1d(y[key])[rows], equal_nan=True)
        if np.ndim(x[key])
        else x[key] == y[key]
        for x, y in zip(a, b, strict=True)
        for key in timeless
    )
