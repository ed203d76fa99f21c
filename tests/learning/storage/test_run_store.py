import copy
import dataclasses
import json
import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import safetensors
import safetensors.numpy
import torch
from safetensors.numpy import load_file
from scipy import stats

from inbounds.distributions import LogitNormal
from inbounds.learning import Trainer, preset
from inbounds.learning.storage.run_metadata import METADATA_KEY, config_from, metadata_of
from inbounds.learning.storage.run_store import (
    COLUMNS,
    config_of,
    load_checkpoint,
    load_policies,
    load_policy,
    read_curves,
    save_policies,
    save_run,
)
from inbounds.learning.storage.trained_policy import TrainedPolicy
from inbounds.learning.storage.whole_files import DamagedFileError, write_whole
from tests.learning.small import ALGORITHMS, FAMILIES, rng, small_config, small_run


def saved_run(folder: Path, *args: object, **kwargs: object) -> Trainer:
    trainer = small_run(small_config(*args, **kwargs))
    save_run(folder, trainer)
    return trainer


# ---- curves


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_curves_are_the_records(algo: str, tmp_path: Path) -> None:
    trainer = saved_run(tmp_path, algo, seeds=(4, 9))
    curves = read_curves(tmp_path)
    assert curves["seed"].to_pylist() == [4, 9, 4, 9]
    assert curves["epoch"].to_pylist() == [0, 0, 1, 1]
    assert set(curves.column_names) == trainer.records[0].keys() | {"seed"}
    assert set(curves.column_names) <= COLUMNS.keys()  # nothing undocumented
    for name in curves.column_names:
        if name != "seed":
            told = [np.broadcast_to(record[name], 2) for record in trainer.records]
            assert np.array_equal(curves[name].to_numpy(), np.concatenate(told), equal_nan=True)
    assert config_of(curves) == trainer.config


def test_columns_say_what_they_mean_and_floats_are_split_and_compressed(tmp_path: Path) -> None:
    saved_run(tmp_path)
    file = pq.ParquetFile(tmp_path / "curves.parquet")
    group = file.metadata.row_group(0)
    for i, field in enumerate(file.schema_arrow):
        column = group.column(i)
        assert field.type == COLUMNS[field.name][0]
        assert field.metadata[b"meaning"].decode() == COLUMNS[field.name][1]
        assert column.compression == "ZSTD"
        assert ("BYTE_STREAM_SPLIT" in column.encodings) == (str(field.type) == "double")


# ---- policies


@pytest.mark.parametrize("family", FAMILIES)
def test_policies_come_back_bit_for_bit(family: str, tmp_path: Path) -> None:
    trainer = saved_run(tmp_path, family=family, dtype="float64")
    obs = rng().normal(size=(5, 3))
    for before, after in zip(trainer.policies, load_policies(tmp_path), strict=True):
        assert before.greedy_choices == after.greedy_choices
        for greedy in before.greedy_choices:
            a, b = (policy.act(obs, greedy, rng(1)) for policy in (before, after))
            assert np.array_equal(a, b)
            assert (np.abs(a) <= 1).all()


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda policy: pickle.loads(pickle.dumps(policy))])
def test_a_copy_acts_as_its_original_and_has_weights_of_its_own(duplicate: Any, tmp_path: Path) -> None:
    saved_run(tmp_path, family="beta")
    policy, obs = load_policy(tmp_path), rng().normal(size=(4, 3))
    twin, before = duplicate(policy), policy.act(obs)
    assert np.array_equal(twin.act(obs), before)
    assert str(twin) == str(policy)
    twin._network.theta.zero_()
    assert np.array_equal(policy.act(obs), before)
    assert not np.array_equal(twin.act(obs), before)


def test_no_states_have_no_actions(tmp_path: Path) -> None:
    saved_run(tmp_path, family="beta")
    policy, none = load_policy(tmp_path), np.empty((0, 3))
    for way in policy.greedy_choices:
        assert policy.act(none, way).shape == (0, 2)
    assert policy.distribution(none).batch_shape == (0, 2)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_diverged_policy_stays_in_the_middle_though_some_weights_are_finite(
    family: str, tmp_path: Path
) -> None:
    trainer = saved_run(tmp_path, family=family)
    tensors = trainer.tensors()
    tensors["policy.2.bias"][0, 0] = np.nan  # of the first motor alone
    tensors["policy.0.weight"][0] = np.inf  # which a network that is asked makes NaN of, with a warning
    tensors["diverged"][0] = True
    policy = TrainedPolicy.from_tensors(trainer.config, tensors, 0)
    for way in policy.greedy_choices:
        assert policy.act(rng().normal(size=3), way).tolist() == [0.0, 0.0]
    with pytest.raises(ValueError, match="the policy has diverged"):
        policy.distribution(rng().normal(size=3))
    trainer.diverged[0] = True
    save_run(tmp_path / "a" / "new folder", trainer)
    with pytest.warns(RuntimeWarning, match="seed 0 diverged in training: its policy always"):
        assert load_policy(tmp_path / "a" / "new folder").diverged
    assert not load_policy(tmp_path / "a" / "new folder", 1).diverged


def test_a_file_that_may_not_be_read_is_not_called_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    saved_run(tmp_path, family="beta")

    def refuse(path: Path, mode: str) -> None:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(PermissionError, match="policies"):
        load_policies(tmp_path)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_policy_acts_as_its_network_did_in_training(family: str, tmp_path: Path) -> None:
    trainer = saved_run(tmp_path, family=family)
    seen = trainer.collector.obs  # [S, O], normalised
    outputs = trainer.networks.actor.act(seen)
    raw = np.column_stack([trainer.envs.x, trainer.envs.elapsed / 20])
    for s, policy in enumerate(load_policies(tmp_path)):
        expected = trainer.networks.policy.greedy(torch.from_numpy(outputs[s]), "mean")
        assert np.array_equal(policy.act(raw[s], "mean"), expected.astype(policy.low.dtype))


def test_the_file_alone_is_enough_to_act(tmp_path: Path) -> None:
    """The stored tensors, a forward pass written out, and the median of a logit-normal: tanh(loc / 2)."""
    saved_run(tmp_path, family="logit-normal")
    stored = load_file(tmp_path / "policies.safetensors")
    obs, s = rng().normal(size=3), 2
    h = (obs - stored["normalizer.mean"][s]) / np.sqrt(stored["normalizer.variance"][s] + 1e-8)
    for i in range(3):
        h = stored[f"policy.{i}.weight"][s] @ h + stored[f"policy.{i}.bias"][s]
        h = np.tanh(h) if i < 2 else h
    np.testing.assert_allclose(load_policy(tmp_path, s).act(obs), np.tanh(h[:2] / 2), rtol=1e-5)
    with safetensors.safe_open(tmp_path / "policies.safetensors", "np") as file:
        metadata = json.loads(file.metadata()["inbounds"])
    assert metadata["config"]["policy"]["family"] == "logit-normal"
    assert {"torch", "mujoco", "numpy"} <= metadata["versions"].keys()


def test_a_seed_does_for_a_generator(tmp_path: Path) -> None:
    saved_run(tmp_path, family="logit-normal")
    policy, obs = load_policy(tmp_path), np.array([0.3, -0.2, 0.5])
    drawn = policy.act(obs, "sample", 7)
    np.testing.assert_array_equal(drawn, policy.act(obs, "sample", np.random.default_rng(7)))


def test_a_run_without_an_epoch_has_no_curves(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="a run without an epoch has no curves"):
        save_run(tmp_path, Trainer(preset("common", "Swimmer-v5", seeds=1)))
    assert not list(tmp_path.iterdir())


def test_samples_follow_the_law(tmp_path: Path) -> None:
    saved_run(tmp_path, family="logit-normal")
    policy = load_policy(tmp_path)
    obs = np.tile([0.3, -0.2, 0.5], (4000, 1))
    drawn = policy.act(obs, "sample", rng())
    outputs = torch.from_numpy(policy._network.act(policy._normalizer(obs[:1]))).double()
    law = LogitNormal(outputs[0, :2], outputs[0, 2:].exp(), -1.0, 1.0)
    for a in range(2):
        one = LogitNormal(law.loc[a], law.scale[a], -1.0, 1.0)
        assert (
            stats.kstest(drawn[:, a], lambda x, one=one: one.cdf(torch.from_numpy(x)).numpy()).pvalue > 1e-3
        )


def test_a_batch_is_its_rows_and_the_default_is_the_median(tmp_path: Path) -> None:
    saved_run(tmp_path, family="logit-normal")
    policy = load_policy(tmp_path)
    obs = rng().normal(size=(4, 3))
    batch = policy.act(obs)
    assert np.array_equal(batch, [policy.act(row, "median") for row in obs])
    assert batch.shape == (4, 2)
    assert not np.allclose(batch, policy.act(obs, "mode"))


def test_without_normalisation(tmp_path: Path) -> None:
    trainer = saved_run(tmp_path, normalize_obs=False)
    obs = rng().normal(size=(1, 3)).astype(np.float32)
    outputs = torch.from_numpy(trainer.networks.actor.act(np.repeat(obs, 3, 0)))
    expected = trainer.networks.policy.greedy(outputs[1], "mean").astype(np.float64)
    assert np.array_equal(load_policy(tmp_path, 1).act(obs[0], "mean"), expected)


def test_a_run_in_raw_mode_may_leave_the_box(tmp_path: Path) -> None:
    for mode, leaves in (("raw", True), ("clip", False)):
        saved_run(tmp_path, action_mode=mode)
        policy = load_policy(tmp_path)
        drawn = policy.act(np.zeros((500, 3)), "sample", rng())
        assert (np.abs(drawn) > 1).any() == leaves
        assert (np.abs(policy.act(np.zeros(3), "mean")) <= 1).all()


@pytest.mark.parametrize("family", FAMILIES)
def test_a_distribution_is_of_the_action_in_that_state(family: str, tmp_path: Path) -> None:
    saved_run(tmp_path, family=family, action_mode="clip")
    policy = load_policy(tmp_path)
    obs = rng().normal(size=(4, 3))
    law = policy.distribution(obs)
    assert np.allclose(law.mode.clip(-1, 1), policy.act(obs, "mode"), atol=1e-6)
    single = policy.distribution(obs[1])
    assert single.mean.shape == (2,)
    assert np.allclose(single.mean, law.mean[1], atol=1e-6)
    drawn = policy.act(np.tile(obs[1], (4000, 1)), "sample", rng())
    again = single.sample((4000,)).clip(-1, 1).numpy()
    assert stats.ks_2samp(drawn[:, 0], again[:, 0]).pvalue > 1e-3
    with pytest.raises(ValueError, match=r"shape \[3\] or \[B, 3\], got \[4\]"):
        policy.distribution(np.zeros(4))


def test_what_is_asked_of_a_policy_wrongly(tmp_path: Path) -> None:
    saved_run(tmp_path)
    policy = load_policy(tmp_path)
    with pytest.raises(ValueError, match=r"shape \[3\] or \[B, 3\], got \[4\]"):
        policy.act(np.zeros(4))
    with pytest.raises(ValueError, match=r"NaN or infinite.*look at the sensor"):
        policy.act(np.array([[0.0, 0.0, 0.0], [0.0, np.nan, 0.0]]))
    with pytest.raises(ValueError, match="choose one of mean, median, mode, sample"):
        policy.act(np.zeros(3), "best")
    with pytest.raises(IndexError, match="a seed index from 0 to 2"):
        load_policy(tmp_path, 3)
    with pytest.raises(FileNotFoundError, match="train a run first"):
        load_policy(tmp_path / "nowhere")
    assert repr(policy) == "<TrainedPolicy: gaussian, ppo, point, seed 0>"


def test_another_configuration_in_the_policies_file_is_damage(tmp_path: Path) -> None:
    path = tmp_path / "policies.safetensors"
    save_policies(path, small_run(small_config(seeds=2)))
    with safetensors.safe_open(path, "np") as file:
        about = json.loads(file.metadata()[METADATA_KEY])
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    for name, value in {"seeds": [0, 9], "env": "point-v2"}.items():
        changed = about | {"config": about["config"] | {name: value}}
        safetensors.numpy.save_file(tensors, path, {METADATA_KEY: json.dumps(changed)})
        with pytest.raises(DamagedFileError, match="its checksum is wrong"):
            load_policies(path)
    del changed["sha256_config"]  # as an older file
    safetensors.numpy.save_file(tensors, path, {METADATA_KEY: json.dumps(changed)})
    assert load_policies(path)[0].config.env == "point-v2"


@pytest.mark.parametrize(("old", "new"), [(b'"dtype":"F32"', b'"dtype":"I32"'), (b"[2,4,3]", b"[2,3,4]")])
def test_another_type_or_shape_in_the_policies_file_is_damage(tmp_path: Path, old: bytes, new: bytes) -> None:
    path = tmp_path / "policies.safetensors"
    config = small_config(seeds=2, dtype="float32", hidden=(4,))
    save_policies(path, small_run(config))
    written = path.read_bytes()
    assert old in written
    path.write_bytes(written.replace(old, new, 1))
    with pytest.raises(DamagedFileError, match="its checksum is wrong"):
        load_policies(path)


@pytest.mark.parametrize("normalised", [True, False])
def test_an_observation_beyond_single_precision(normalised: bool) -> None:
    """Normalised, it is clipped as any large one; as it is, it would become infinite."""
    config = dataclasses.replace(small_config(seeds=1), normalize_obs=normalised)
    policy = small_run(config).policies[0]
    if normalised:
        assert np.isfinite(policy.act(np.full(3, 1e39))).all()
    else:
        with pytest.raises(ValueError, match="an observation is NaN or infinite"):
            policy.act(np.full(3, 1e39))


def test_files_of_another_origin(tmp_path: Path) -> None:
    path = tmp_path / "policies.safetensors"
    safetensors.numpy.save_file({"weight": np.zeros(3)}, path)
    with pytest.raises(DamagedFileError, match="of another origin"):
        load_policies(path)
    safetensors.numpy.save_file({"weight": np.zeros(3)}, path, {METADATA_KEY: "null"})
    with pytest.raises(DamagedFileError, match="inbounds did not write it"):
        load_policies(path)
    torch.save({"epoch": 3}, tmp_path / "checkpoint.pt")
    with pytest.raises(DamagedFileError, match="it holds no run"):
        load_checkpoint(tmp_path)


def test_a_file_that_cannot_be_written_leaves_the_old_one_and_no_rest(tmp_path: Path) -> None:
    write_whole(tmp_path / "file", b"old")
    with pytest.raises(TypeError):
        write_whole(tmp_path / "file", "no bytes")
    assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == [("file", b"old")]


def test_two_writers_of_one_file_do_not_meet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, real = tmp_path / "file", os.fsync

    def another_writes_meanwhile(file: int) -> None:
        monkeypatch.setattr(os, "fsync", real)
        write_whole(path, b"the other's, and longer")
        real(file)

    monkeypatch.setattr(os, "fsync", another_writes_meanwhile)
    write_whole(path, b"ours")
    assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == [("file", b"ours")]


@pytest.mark.parametrize("algo", ALGORITHMS)
@pytest.mark.parametrize("name", ["common", "as-printed"])
def test_a_configuration_survives_its_file(algo: str, name: str, tmp_path: Path) -> None:
    numbers = {"horizon": 64, "policy": {"initial_std": 0.3}, "hidden": (4,)}
    trainer = saved_run(tmp_path, algo, name=name, epochs=1, seeds=[3, 5], **numbers)
    assert load_policy(tmp_path).config == trainer.config
    assert preset(name, algo=algo).policy != trainer.config.policy


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": 2}, "format 2: update inbounds"),
        ({"format": "2"}, "format '2', which is no number: inbounds did not write it"),
        ({"config": {"gain": 2.0}}, r"inbounds 9\.9 wrote the file.*'gain'.*update inbounds"),
        (
            {"config": {"algorithm_name": "rocket"}},
            r"inbounds 9\.9 wrote the file.*'rocket'.*update inbounds",
        ),
        ({"config": {"engine": "gpu"}}, r"inbounds 9\.9 wrote the file.*'gpu'.*update inbounds"),
    ],
)
def test_a_file_of_another_version_says_so(change: dict, said: str) -> None:
    metadata = json.loads(metadata_of(small_config(epochs=1)))
    metadata["versions"]["inbounds"] = "9.9"
    changed = metadata | change | {"config": metadata["config"] | change.get("config", {})}
    with pytest.raises(ValueError, match=said):
        config_from(changed)
