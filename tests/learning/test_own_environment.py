"""What a reader's own box may look like: its units do not matter, and neither does its asymmetry."""

import dataclasses
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.vector import VectorActionWrapper
from gymnasium.vector.utils import batch_space

from inbounds import robots
from inbounds.learning import (
    PolicyConfig,
    PPOConfig,
    TrainConfig,
    Trainer,
    executed_std,
    preset,
    read_curves,
    save_run,
    train,
)
from inbounds.learning.families.policy import Policy
from inbounds.learning.storage.run_store import config_of, save_policies
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


class Squash(VectorActionWrapper):
    """A map of one's own, into the box of the robots."""

    def actions(self, actions: Any) -> Any:
        return np.tanh(actions)


class HidesAGenerator(PointEnv):
    """Its state holds what no checkpoint keeps."""

    def _get_state(self) -> Any:
        return {"rng": np.random.default_rng(0)}


def test_a_state_that_no_checkpoint_keeps_is_told_before_the_first_epoch(tmp_path: Path) -> None:
    epochs: list[int] = []
    with pytest.raises(TypeError, match=r"cannot keep state\['collector'\]\['envs'\]\['rng'\]"):
        train(
            small_config(),
            run_dir=tmp_path,
            make_envs=HidesAGenerator,
            callback=lambda trainer, _: epochs.append(len(trainer.records)),
        )
    assert epochs == []


def test_environments_do_not_clip_behind_a_raw_configuration() -> None:
    config = small_config(action_mode="raw")
    with pytest.raises(ValueError, match='action_mode="raw": make the environments with it, too'):
        Trainer(config, lambda n: robots.make("Hopper-v5", n))
    assert Trainer(config, lambda n: robots.make("Hopper-v5", n, action_mode="raw")).config == config
    squashed = Trainer(
        config, lambda n: Squash(robots.make("Hopper-v5", n))
    )  # which maps actions into the box
    assert np.isfinite(squashed.epoch()["kl"]).all()


def test_a_run_that_is_longer_than_what_is_asked_for_keeps_its_length(tmp_path: Path) -> None:
    config = small_config(epochs=3)
    for epochs in (3, 1):
        run = train(dataclasses.replace(config, epochs=epochs), run_dir=tmp_path, make_envs=PointEnv)
        save_run(tmp_path, run)
        curves = read_curves(tmp_path)
        assert config_of(curves).epochs == 3
        assert curves.num_rows == 3 * len(config.seeds)


def test_what_is_of_another_type_or_size_is_named() -> None:
    with pytest.raises(ValueError, match="learning_rate must be a number, got '3e-4'"):
        PPOConfig(learning_rate="3e-4")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="learning_rate must be a number, got None"):
        PPOConfig(learning_rate=None)  # type: ignore[arg-type]
    for env in (None, 3, ""):
        with pytest.raises(ValueError, match=f"env must be the id of an environment, got {env!r}"):
            TrainConfig(env)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="state_dependent_std must be True or False"):
        PolicyConfig("gaussian", state_dependent_std="false")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="limits must be a Limits"):
        PolicyConfig("beta", limits={"concentration_max": 20.0})  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="initial_std must be positive"):
        PolicyConfig("beta", initial_std=0.0)
    for scale in (1e8, 1e9, 1e10, 1e20, 1e150):  # a law of two bounds
        assert executed_std("gaussian", scale) == pytest.approx(1.0, abs=1e-7)
    assert executed_std("logit-normal", 1e8) <= 1.0
    assert executed_std("gaussian", 1e-200) == pytest.approx(0.0, abs=1e-150)
    with pytest.raises(ValueError, match="a scale must be positive"):
        executed_std("gaussian", 0.0)
    with pytest.raises(ValueError, match="3 action dimensions take 6 outputs, not 2"):
        Policy(PolicyConfig(), -np.ones(3), np.ones(3)).greedy(torch.zeros(5, 2), "mean")


def test_a_seed_that_a_run_does_not_have_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"the run has the seeds \[0, 1, 2\], not \[7\]"):
        save_policies(tmp_path / "policies", Trainer(small_config(), PointEnv), seeds=[7])
    assert not list(tmp_path.iterdir())


def test_who_forgets_to_pass_the_environment_is_told_to() -> None:
    with pytest.raises(gymnasium.error.Error) as caught:
        train(preset("common", "greenhouse", seeds=1, epochs=1))
    assert any("pass make_envs= beside 'greenhouse'" in note for note in caught.value.__notes__)


def test_a_robot_without_its_version_is_not_taken_for_gymnasiums() -> None:
    with pytest.raises(ValueError, match="HalfCheetah names no version: ask for HalfCheetah-v5"):
        train(preset("common", "HalfCheetah", seeds=1, epochs=1))
