"""The engine `compiled`: one gradient step is autograd's, and a seed's run is its own."""

import copy
import dataclasses
import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import threadpoolctl
import torch

from inbounds.learning import DivergedSeedWarning, PPOConfig, TrainConfig, Trainer, ppo, train
from inbounds.learning.families.policy import FAMILIES as ALL_FAMILIES
from inbounds.learning.networks import compiled_acting, compiling, kernels
from inbounds.learning.networks.adam import SeedAdam
from inbounds.learning.storage import checkpoint
from inbounds.learning.training import prepare
from inbounds.learning.updates.compiled import CompiledAdam, ppo_passes_of, value_passes
from inbounds.learning.updates.engine import compiled_engine
from inbounds.learning.updates.value import fit_values
from tests.learning.made_up import SHAPES, made_up_networks, made_up_rollout
from tests.learning.point import PointEnv
from tests.learning.small import ALGORITHMS, FAMILIES, same_records, small_config, small_run, weights

STEPS = 64
TOLERANCE = {"float32": 3e-6, "float64": 2e-11}
"""Of a gradient, whose norm is at most 0.5 after clipping: the largest difference, as a share of its norm."""
OPTIONS: dict[str, dict[str, Any]] = {
    "common": {},
    "no clipping of gradients": {"max_grad_norm": None},
    "no normalisation": {"normalize_advantage": False},
    "no bonus": {"entropy_coef": 0.0},
    "a large bonus": {"entropy_coef": 0.3},
    "a narrow clip": {"clip_range": 0.02},
}


def compiled(config: TrainConfig) -> TrainConfig:
    return dataclasses.replace(config, engine="compiled")


def both_gradients(networks: Any, **numbers: Any) -> tuple[torch.Tensor, torch.Tensor]:
    """The clipped gradient of the first minibatch, by autograd and by the kernels, and the weights after it."""
    config = PPOConfig(**{"horizon": STEPS, "minibatch_size": STEPS, "num_epochs": 1} | numbers)
    rollout = made_up_rollout(networks, STEPS)
    twin = copy.deepcopy(networks)
    by_autograd = ppo.make_optimizer(networks, config)
    by_kernels = ppo.make_optimizer(twin, config, CompiledAdam)
    ppo.update(networks, by_autograd, rollout, [np.random.default_rng(0)], config)
    ppo.update(twin, by_kernels, rollout, [np.random.default_rng(0)], config)
    expected = torch.cat([network.padded.grad[0] for network in networks.networks])
    moments = by_kernels.state_dict()["moments"]  # after one step the first is a tenth of the gradient
    found = torch.from_numpy(np.concatenate([first for first, _ in moments])) * 10
    thetas = [torch.cat([n.theta[0] for n in nets.networks]) for nets in (networks, twin)]
    moved = (thetas[0] - thetas[1]).abs().max() / config.learning_rate
    return expected, found, moved


def agree(networks: Any, dtype: str, **numbers: Any) -> None:
    expected, found, moved = both_gradients(networks, **numbers)
    assert expected.norm() > 1e-3
    assert (expected - found).abs().max() <= TOLERANCE[dtype] * expected.norm()
    assert (
        moved < {"float32": 2e-2, "float64": 1e-6}[dtype]
    )  # of a step; Adam divides by a gradient that may be small


@pytest.mark.parametrize("option", OPTIONS)
@pytest.mark.parametrize("family", FAMILIES)
def test_a_gradient_step_is_autograds(family: str, option: str) -> None:
    """In float64, where they differ by less than 1e-12, and by the 1e-11 of torch's trigamma."""
    agree(made_up_networks(family, SHAPES["HalfCheetah"], "float64"), "float64", **OPTIONS[option])


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("family", FAMILIES)
def test_a_gradient_step_is_autograds_in_single_precision(family: str, shape: str) -> None:
    agree(made_up_networks(family, SHAPES[shape], "float32"), "float32")


@pytest.mark.parametrize("family", ["gaussian", "clipped-gaussian", "logit-normal"])
def test_a_free_scale_stays_free_of_the_state(family: str) -> None:
    networks = made_up_networks(family, SHAPES["Swimmer"], "float64", state_dependent_std=False)
    agree(networks, "float64", entropy_coef=0.1)
    head = networks.actor.layers[-1].weight
    assert (head[:, 2:] == 0).all()


@pytest.mark.parametrize("hidden", [(16,), (24, 40), (8, 16, 32)])
def test_networks_of_any_depth(hidden: tuple[int, ...]) -> None:
    agree(made_up_networks("gaussian", (5, 3), "float64", hidden), "float64")


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_a_step_of_the_value_regression_is_autograds(dtype: str) -> None:
    networks = made_up_networks("beta", SHAPES["HalfCheetah"], dtype)
    twin, rollout = copy.deepcopy(networks), made_up_rollout(networks, STEPS)
    by_autograd = SeedAdam([networks.critic], 1e-3, 1e-5, 0.5)
    by_kernels = CompiledAdam([twin.critic], 1e-3, 1e-5, 0.5)
    for nets, optimizer in ((networks, by_autograd), (twin, by_kernels)):
        fit_values(nets, optimizer, rollout, rollout.reward, [np.random.default_rng(0)], 1, STEPS)
    ((first, _),) = by_kernels.state_dict()["moments"]
    assert np.abs(first * 10 - networks.critic.padded.grad[0].numpy()).max() < TOLERANCE[dtype]


@pytest.mark.parametrize("family", FAMILIES)
def test_whole_runs_in_double_precision_are_autograds(family: str) -> None:
    """Two epochs of 16 gradient steps: minibatches, their order, Adam's moments and acting are the same."""
    config = small_config("ppo", family, dtype="float64")
    one, other = small_run(config), small_run(compiled(config))
    assert torch.allclose(weights(one), weights(other), rtol=0, atol=1e-9)
    assert one.records[-1].keys() == other.records[-1].keys()
    for name, value in one.records[-1].items():
        if name != "seconds":
            assert np.allclose(value, other.records[-1][name], rtol=1e-6, atol=1e-9, equal_nan=True), name


@pytest.mark.parametrize("algo", ["trpo", "policy-gradient"])
def test_the_other_algorithms_are_autograds(algo: str) -> None:
    config = small_config(algo, "logit-normal", dtype="float64")
    one, other = small_run(config), small_run(compiled(config))
    assert torch.allclose(weights(one), weights(other), rtol=0, atol=1e-7)
    assert one.records[-1].keys() == other.records[-1].keys()


# ---- a seed's run is its own


@pytest.mark.parametrize("algo", ALGORITHMS)
@pytest.mark.parametrize("family", FAMILIES)
def test_a_seed_alone_is_the_seed_in_company(algo: str, family: str) -> None:
    """To the last bit, which autograd does not promise of a seed alone."""
    together = small_run(compiled(small_config(algo, family, seeds=(4, 0, 9))))
    for s, seed in enumerate((4, 0, 9)):
        alone = small_run(compiled(small_config(algo, family, seeds=(seed,))))
        assert torch.equal(weights(alone)[0], weights(together)[s])
        for name, value in alone.records[-1].items():
            if name not in ("epoch", "env_steps", "seconds"):
                assert np.array_equal(value[0], together.records[-1][name][s], equal_nan=True), name


@pytest.mark.parametrize("algo", ["ppo", "trpo"])
@pytest.mark.parametrize("family", FAMILIES)
def test_a_nan_seed_leaves_the_others_alone_and_stays_one(algo: str, family: str) -> None:
    config = compiled(small_config(algo, family, epochs=3))
    sound = small_run(config)
    with pytest.warns(DivergedSeedWarning):
        poisoned = small_run(config, poisoned=(1,))
    for s in (0, 2):
        assert torch.equal(weights(sound)[s], weights(poisoned)[s])
    assert poisoned.records[0]["diverged"].tolist() == [False, True, False]
    assert poisoned.records[-1]["diverged"].tolist() == [False, True, False]
    assert not torch.isfinite(weights(poisoned)[1]).all()


def test_an_infinite_gradient_is_not_hidden() -> None:
    """Without `ninf` and `nnan` among the fast-math flags a comparison with NaN is one."""
    assert not {"ninf", "nnan", "fast"} & kernels.FAST
    networks = made_up_networks("gaussian", SHAPES["Swimmer"], "float32")
    rollout = made_up_rollout(networks, STEPS)
    rollout.reward[0, 5] = torch.inf
    config = PPOConfig(horizon=STEPS, minibatch_size=STEPS, num_epochs=1)
    optimizer = ppo.make_optimizer(networks, config, CompiledAdam)
    ppo.update(networks, optimizer, rollout, [np.random.default_rng(0)], config)
    assert not networks.finite()


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_a_resumed_run_is_the_run_that_was_never_interrupted(algo: str, tmp_path: Path) -> None:
    config = compiled(small_config(algo, "logit-normal", epochs=4))
    whole = small_run(config)
    half = small_run(dataclasses.replace(config, epochs=2))
    checkpoint.save(tmp_path / "checkpoint.pt", half.state_dict())
    resumed = Trainer(config, PointEnv)
    resumed.load_state_dict(checkpoint.load(tmp_path / "checkpoint.pt"))
    while not resumed.finished:
        resumed.epoch()
    assert torch.equal(weights(whole), weights(resumed))


def test_a_state_is_a_snapshot() -> None:
    run = small_run(compiled(small_config("ppo", "logit-normal", epochs=1)))
    state = run.state_dict()
    first = run.epoch()
    for _ in range(2):  # later epochs leave the state as it is
        run.load_state_dict(state)
        assert same_records([run.epoch()], [first])


def test_the_engine_cannot_be_changed_in_mid_run(tmp_path: Path) -> None:
    config = small_config(epochs=1)
    train(config, run_dir=tmp_path, make_envs=PointEnv)
    longer = dataclasses.replace(config, epochs=2, engine="compiled")
    with pytest.raises(ValueError, match="engine: autograd → compiled"):
        train(longer, run_dir=tmp_path, make_envs=PointEnv)


def test_a_checkpoint_without_the_field_is_autograds(tmp_path: Path) -> None:
    run = small_run(small_config(epochs=1))
    state = run.state_dict()
    del state["config"]["engine"]
    Trainer(small_config(epochs=2), PointEnv).load_state_dict(state)
    with pytest.raises(ValueError, match="engine"):
        Trainer(compiled(small_config(epochs=2)), PointEnv).load_state_dict(state)


# ---- what it needs


def test_without_numba_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "numba" else found(name))
    with pytest.raises(ValueError, match=r"needs numba, of the extra `fast`: pip install '\.\[fast\]'"):
        Trainer(compiled(small_config()), PointEnv)
    Trainer(small_config(), PointEnv)


def test_a_family_without_kernels_refuses(monkeypatch: pytest.MonkeyPatch) -> None:
    bare = dataclasses.replace(ALL_FAMILIES["gaussian"], kernels=None)
    with pytest.raises(ValueError, match="gaussian has no kernels"):
        compiled_engine(bare)


def test_an_engine_of_another_name_is_refused() -> None:
    with pytest.raises(ValueError, match="engine must be autograd or compiled, got 'torch'"):
        dataclasses.replace(small_config(), engine="torch")


def test_every_matrix_library_has_one_thread() -> None:
    """Also the one that numba's products call, which is loaded by then; torch's setting reaches neither."""
    small_run(compiled(small_config(epochs=1)))
    with compiled_engine(ALL_FAMILIES["beta"]).one_blas_thread():
        libraries = [one for one in threadpoolctl.threadpool_info() if one["user_api"] == "blas"]
        assert any("scipy" in one["filepath"] for one in libraries)
        assert {one["num_threads"] for one in libraries} == {1}


@pytest.mark.parametrize("algo", ["ppo", "trpo"])
def test_preparing_compiles_what_a_run_calls(algo: str) -> None:
    for made in (compiled_acting._outputs, compiled_acting._see, ppo_passes_of, value_passes):
        made.cache_clear()
    functions = compiling._refuse_to_compile().functions
    before, config = len(functions), compiled(small_config(algo))

    def known() -> list[Any]:
        return [function.signatures for function in functions[before:]]

    prepare(config, PointEnv)
    prepared = known()
    assert len(prepared) == 3  # outputs, statistics and a pass
    assert all(prepared)
    small_run(config)
    assert known() == prepared


def test_for_autograd_there_is_nothing_to_prepare() -> None:
    prepare(small_config(), lambda _: pytest.fail("it makes environments"))
