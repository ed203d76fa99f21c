"""What a reader's own box may look like: its units do not matter, and neither does its asymmetry."""

from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.vector.utils import batch_space

from tests.learning.point import PointEnv
from tests.learning.small import ALGORITHMS, FAMILIES, small_config, small_run, weights

LOW, HIGH = np.array([-1.0, -0.5]), np.array([1.0, 2.0])
SCALE, SHIFT = np.array([1000.0, 0.01]), np.array([300.0, -7.0])


class OtherUnits(PointEnv):
    """The points, asked in other units: a' = α a + β."""

    def __init__(self, num_envs: int) -> None:
        super().__init__(num_envs, tuple(LOW), tuple(HIGH))
        self.single_action_space = gymnasium.spaces.Box(
            SCALE * LOW + SHIFT, SCALE * HIGH + SHIFT, dtype=np.float64
        )
        self.action_space = batch_space(self.single_action_space, num_envs)

    def step(self, actions: Any) -> Any:
        return super().step((actions - SHIFT) / SCALE)


@pytest.mark.parametrize("algo", ALGORITHMS)
@pytest.mark.parametrize("family", FAMILIES)
def test_a_box_is_a_choice_of_units(family: str, algo: str, monkeypatch: pytest.MonkeyPatch) -> None:
    config = small_config(algo, family, dtype="float64")
    ours = small_run(config, low=tuple(LOW), high=tuple(HIGH))
    monkeypatch.setattr("tests.learning.small.PointEnv", OtherUnits)
    theirs = small_run(config)
    assert torch.allclose(weights(ours), weights(theirs), rtol=1e-6, atol=1e-8)
    for mine, other in zip(ours.records, theirs.records, strict=True):
        assert np.array_equal(mine["saturation"], other["saturation"])
        assert np.allclose(mine["action_std"], other["action_std"])
        assert np.allclose(mine["return_mean"], other["return_mean"])
