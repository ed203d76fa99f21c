"""What is no box for a bounded law is refused, and the remedy that the message names is one."""

import re
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from inbounds.distributions import LogitNormal
from inbounds.distributions.bounds import require_bounds
from inbounds.distributions.boxes import require_box
from inbounds.learning import Trainer
from tests.learning.small import small_config


class Heard(gymnasium.Env):
    """Every action must be one of its own."""

    def __init__(self, action_space: spaces.Space, observation_space: spaces.Space | None = None) -> None:
        self.action_space = action_space
        self.observation_space = observation_space or spaces.Box(-1.0, 1.0, (1,), np.float32)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict]:
        self.observation_space.seed(0)
        return self.observation_space.sample(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict]:
        assert self.action_space.contains(action), action
        return self.observation_space.sample(), 0.0, False, False, {}


WIDE, UNIT = spaces.Box(-3.0, 3.0, (2,), np.float32), spaces.Box(-1.0, 1.0, (1,), np.float32)
CASES = {
    "discrete": (spaces.Discrete(3), UNIT, "bounded, one-dimensional Box"),
    "integers": (spaces.Box(-3, 3, (2,), np.int32), WIDE, "real numbers"),
    "too wide": (
        spaces.Box(-1.7e308, 1.7e308, (2,), np.float64),
        spaces.Box(-3.0, 3.0, (2,), np.float64),
        "a finite range",
    ),
    "matrix": (spaces.Box(-3.0, 3.0, (1, 2), np.float32), WIDE, "one-dimensional Box"),
    "unbounded": (spaces.Box(-np.inf, np.inf, (2,), np.float32), WIDE, "finite bounds"),
    "half bounded": (spaces.Box(np.float32([0, -9]), np.float32([np.inf, 9])), None, "finite bounds"),
    "no room": (spaces.Box(np.float32([-1, 2]), np.float32([1, 2])), WIDE, "component 1 has no room"),
}


def test_a_box_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one component"):
        require_box(spaces.Box(-1.0, 1.0, (0,), np.float32))


@pytest.mark.parametrize(("space", "box", "rule"), CASES.values(), ids=CASES)
def test_the_remedy_that_a_refusal_names_works(
    space: spaces.Space, box: spaces.Box | None, rule: str
) -> None:
    with pytest.raises(ValueError, match=re.escape(rule)) as caught:
        require_box(space)
    (remedy,) = re.findall(
        r"gymnasium\.wrappers\.\w+\((?:[^()]|\((?:[^()]|\([^()]*\))*\))*\)", str(caught.value)
    )
    names = {
        "env": Heard(space),
        "box": box or spaces.Box(np.float32([0, -9]), np.float32([9, 9])),
        "function": lambda action: int(np.rint(action[0])) + 1,
        "low": getattr(space, "low", None),
        "high": getattr(space, "high", None),
    }
    scope = {"gymnasium": gymnasium, "np": np, **names}
    exec(
        f"env = {remedy}", scope
    )  # by the name that a reader has, which the remedy's function must not rely on
    env = scope["env"]
    require_box(env.action_space)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for action in rng.uniform(env.action_space.low, env.action_space.high, (20, *env.action_space.shape)):
        env.step(action.astype(env.action_space.dtype))


def test_every_name_of_gymnasium_in_the_source_exists() -> None:
    """Also in messages and docstrings."""
    from tests.test_architecture import MODULES

    found = {
        name
        for path in MODULES
        for name in re.findall(r"gymnasium\.(wrappers(?:\.\w+)+)", path.read_text("utf8"))
    }
    assert {"wrappers.TransformAction", "wrappers.FlattenObservation"} <= found
    for name in found:
        module, _, attribute = f"gymnasium.{name}".rpartition(".")
        assert hasattr(__import__(module, fromlist=[attribute]), attribute), name


@pytest.mark.parametrize(
    ("space", "flat"),
    [(spaces.Discrete(5), 5), (spaces.Dict(a=spaces.Box(0.0, 1.0, (2,)), b=spaces.Discrete(2)), 4)],
    ids=["discrete", "dict"],
)
def test_the_remedy_for_observations_works(space: spaces.Space, flat: int) -> None:
    def vector(wrap: Callable[[gymnasium.Env], gymnasium.Env]) -> Callable[[int], SyncVectorEnv]:
        makers = [lambda: wrap(Heard(UNIT, space))]
        return lambda n: SyncVectorEnv(makers * n, autoreset_mode=AutoresetMode.SAME_STEP)

    config = small_config(seeds=2, horizon=32)
    with pytest.raises(ValueError, match=r"gymnasium\.wrappers\.FlattenObservation"):
        Trainer(config, vector(lambda env: env))
    trainer = Trainer(config, vector(gymnasium.wrappers.FlattenObservation))
    trainer.epoch()
    assert trainer.rollout is not None
    assert trainer.rollout.obs.shape == (2, 32, flat)


def test_bounds_are_kept_apart_from_the_callers_memory() -> None:
    low = np.array([-1.0, -1.0], np.float32)
    kept, _ = require_bounds(low, np.broadcast_to(np.float32(1), 2))  # the second may not be written to
    low[0] = -5
    assert kept.tolist() == [-1.0, -1.0]


def test_a_numpy_number_adapts_as_any_number_does() -> None:
    assert LogitNormal(torch.zeros(2), np.exp(-0.5)).mean.dtype == torch.float32
    assert LogitNormal(torch.zeros(2), np.array(0.6)).mean.dtype == torch.float64
