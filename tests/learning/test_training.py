import contextlib
import copy
import dataclasses
import enum
import functools
import json
import math
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import threading
import warnings
from collections import deque
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.vector import VectorWrapper
from gymnasium.wrappers.vector import NormalizeReward

from inbounds import robots
from inbounds.learning import (
    DivergedSeedWarning,
    PPOConfig,
    TrainConfig,
    Trainer,
    TRPOConfig,
    load_policies,
    preset,
    save_run,
    train,
    training,
)
from inbounds.learning.families.family import Limits
from inbounds.learning.storage import checkpoint
from inbounds.learning.storage.run_metadata import metadata_of
from inbounds.learning.storage.whole_files import DamagedFileError, held
from inbounds.learning.training import prepare
from tests.learning.point import PointEnv
from tests.learning.small import ALGORITHMS, FAMILIES, same_records, small_config, small_run, weights

# ---- a seed's run is its own


@pytest.mark.parametrize("algo", ALGORITHMS)
@pytest.mark.parametrize("family", FAMILIES)
def test_a_poisoned_seed_harms_no_other(algo: str, family: str) -> None:
    healthy = small_run(small_config(algo, family))
    with pytest.warns(DivergedSeedWarning, match=r"seeds \[1\] diverged in epoch 0.*mend the environment"):
        poisoned = small_run(small_config(algo, family), poisoned=(1,))
    assert torch.equal(weights(healthy)[[0, 2]], weights(poisoned)[[0, 2]])
    assert same_records(healthy.records, poisoned.records, [0, 2])
    assert poisoned.records[-1]["diverged"].tolist() == [False, True, False]
    assert np.isnan(poisoned.records[-1]["kl"][1])


@pytest.mark.parametrize("algo", ALGORITHMS)
@pytest.mark.parametrize("family", ["logit-normal", "beta"])
def test_a_seed_does_not_see_its_neighbours_nor_its_row(algo: str, family: str) -> None:
    """Bitwise with other seeds beside it, in another row, and among ten."""
    runs = [
        weights(small_run(small_config(algo, family, seeds=s)))
        for s in ((0, 1, 2), (1, 8, 9), tuple(range(10)))
    ]
    assert torch.equal(runs[0][1], runs[1][0])
    assert torch.equal(runs[0], runs[2][:3])
    assert not torch.equal(runs[0][0], runs[0][1])


@pytest.mark.parametrize("algo", ALGORITHMS)
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_a_seed_alone_is_the_same_up_to_rounding(algo: str, dtype: str) -> None:
    """One row takes another path through the matrix library: equal to a few units in the last place."""
    together = weights(small_run(small_config(algo, "logit-normal", dtype=dtype)))
    alone = weights(small_run(small_config(algo, "logit-normal", dtype=dtype, seeds=(1,))))
    tolerance = {"float32": 1e-5, "float64": 1e-13}[dtype]
    assert torch.allclose(alone[0], together[1], rtol=tolerance, atol=tolerance)


def test_a_run_computes_on_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its first weights, its steps and its update, whatever torch is set to, which it is again afterwards."""
    seen = []

    def watched(function: Any) -> Any:
        def watch(*args: Any) -> Any:
            seen.append(torch.get_num_threads())
            return function(*args)

        return watch

    monkeypatch.setattr(training, "ActorCritic", watched(training.ActorCritic))
    monkeypatch.setattr(PointEnv, "step", watched(PointEnv.step))
    monkeypatch.setattr(Trainer, "_update", watched(Trainer._update))
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        Trainer(small_config(), PointEnv).epoch()
        after = torch.get_num_threads()
    finally:
        torch.set_num_threads(before)
    assert seen == [1] * (1 + 128 + 1)
    assert after == 2


# ---- checkpoints


@pytest.mark.parametrize("algo", ALGORITHMS)
@pytest.mark.parametrize("family", FAMILIES)
def test_a_resumed_run_is_the_uninterrupted_run(algo: str, family: str, tmp_path: Path) -> None:
    config = small_config(algo, family, epochs=4)
    whole = train(config, make_envs=PointEnv)
    train(dataclasses.replace(config, epochs=2), run_dir=tmp_path, make_envs=PointEnv)
    resumed = train(config, run_dir=tmp_path, make_envs=PointEnv)
    assert torch.equal(weights(whole), weights(resumed))
    assert same_records(whole.records, resumed.records)


def test_on_robots_too(tmp_path: Path) -> None:
    """Physics state included: contacts, clocks, generators; truncation falls into the resumed part."""
    config = dataclasses.replace(small_config(horizon=384, seeds=2, epochs=3), env="Hopper-v5")
    whole = train(config)
    train(dataclasses.replace(config, epochs=1), run_dir=tmp_path)
    resumed = train(config, run_dir=tmp_path)
    assert torch.equal(weights(whole), weights(resumed))
    assert same_records(whole.records, resumed.records)


@pytest.mark.parametrize(("mode", "charged"), [("clip", 1.0), ("raw", 4.0)])
def test_the_robots_are_charged_for_actions_as_the_run_is_configured(mode: str, charged: float) -> None:
    config = dataclasses.replace(small_config(seeds=2, action_mode=mode), env="HalfCheetah-v5")
    *_, info = Trainer(config).envs.step(np.full((2, 6), 2.0, np.float32))
    assert info["reward_ctrl"] == pytest.approx([-0.1 * 6 * charged] * 2)


def test_what_a_wrapper_has_gathered_is_not_mixed_with_the_robots_state(tmp_path: Path) -> None:
    """A resumed run with a wrapper starts new episodes, as it says, and does not go on with half of the state."""
    config = small_config(epochs=4)

    def wrapped(n: int) -> Any:
        return NormalizeReward(PointEnv(n))

    train(dataclasses.replace(config, epochs=2), run_dir=tmp_path, make_envs=wrapped)
    assert checkpoint.load(tmp_path / checkpoint.FILE_NAME)["collector"]["envs"] is None
    assert len(train(config, run_dir=tmp_path, make_envs=wrapped).records) == 4


def test_a_wrapper_that_comes_later_sees_every_observation() -> None:
    """A run begun with bare environments and resumed in wrapped ones: no observation goes round the wrapper."""

    class Shifted(VectorWrapper):
        def reset(self, **given: Any) -> Any:
            obs, info = super().reset(**given)
            return obs + 100, info

        def step(self, actions: Any) -> Any:
            obs, *rest = super().step(actions)
            return obs + 100, *rest

    config = small_config(normalize_obs=False, epochs=1)
    bare = small_run(config)
    late = Trainer(config, lambda n: Shifted(PointEnv(n)))
    late.load_state_dict(bare.state_dict())
    late.epoch()
    assert late.rollout is not None
    assert float(late.rollout.obs.min()) > 50


def test_environments_without_state_start_new_episodes(tmp_path: Path) -> None:
    config = small_config(epochs=4)

    def forgetful(n: int) -> PointEnv:
        return PointEnv(n, saves=False)

    train(dataclasses.replace(config, epochs=2), run_dir=tmp_path, make_envs=forgetful)
    resumed = train(config, run_dir=tmp_path, make_envs=forgetful)
    assert len(resumed.records) == 4
    whole = train(config, make_envs=forgetful)
    assert same_records(whole.records[:2], resumed.records[:2])
    assert not torch.equal(weights(whole), weights(resumed))


def test_a_run_goes_on_in_environments_that_cannot_take_a_state(tmp_path: Path) -> None:
    train(small_config(epochs=2), run_dir=tmp_path, make_envs=PointEnv)
    resumed = train(small_config(epochs=3), run_dir=tmp_path, make_envs=lambda n: PointEnv(n, saves=False))
    assert len(resumed.records) == 3


@pytest.mark.parametrize("algo", ["ppo", "trpo", "policy-gradient"])
def test_a_state_is_a_snapshot(algo: str) -> None:
    run = small_run(small_config(algo=algo, epochs=1))
    state = run.state_dict()
    first = run.epoch()
    for _ in range(2):  # what a run does with a state that it has gone back to leaves that state as it is
        run.load_state_dict(state)
        assert len(run.records) == 1
        assert same_records([run.epoch()], [first])


@pytest.mark.parametrize("seeds", [np.arange(2), np.int64(2), (np.int32(0), 1)])
def test_seeds_may_be_numpys(seeds: Any) -> None:
    config = preset("common", "Hopper-v5", seeds=seeds)
    assert config.seeds == (0, 1)
    assert all(type(seed) is int for seed in config.seeds)


def test_new_episodes_after_a_resumption_are_seen_with_the_old_statistics() -> None:
    def forgetful(n: int) -> PointEnv:
        return PointEnv(n, saves=False)

    run = small_run(small_config(epochs=2), saves=False)
    resumed = Trainer(run.config, forgetful)
    resumed.load_state_dict(run.state_dict())
    collector = resumed.collector
    seeds = [int(copy.deepcopy(s.noise).integers(2**31)) for s in run.collector.streams]
    first, _ = forgetful(3).reset(seed=seeds)
    assert collector.normalizer.count == run.collector.normalizer.count + 1
    assert np.array_equal(collector.obs, collector.normalizer(first))
    # Fresh statistics would have seen nothing but these observations: all would be 0.
    assert np.abs(collector.obs).max() > 0.1


def test_every_resumption_has_starts_of_its_own() -> None:
    """A run that is often interrupted does not train on the same few starts again and again."""
    run, seen = small_run(small_config(epochs=3), saves=False), []
    run.collector.envs.reset = lambda *, seed, envs=run.collector.envs: (
        seen.append(seed) or (PointEnv.reset(envs, seed=seed))
    )
    run.collector.restart()
    state = run.state_dict()
    run.load_state_dict(state)
    run.load_state_dict(state)
    run.epoch()
    run.load_state_dict(run.state_dict())
    begin, first, again, later = map(tuple, seen)
    assert begin == tuple(stream.environment for stream in run.collector.streams)
    assert first == again  # the state decides
    assert len({*begin, *first, *later}) == 3 * len(begin)


def test_new_episodes_after_a_resumption_begin_with_no_return() -> None:
    run = small_run(small_config(epochs=2), saves=False)
    assert run.collector.returns.all()  # episodes are under way
    run.load_state_dict(run.state_dict())
    assert not run.collector.returns.any()


KILLED = """
    import sys, time
    from inbounds.learning import train
    from tests.learning.point import PointEnv
    from tests.learning.small import small_config

    class Stuck(PointEnv):
        steps = 0

        def step(self, actions):
            self.steps += 1
            if self.steps == 2 * 128 + 50:
                print("in the middle of the third epoch", flush=True)
                time.sleep(60)
            return super().step(actions)

    config = small_config(epochs=4)
    train(config.__class__(**{**vars(config), "checkpoint_every": 1}), run_dir=sys.argv[1], make_envs=Stuck)
"""


def test_a_run_killed_in_mid_epoch_goes_on_as_if_nothing_had_happened(tmp_path: Path) -> None:
    command = [sys.executable, "-c", textwrap.dedent(KILLED), str(tmp_path)]
    root = Path(__file__).resolve().parents[2]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=root) as process:
        assert process.stdout is not None
        assert "middle" in process.stdout.readline()
        os.kill(process.pid, signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    config = dataclasses.replace(small_config(epochs=4), checkpoint_every=1)
    assert len(checkpoint.load(tmp_path / checkpoint.FILE_NAME)["records"]) == 2
    resumed = train(config, run_dir=tmp_path, make_envs=PointEnv)
    whole = train(config, make_envs=PointEnv)
    assert torch.equal(weights(whole), weights(resumed))
    assert same_records(whole.records, resumed.records)


def test_a_checkpoint_is_written_every_so_many_epochs_and_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    saved: list[int] = []
    monkeypatch.setattr(checkpoint, "save", lambda path, state: saved.append(len(state["records"])))
    config = dataclasses.replace(small_config(epochs=5), checkpoint_every=2)
    train(config, run_dir=tmp_path, make_envs=PointEnv)
    assert saved == [2, 4, 5]


def test_a_number_in_a_checkpoint_keeps_its_shape(tmp_path: Path) -> None:
    checkpoint.save(tmp_path / "one.pt", some_state(1) | {"of no dimension": np.array(3.0)})
    assert checkpoint.load(tmp_path / "one.pt")["of no dimension"].shape == ()


class Sign(enum.IntEnum):
    PLUS = 1


@pytest.mark.parametrize(
    "kept",
    [
        np.random.default_rng(0),
        frozenset({1}),
        np.array([None]),
        np.array(["a"]),
        np.ma.masked_array([1.0, 2.0], [True, False]),
        Path("x"),
        deque([1]),
        Sign.PLUS,
    ],
)
def test_what_could_not_be_read_again_is_not_written(tmp_path: Path, kept: Any) -> None:
    path = tmp_path / checkpoint.FILE_NAME
    checkpoint.save(path, some_state(1))
    with pytest.raises(TypeError, match=r"cannot keep state\['envs'\]\[1\], of type .*bit_generator.state"):
        checkpoint.save(path, some_state(2) | {"envs": [0, kept]})
    with pytest.raises(TypeError, match=r"cannot keep a key of state\['envs'\], of type Sign"):
        checkpoint.save(path, some_state(2) | {"envs": {Sign.PLUS: 0}})
    assert checkpoint.load(path)["records"] == [1]


@pytest.mark.parametrize(
    "number", [np.float32(0.1), np.True_, np.uint8(255), np.float64(2), np.complex64(1j)]
)
def test_a_number_of_numpys_keeps_its_type(tmp_path: Path, number: Any) -> None:
    """Which decides how an environment goes on computing with it."""
    path = tmp_path / checkpoint.FILE_NAME
    checkpoint.save(path, some_state(1) | {"envs": [number, {"wind": number}, np.str_("a")]})
    [back, within, text] = checkpoint.load(path)["envs"]
    assert (type(back), back) == (type(within["wind"]), within["wind"]) == (type(number), number)
    assert (type(text), text) == (str, "a")


def test_numpys_numbers_are_read_again_as_pythons_in_keys_and_sets(tmp_path: Path) -> None:
    path = tmp_path / checkpoint.FILE_NAME
    checkpoint.save(path, some_state(1) | {"envs": {np.int64(3): {np.float32(0.5)}, (np.int64(1), "a"): 2}})
    assert repr(checkpoint.load(path)["envs"]) == "{3: {0.5}, (1, 'a'): 2}"


def test_numbers_of_another_byte_order_are_kept(tmp_path: Path) -> None:
    checkpoint.save(tmp_path / "one.pt", some_state(1) | {"big": np.array([1.5, -2.0], ">f8")})
    assert checkpoint.load(tmp_path / "one.pt")["big"].tolist() == [1.5, -2.0]


def some_state(epoch: int) -> dict[str, Any]:
    return {"config": {}, "networks": np.arange(3.0), "records": [epoch]}


def test_a_checkpoint_is_whole_or_absent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / checkpoint.FILE_NAME
    checkpoint.save(path, some_state(1))

    def dies(file: int) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(os, "fsync", dies)
    with pytest.raises(OSError, match="disk full"):
        checkpoint.save(path, some_state(2))
    state = checkpoint.load(path)
    assert state["records"] == [1]
    assert np.array_equal(state["networks"], np.arange(3.0))
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("damage", ["cut", "flipped", "other"])
def test_a_damaged_checkpoint_says_what_to_do(tmp_path: Path, damage: str) -> None:
    path = tmp_path / checkpoint.FILE_NAME
    train(small_config(epochs=1), run_dir=tmp_path, make_envs=PointEnv)
    whole = path.read_bytes()
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 1
    path.write_bytes({"cut": whole[:-100], "flipped": bytes(flipped), "other": b"no checkpoint"}[damage])
    with pytest.raises(DamagedFileError, match=r"checkpoint.pt is damaged.*move .* out of the way"):
        train(small_config(epochs=2), run_dir=tmp_path, make_envs=PointEnv)


def test_a_run_whose_seeds_all_diverge_keeps_its_end(tmp_path: Path) -> None:
    def poison(trainer: Trainer, _: object) -> None:
        trainer.networks.actor.theta.fill_(torch.nan)

    config = small_config(epochs=20)
    with pytest.warns(DivergedSeedWarning):
        run = train(config, run_dir=tmp_path, make_envs=PointEnv, callback=poison)
    assert run.finished
    assert len(checkpoint.load(tmp_path / checkpoint.FILE_NAME)["records"]) == len(run.records) == 2


def test_the_run_before_a_divergence_is_set_aside_and_can_be_gone_on_with(tmp_path: Path) -> None:
    def poison(trainer: Trainer, record: Any) -> None:
        if record["epoch"] == 0:
            trainer.networks.actor.theta.fill_(torch.nan)

    config = dataclasses.replace(small_config(epochs=3), checkpoint_every=1)
    with (
        pytest.warns(DivergedSeedWarning, match=r"seeds \[0, 1, 2\] diverged in epoch 1"),
        pytest.warns(
            DivergedSeedWarning, match=r"before-epoch-1\.pt is the last .*: a smaller learning_rate is"
        ),
    ):
        train(config, run_dir=tmp_path, make_envs=PointEnv, callback=poison)
    with pytest.warns(DivergedSeedWarning, match="have diverged: nothing is left to train in it"):
        assert len(train(config, run_dir=tmp_path, make_envs=PointEnv).records) == 2
    (tmp_path / "checkpoint-before-epoch-1.pt").replace(tmp_path / checkpoint.FILE_NAME)
    mended = train(config, run_dir=tmp_path, make_envs=PointEnv)
    assert not mended.diverged.any()
    assert torch.equal(weights(mended), weights(train(config, make_envs=PointEnv)))


def test_with_the_environment_mended_the_run_before_can_be_gone_on_with(tmp_path: Path) -> None:
    envs: list[PointEnv] = []

    def make(n: int) -> PointEnv:
        envs.append(PointEnv(n))
        return envs[-1]

    def poison(trainer: Trainer, record: Any) -> None:
        if record["epoch"] == 0:
            envs[-1].poisoned = [1]

    config = dataclasses.replace(small_config(epochs=3), checkpoint_every=1)
    with (
        pytest.warns(DivergedSeedWarning, match="mend the environment"),
        pytest.warns(
            DivergedSeedWarning, match=r"before-epoch-1\.pt is .*: with the environment mended, rename it"
        ),
    ):
        train(config, run_dir=tmp_path, make_envs=make, callback=poison)
    (tmp_path / "checkpoint-before-epoch-1.pt").replace(tmp_path / checkpoint.FILE_NAME)
    assert not train(config, run_dir=tmp_path, make_envs=PointEnv).diverged.any()


def test_what_can_be_no_run_directory_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for place in (tmp_path / "file", tmp_path / "file" / "run"):
        with pytest.raises(OSError, match=f"{place} cannot be a run directory .*: choose another run_dir"):
            train(small_config(epochs=1), run_dir=place, make_envs=PointEnv)


def test_a_resumed_run_knows_which_seeds_have_diverged(tmp_path: Path) -> None:
    def poisoned(n: int) -> PointEnv:
        return PointEnv(n, poisoned=(1,))

    with pytest.warns(DivergedSeedWarning, match=r"seeds \[1\]"):
        train(small_config(epochs=1), run_dir=tmp_path, make_envs=poisoned)
    config = small_config(epochs=2)
    resumed = Trainer(config, poisoned)
    resumed.load_state_dict(checkpoint.load(tmp_path / checkpoint.FILE_NAME))
    assert resumed.diverged.tolist() == [False, True, False]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        train(config, run_dir=tmp_path, make_envs=poisoned)  # reported once


def test_a_checkpoint_of_another_configuration_is_refused(tmp_path: Path) -> None:
    config = small_config(epochs=1)
    train(config, run_dir=tmp_path, make_envs=PointEnv)
    other = dataclasses.replace(config, normalize_obs=False)
    with pytest.raises(ValueError, match="normalize_obs: True → False"):
        train(other, run_dir=tmp_path, make_envs=PointEnv)


@pytest.mark.parametrize(
    ("low", "said"), [((-1.0, -0.5), "action bounds are not those"), ((-1.0,) * 3, "have another size")]
)
def test_a_checkpoint_of_another_environment_is_refused(
    low: tuple[float, ...], said: str, tmp_path: Path
) -> None:
    config = small_config(epochs=1)
    train(config, run_dir=tmp_path, make_envs=PointEnv)
    before = (tmp_path / checkpoint.FILE_NAME).read_bytes()
    with pytest.raises(ValueError, match=said):
        train(
            dataclasses.replace(config, epochs=2),
            run_dir=tmp_path,
            make_envs=lambda n: PointEnv(n, low, (1.0,) * len(low)),
        )
    assert (tmp_path / checkpoint.FILE_NAME).read_bytes() == before
    trainer = Trainer(config, lambda n: PointEnv(n, low, (1.0,) * len(low)))
    theta = trainer.networks.actor.theta.clone()
    with pytest.raises(ValueError, match=said):
        trainer.load_state_dict(checkpoint.load(tmp_path / checkpoint.FILE_NAME))
    assert torch.equal(trainer.networks.actor.theta, theta)  # nothing of it has been loaded


def test_nothing_is_loaded_where_the_environment_refuses() -> None:
    """Two robots whose observations and actions have the same sizes: only the environment can tell them apart."""
    config = dataclasses.replace(small_config(epochs=1), env="mine")
    cheetah, walker = (
        Trainer(config, functools.partial(robots.make, name)) for name in ("HalfCheetah-v5", "Walker2d-v5")
    )
    cheetah.epoch()
    theta, before = walker.networks.actor.theta.clone(), copy.deepcopy(walker.collector.state_dict())
    with pytest.raises(ValueError, match="The state is of 3 × HalfCheetah-v5"):
        walker.load_state_dict(cheetah.state_dict())
    assert torch.equal(walker.networks.actor.theta, theta)
    np.testing.assert_equal(walker.collector.state_dict(), before)


def test_a_checkpoint_that_may_not_be_read_is_not_called_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The tests may run as root, whom no permission stops: the file system's answer is made up."""
    config = small_config(epochs=1)
    train(config, run_dir=tmp_path, make_envs=PointEnv)

    def refuse(*_: Any, **__: Any) -> Any:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(checkpoint.zipfile, "ZipFile", refuse)
    with pytest.raises(PermissionError):
        train(config, run_dir=tmp_path, make_envs=PointEnv)


def test_a_minibatch_of_one_can_be_prepared() -> None:
    config = dataclasses.replace(small_config("trpo"), engine="compiled")
    algorithm = dataclasses.replace(config.algorithm, minibatch_size=1)
    assert prepare(dataclasses.replace(config, algorithm=algorithm), PointEnv) > 0


def test_preparing_closes_what_it_makes_and_speaks_of_no_run(monkeypatch: pytest.MonkeyPatch) -> None:
    closed = []

    class Watched(PointEnv):
        def step(self, actions: Any) -> Any:
            obs, reward, *rest = super().step(actions)
            return obs, reward * np.nan, *rest

        def close(self, **kwargs: Any) -> None:
            closed.append(True)

    config = dataclasses.replace(small_config("trpo"), engine="compiled")
    assert prepare(config, Watched) > 0
    assert closed == [True]


class Closing(PointEnv):
    """It counts how often it is closed."""

    closed = 0

    def close(self, **kwargs: Any) -> None:
        self.closed += 1


@pytest.mark.parametrize("where", ["the constructor", "the run directory", "the callback", "nowhere"])
def test_an_error_closes_the_environments(where: str, tmp_path: Path) -> None:
    made: list[Closing] = []

    def make(n: int) -> Closing:
        made.append(Closing(n + (where == "the constructor")))
        return made[-1]

    def stop(*_: Any) -> None:
        if where == "the callback":
            raise ValueError(where)

    if where == "the run directory":
        (tmp_path / checkpoint.FILE_NAME).touch()
    raised = True
    with contextlib.suppress(ValueError):
        train(small_config(epochs=1), run_dir=tmp_path, make_envs=make, callback=stop)
        raised = False
    assert raised == (where != "nowhere")
    assert [envs.closed for envs in made] == [int(raised)]


def test_what_a_killed_run_left_beside_its_checkpoint_is_removed(tmp_path: Path) -> None:
    others = (".checkpoint.pt.0123abcd.partial.txt", ".other.pt.0123abcd.partial", "checkpoint.pt.partial")
    for name in (".checkpoint.pt.0123abcd.partial", *others):
        (tmp_path / name).touch()
    train(small_config(epochs=1), run_dir=tmp_path, make_envs=PointEnv)
    assert {file.name for file in tmp_path.iterdir()} == {checkpoint.FILE_NAME, *others}


# ---- records, divergence, configuration


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_records_say_what_happened(algo: str) -> None:
    seen = []
    config = small_config(algo, epochs=2)
    run = train(config, make_envs=PointEnv, callback=lambda trainer, record: seen.append(record))
    assert seen == run.records
    first, second = run.records
    assert (first["env_steps"], second["env_steps"], second["epoch"]) == (128, 256, 1)
    assert (first["episodes"] >= 6).all()  # 20 steps each, or fewer
    names = {"return_mean", "kl", "entropy", "saturation", "action_std", "explained_variance", "diverged"}
    names |= {"ppo": {"clip_fraction"}, "trpo": {"accepted", "step_fraction"}}.get(algo, set())
    assert names <= first.keys()
    assert all(np.isfinite(second[name]).all() for name in names)


def test_when_every_seed_has_diverged_training_stops() -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run = train(small_config(epochs=5), make_envs=lambda n: PointEnv(n, poisoned=(0, 1, 2)))
    assert [w.category for w in caught] == [DivergedSeedWarning]
    assert len(run.records) == 1
    assert run.diverged.all()


def test_an_exploding_seed_is_marked_when_it_explodes() -> None:
    trainer = Trainer(small_config(), PointEnv)
    trainer.epoch()
    trainer.networks.critic.theta[2, 5] = torch.inf
    with pytest.warns(DivergedSeedWarning, match=r"\[2\] diverged in epoch 1.*smaller learning_rate"):
        trainer.epoch()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        record = trainer.epoch()  # reported once
    assert record["diverged"].tolist() == [False, False, True]


def test_a_reward_too_large_for_the_networks_is_named_as_such() -> None:
    class Generous(PointEnv):
        def step(self, actions: Any) -> Any:
            obs, reward, *rest = super().step(actions)
            return obs, reward * 1e300, *rest

    with pytest.warns(DivergedSeedWarning, match="no finite number, or one too large for float32"):
        Trainer(small_config(normalize_obs=False), Generous).epoch()


def test_a_warning_that_is_an_error_loses_nothing() -> None:
    trainer = Trainer(small_config(epochs=3), PointEnv)
    trainer.networks.critic.theta[2, 5] = torch.inf
    with warnings.catch_warnings():
        warnings.simplefilter("error", DivergedSeedWarning)
        with pytest.raises(DivergedSeedWarning):
            trainer.epoch()
        assert trainer.records[0]["diverged"].tolist() == [False, False, True]
        trainer.epoch()  # reported once
    assert len(trainer.records) == 2


def test_numbers_of_numpy_are_numbers(tmp_path: Path) -> None:
    """They are kept as Python's, and those that decide a precision are Python's."""
    config = small_config(epochs=1)
    numpys = dataclasses.replace(
        config,
        epochs=np.int64(1),
        policy=dataclasses.replace(
            config.policy, limits=Limits(log_std_max=np.float64(1)), initial_std=np.float32(0.5)
        ),
    )
    assert type(numpys.policy.limits.log_std_max) is float
    run = train(numpys, make_envs=PointEnv)
    save_run(tmp_path, run)
    assert json.loads(metadata_of(numpys))["config"]["policy"]["initial_std"] == 0.5
    plain = dataclasses.replace(
        config, policy=dataclasses.replace(config.policy, initial_std=0.5, limits=Limits(log_std_max=1))
    )
    assert torch.equal(weights(train(plain, make_envs=PointEnv)), weights(run))


@pytest.mark.parametrize(
    "wrong",
    [{"algorithm": "trpo"}, {"policy": "beta"}, {"network": 64}, {"seeds": 3}, {"seeds": np.int64(3)}],
)
def test_names_and_numbers_are_what_presets_take(wrong: dict[str, Any]) -> None:
    with pytest.raises(TypeError, match=rf"{next(iter(wrong))} must be a .*`preset` takes"):
        TrainConfig(**wrong)


def test_what_a_run_is_made_of_is_asked_for_by_name() -> None:
    with pytest.raises(TypeError, match=r"such as preset\(\.\.\.\) gives, got 'Hopper-v5'"):
        train("Hopper-v5")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="make_envs is a function of the number of seeds"):
        train(small_config(), make_envs=PointEnv(3))  # type: ignore[arg-type]


def test_networks_can_be_pickled() -> None:
    trainer = Trainer(small_config(epochs=1), PointEnv)
    copied = pickle.loads(pickle.dumps(trainer.networks))
    assert torch.equal(copied.actor.theta, trainer.networks.actor.theta)
    assert copied.policy.config == trainer.networks.policy.config
    assert copied.policy.dtype == trainer.networks.policy.dtype


def test_presets_are_the_table() -> None:
    common, printed = (preset(name) for name in ("common", "as-printed"))
    for config in (common, printed):
        a = config.algorithm
        assert (a.horizon, a.learning_rate, a.num_epochs, a.minibatch_size) == (2048, 3e-4, 10, 64)
        assert (a.gamma, a.gae_lambda, a.entropy_coef) == (0.99, 0.95, 1e-4)
        assert config.policy.state_dependent_std
        assert config.network.dtype == "float32"
    a, b = common.algorithm, printed.algorithm
    assert (a.clip_range, a.normalize_advantage, a.max_grad_norm, a.adam_eps) == (0.2, True, 0.5, 1e-5)
    assert (b.clip_range, b.normalize_advantage, b.max_grad_norm, b.adam_eps) == (0.02, False, None, 1e-8)
    assert (common.normalize_obs, common.network.initialization) == (True, "orthogonal")
    assert (printed.normalize_obs, printed.network.initialization) == (False, "pytorch")
    assert (common.network.policy_head_gain, common.network.value_head_gain) == (0.01, 1.0)
    trpo = preset("as-printed", algo="trpo").algorithm
    assert (trpo.max_kl, trpo.cg_iters, trpo.damping) == (0.01, 10, 0.1)
    assert (trpo.backtrack_coef, trpo.max_backtracks) == (0.5, 10)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda: preset("commom"), "choose common or as-printed"),
        (lambda: preset("common", algo="sac"), "choose one of ppo, trpo"),
        (lambda: preset("common", algo=["ppo"]), r"no algorithm \['ppo'\]; choose one of ppo, trpo"),
        (lambda: preset("common", policy="normal"), "choose one of gaussian"),
        (lambda: preset("common", seeds=-1), "asks for -1 of them; at least 1"),
        (lambda: TrainConfig(seeds=()), "seeds must be different"),
        (lambda: TrainConfig(seeds=(1, 1)), "seeds must be different"),
        (lambda: TrainConfig(seeds=(1, 2**63)), "integers below 2⁶³"),
        (lambda: TrainConfig(epochs=0), "epochs must be positive"),
        (lambda: TrainConfig(epochs=2.5), "epochs must be a whole number, got 2.5"),
        (lambda: TrainConfig(action_mode="clipped"), "clip or raw"),
        (lambda: TrainConfig(normalize_obs="no"), "normalize_obs must be True or False, got 'no'"),
        (lambda: PPOConfig(normalize_advantage="False"), "normalize_advantage must be True or False"),
        (lambda: PPOConfig(learning_rate=math.inf), "learning_rate must be finite, got inf"),
        (lambda: TRPOConfig(max_kl=math.inf), "max_kl must be finite, got inf"),
        (lambda: TRPOConfig(damping=math.inf), "damping must be finite, got inf"),
    ],
)
def test_bad_configurations_are_refused(wrong, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        wrong()


@pytest.mark.parametrize("seeds", [2.5, True, "3", b"3", None])
def test_seeds_are_how_many_or_which(seeds: Any) -> None:
    with pytest.raises(TypeError, match=r"how many \(10\), or which \(\(3, 7\)\); got " + repr(seeds)):
        preset("common", seeds=seeds)


def test_one_environment_is_no_vector_of_them() -> None:
    with pytest.raises(ValueError, match=r"takes a vector environment, got .*SyncVectorEnv\(\[make\]"):
        Trainer(small_config(), lambda _: gymnasium.make("Pendulum-v1"))


def test_a_run_of_the_library_becomes_policies(tmp_path: Path) -> None:
    config = small_config(epochs=1)
    train(config, run_dir=tmp_path, make_envs=PointEnv)
    with pytest.raises(FileNotFoundError, match=r"a checkpoint beside it: save_run\("):
        load_policies(tmp_path)
    save_run(tmp_path, train(config, run_dir=tmp_path, make_envs=PointEnv))
    assert len(load_policies(tmp_path)) == 3


def test_two_do_not_train_in_one_folder(tmp_path: Path) -> None:
    config = small_config(epochs=1)
    refused: list[str] = []

    def intrude(*_: Any) -> None:
        def other() -> None:
            try:
                train(config, run_dir=tmp_path, make_envs=PointEnv)
            except BlockingIOError as error:
                refused.append(str(error))

        thread = threading.Thread(target=other)
        thread.start()
        thread.join()

    train(config, run_dir=tmp_path, make_envs=PointEnv, callback=intrude)
    assert refused == [
        f"another process or thread trains in {tmp_path}: wait until it is done, or choose another run_dir"
    ]
    intrude()  # the folder is free again, and the run in it done
    assert len(refused) == 1
    assert [file.name for file in tmp_path.iterdir()] == [checkpoint.FILE_NAME]
    with held(tmp_path):  # who holds it may train in it
        assert train(config, run_dir=tmp_path, make_envs=PointEnv).finished
        intrude()  # and holds it still
    assert len(refused) == 2
