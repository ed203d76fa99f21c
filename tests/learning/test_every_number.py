"""Each number of a configuration has a say in what is learned: with another one the weights are others."""

import dataclasses
import functools
from collections.abc import Iterator
from typing import Any

import pytest
import torch

from inbounds.learning import TrainConfig
from tests.learning.small import ALGORITHMS, small_config, small_run, weights

NO_SAY = {"env", "checkpoint_every"}
"""The tests' own world stands in for the environment; a checkpoint is only a copy."""
OTHER: dict[str, Any] = {
    "env": "Hopper-v5",
    "seeds": (0, 2),
    "epochs": 2,
    "normalize_obs": False,
    "action_mode": "raw",
    "engine": "compiled",
    "checkpoint_every": 1,
    "algorithm.horizon": 96,
    "algorithm.learning_rate": 1e-3,
    "algorithm.policy_learning_rate": 1e-2,
    "algorithm.adam_eps": 1e-3,
    "algorithm.num_epochs": 3,
    "algorithm.minibatch_size": 16,
    "algorithm.gamma": 0.9,
    "algorithm.gae_lambda": 0.5,
    "algorithm.clip_range": 1e-4,
    "algorithm.entropy_coef": 0.1,
    "algorithm.value_coef": 0.1,
    "algorithm.normalize_advantage": False,
    "algorithm.max_grad_norm": 0.01,
    "algorithm.max_kl": 1e-3,
    "algorithm.cg_iters": 1,
    "algorithm.damping": 1.0,
    "algorithm.backtrack_coef": 0.9,
    "algorithm.max_backtracks": 1,
    "algorithm.fisher": "sampled",
    "policy.family": "logit-normal",
    "policy.limits.log_std_min": 0.5,
    "policy.limits.log_std_max": -0.5,
    "policy.limits.concentration_max": 1.5,
    "policy.state_dependent_std": False,
    "policy.initial_std": 0.4,
    "network.hidden_sizes": (8, 8),
    "network.initialization": "pytorch",
    "network.policy_head_gain": 0.1,
    "network.value_head_gain": 0.1,
    "network.dtype": "float64",
}
BETAS_OWN = "policy.limits.concentration_max"


def names(config: Any, before: str = "") -> Iterator[str]:
    for field in dataclasses.fields(config):
        value, name = getattr(config, field.name), before + field.name
        yield from names(value, f"{name}.") if dataclasses.is_dataclass(value) else (name,)


def changed(config: Any, name: str, value: Any) -> Any:
    part, _, rest = name.partition(".")
    return dataclasses.replace(
        config, **{part: changed(getattr(config, part), rest, value) if rest else value}
    )


@functools.cache
def usual(algo: str, engine: str, family: str) -> tuple[TrainConfig, torch.Tensor]:
    """A configuration, and the weights after its run; TRPO's line search is made to look twice."""
    numbers = {"max_kl": 1.0} if algo == "trpo" else {}
    config = small_config(algo, family, seeds=2, epochs=1, horizon=64, **numbers)
    config = dataclasses.replace(config, engine=engine)
    return config, weights(small_run(config))


CASES = [
    (algo, engine, name)
    for algo in ALGORITHMS
    for engine in ("autograd", "compiled")
    for name in names(small_config(algo))
    if name.startswith("algorithm.") or (algo, engine) == ("ppo", "autograd")
]


@pytest.mark.parametrize(("algo", "engine", "name"), CASES)
def test_another_number_teaches_other_weights(algo: str, engine: str, name: str) -> None:
    config, learned = usual(algo, engine, "beta" if name == BETAS_OWN else "gaussian")
    other = weights(small_run(changed(config, name, OTHER[name])))
    assert torch.equal(learned.double(), other.double()) is (name in NO_SAY)
