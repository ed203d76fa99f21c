import errno
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch

import inbounds.robots
from inbounds.learning import TrainConfig, Trainer
from inbounds.learning.storage import checkpoint
from inbounds.learning.storage.run_store import load_policies
from inbounds.learning.updates.threads import one_thread
from inbounds.study import Cell, StudyError, StudyFolder, read_cell, run_cell
from inbounds.study.running import evaluate, file_checks, one_cell
from inbounds.study.running.cell_lock import CellLock, ClaimedError
from inbounds.study.running.evaluate import generator_of
from inbounds.study.running.measure import MeasuredTrainer
from inbounds.study.running.one_cell import DiskFullError
from inbounds.study.running.provenance import provenance
from inbounds.study.running.verify import first_mismatch
from inbounds.study.store import COLUMNS, EVERY_EPOCH, MEASURED, read_metadata, table_of
from tests.study.small import folder_in, small_cell, stop_after

LIMIT = 40  # steps of an evaluation's episodes
FULL = OSError(errno.ENOSPC, "No space left on device")


@pytest.fixture(autouse=True, scope="module")
def short_evaluations() -> Iterator[None]:
    def make(config: TrainConfig, num_envs: int) -> Any:
        return inbounds.robots.make(config.env, num_envs, max_episode_steps=LIMIT)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluate, "make_environments", make)
        yield


@pytest.fixture(scope="module")
def whole(short_evaluations: None, tmp_path_factory: pytest.TempPathFactory) -> pa.Table:
    """The rows of the small cell, never interrupted."""
    folder = folder_in(tmp_path_factory.mktemp("whole"))
    assert run_cell(small_cell(), folder) == "finished"
    return read_cell(folder.cell_file(small_cell()))


def rows_of(folder: StudyFolder) -> pa.Table:
    return read_cell(folder.cell_file(small_cell()))


@pytest.mark.parametrize(("algorithm", "family"), [("ppo", "logit-normal"), ("trpo", "beta")])
def test_measuring_does_not_change_training(algorithm: str, family: str) -> None:
    cell = small_cell(algorithm, family, epochs=22)
    with one_thread():
        plain = Trainer(cell.config)
    measured = MeasuredTrainer(cell)
    for _ in range(cell.epochs):
        plain.epoch()
        measured.epoch()
    for ours, theirs in zip(measured.trainer.networks.networks, plain.networks.networks, strict=True):
        assert torch.equal(ours.theta, theirs.theta)
    for ours, theirs in zip(measured.trainer.records, plain.records, strict=True):
        for name in ours.keys() - {"seconds"}:
            np.testing.assert_array_equal(ours[name], theirs[name])
    for name, mean in measured.trainer.collector.normalizer.state_dict().items():  # type: ignore[union-attr]
        np.testing.assert_array_equal(mean, plain.collector.normalizer.state_dict()[name])  # type: ignore[union-attr]


def test_the_number_of_threads_does_not_matter() -> None:
    before, runs = torch.get_num_threads(), []
    try:
        for threads in (1, 2):
            torch.set_num_threads(threads)
            runs.append(MeasuredTrainer(small_cell(epochs=1)))
            runs[-1].epoch()
    finally:
        torch.set_num_threads(before)
    one, two = (run.trainer.networks.actor.theta for run in runs)
    assert torch.equal(one, two)


def played_by_gymnasium(act: Callable[[np.ndarray], np.ndarray], start: int) -> float:
    """The return of one short episode of Gymnasium's Hopper, which ends where the robot falls."""
    env = gymnasium.make("Hopper-v5", max_episode_steps=LIMIT)
    obs, _ = env.reset(seed=start)
    total, ended = 0.0, False
    while not ended:
        obs, reward, fallen, at_the_limit, _ = env.step(act(obs))
        total, ended = total + float(reward), fallen or at_the_limit
    return total


@pytest.mark.parametrize("family", ["gaussian", "beta"])
def test_the_greedy_return_is_that_of_gymnasium(family: str) -> None:
    run = MeasuredTrainer(small_cell(family=family, epochs=10))
    for _ in range(10):
        run.epoch()
    for i, policy in enumerate(run.trainer.policies):
        total = played_by_gymnasium(policy.act, int(generator_of(policy.seed, 9).integers(2**31)))
        assert run.progress.measurements[-1]["greedy_return"][i] == pytest.approx(total, rel=1e-4, abs=1e-3)


def starts_of(cell: Cell, epochs: int, patch: pytest.MonkeyPatch) -> list[list[int]]:
    """The starts of the evaluations of a run."""
    starts, real = [], evaluate.play
    with patch.context() as context:
        context.setattr(evaluate, "play", lambda envs, act, s: starts.append(list(s)) or real(envs, act, s))
        run = MeasuredTrainer(cell)
        for _ in range(epochs):
            run.epoch()
        evaluate.evaluate_finally(run.trainer)
    return starts


def test_where_evaluations_start_depends_on_seed_and_epoch_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = starts_of(small_cell(epochs=10), 10, monkeypatch)
    other = small_cell(
        "trpo", "logit-normal", seeds=(1, 5, 0), overrides=(("horizon", 96), ("minibatch_size", 32))
    )
    others = starts_of(other, 10, monkeypatch)
    first, tenth, *finally_ = plain
    assert not set(first) & set(tenth)
    assert [[s[2], s[0]] for s in others[:2]] == [first, tenth]
    assert len(finally_) == len(others[2:]) == 4  # mean, median, mode, sample
    assert all(starts == finally_[0] for starts in finally_)
    assert all(starts[20:] + starts[:10] == finally_[0] for starts in others[2:])
    assert len({*first, *tenth, *finally_[0]}) == 2 + 2 + 20


def test_sampled_actions_are_not_drawn_by_what_drew_their_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    starts, drawn = [], []

    def play(_: Any, way: str, where: list[int], generators: list[np.random.Generator]) -> tuple[Any, Any]:
        if way == "sample":
            starts.extend(where)
            drawn.extend(int(x) for g in generators for x in g.integers(2**31, size=10))
        return np.zeros((2, 10)), np.zeros((2, 10))

    monkeypatch.setattr(evaluate.Players, "play", play)
    evaluate.evaluate_finally(MeasuredTrainer(small_cell(epochs=1)).trainer)
    assert len(starts) == len(drawn) == 20
    assert len({*starts, *drawn}) == 40


def test_rows_have_the_schema(whole: pa.Table) -> None:
    names = whole.column_names
    assert names[: len(EVERY_EPOCH)] == list(EVERY_EPOCH)
    assert {"greedy_return", "entropy", "clip_fraction", "scale_q50", "at_log_std_max"} <= set(names)
    assert not {"accepted", "alpha_q50"} & set(names)
    assert whole["seed"].to_pylist()[:4] == [0, 1, 0, 1]
    assert whole["env_steps"].to_pylist()[-1] == 30 * 64
    epoch = whole["epoch"].to_numpy()
    measured = (epoch == 0) | (epoch % 10 == 9)
    for name in names:
        assert whole.schema.field(name).type == COLUMNS[name][0]
        assert whole.schema.field(name).metadata == {b"meaning": COLUMNS[name][1].encode()}
        expected = measured if name in MEASURED else np.ones_like(measured)
        np.testing.assert_array_equal(whole[name].is_valid().to_numpy(), expected)
    assert np.isfinite(whole["greedy_return"].drop_null().to_numpy()).all()


def test_rows_carry_what_they_were_made_with(tmp_path: Path) -> None:
    cell, folder = small_cell(epochs=10), folder_in(tmp_path)
    run_cell(cell, folder)
    path = folder.cell_file(cell)
    about = read_metadata(path)
    assert (about["id"], about["digest"], about["greedy"]) == (cell.id, cell.digest, "median")
    assert about["versions"].keys() >= {"torch", "mujoco", "gymnasium", "numpy", "inbounds"}
    (session,) = about["sessions"]
    assert session.keys() == {"commit", "engine", "versions", "processor", "from_epoch"}
    assert np.shape(about["first_rewards"]) == (2, 16)
    seconds = about["seconds"]
    assert seconds["total"] >= seconds["training"] + seconds["evaluation"] > 0
    column = pq.ParquetFile(path).metadata.row_group(0).column(list(EVERY_EPOCH).index("return_mean"))
    assert column.compression == "ZSTD"
    assert "BYTE_STREAM_SPLIT" in column.encodings


def test_stopping_and_going_on_changes_nothing(tmp_path: Path, whole: pa.Table) -> None:
    folder, cell = folder_in(tmp_path), small_cell()
    names = (checkpoint.FILE_NAME, folder.policy_files(cell)[0].name)
    left = [
        folder.work_of(cell) / f".{name}.0123abcd.partial" for name in names
    ]  # of a process that was killed
    left[0].parent.mkdir(parents=True)
    for each in left:
        each.touch()
    for epochs in (3, 9, 1):  # stops within, at and after a measurement
        assert run_cell(small_cell(), folder, stop=stop_after(epochs)) == "stopped"
        assert not folder.cell_file(small_cell()).exists()
    assert run_cell(small_cell(), folder) == "finished"
    assert first_mismatch(whole, rows_of(folder)) == ""
    sessions = read_metadata(folder.cell_file(small_cell()))["sessions"]
    assert [session["from_epoch"] for session in sessions] == [0, 3, 12, 13]
    assert not any(each.exists() for each in left)
    assert not list(folder.work.glob("**/checkpoint.pt"))


def test_going_on_with_another_engine_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, cell = folder_in(tmp_path), small_cell(epochs=3)
    run_cell(cell, folder, stop=stop_after(1))
    monkeypatch.setattr(one_cell, "provenance", lambda: provenance() | {"engine": "other"})
    with pytest.warns(UserWarning, match=r"source has changed since the last checkpoint.*start it anew"):
        run_cell(cell, folder)
    sessions = read_metadata(folder.cell_file(cell))["sessions"]
    assert [session["engine"] == "other" for session in sessions] == [False, True]


def test_time_that_is_up_stops_with_a_checkpoint(tmp_path: Path) -> None:
    folder = folder_in(tmp_path)
    assert run_cell(small_cell(), folder, deadline=0) == "stopped"
    assert (folder.work_of(small_cell()) / checkpoint.FILE_NAME).exists()


def test_a_claimed_cell_is_left_alone(tmp_path: Path) -> None:
    folder = folder_in(tmp_path)
    with CellLock.take(folder.work_of(small_cell())), pytest.raises(ClaimedError):
        run_cell(small_cell(), folder)


def test_a_damaged_checkpoint_costs_ten_epochs(tmp_path: Path, whole: pa.Table) -> None:
    folder = folder_in(tmp_path)
    run_cell(small_cell(), folder, stop=stop_after(24))
    path = folder.work_of(small_cell()) / checkpoint.FILE_NAME
    path.write_bytes(path.read_bytes()[:-1000])
    with pytest.warns(UserWarning, match=r"is damaged.*going on from the one before, epoch 20"):
        assert run_cell(small_cell(), folder) == "finished"
    assert first_mismatch(whole, rows_of(folder)) == ""


def test_a_damaged_checkpoint_does_not_take_the_place_of_the_good_one(
    tmp_path: Path, whole: pa.Table, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = folder_in(tmp_path)
    run_cell(small_cell(), folder, stop=stop_after(24))
    path = folder.work_of(small_cell()) / checkpoint.FILE_NAME
    path.write_bytes(path.read_bytes()[:-1000])

    def save(path: Path, state: dict[str, Any]) -> None:
        raise FULL

    def run_on_a_full_disk() -> None:
        with pytest.raises(DiskFullError, match="The last checkpoint is kept"):
            run_cell(small_cell(), folder)

    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "save", save)
        with pytest.warns(UserWarning, match="going on from the one before"):
            run_on_a_full_disk()
    assert run_cell(small_cell(), folder) == "finished"
    assert read_metadata(folder.cell_file(small_cell()))["sessions"][-1]["from_epoch"] == 20
    assert first_mismatch(whole, rows_of(folder)) == ""


def test_two_damaged_checkpoints_are_for_the_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = folder_in(tmp_path)
    run_cell(small_cell(), folder, stop=stop_after(24))
    for path in folder.work.glob("**/checkpoint.pt"):
        path.write_bytes(b"nothing")
    closed = []
    monkeypatch.setattr(MeasuredTrainer, "close", lambda self: closed.append(True))
    with pytest.raises(StudyError, match=r"damaged.* and .*damaged.*delete .* to start the cell anew"):
        run_cell(small_cell(), folder)
    assert closed == [True]


def test_environments_are_closed_where_the_claim_is_lost_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lost(self: CellLock, **_: Any) -> None:
        raise ClaimedError("somebody else has it")

    closed = []
    monkeypatch.setattr(MeasuredTrainer, "close", lambda self: closed.append(True))
    monkeypatch.setattr(CellLock, "renew", lost)
    with pytest.raises(ClaimedError, match="somebody else"):
        run_cell(small_cell(), folder_in(tmp_path))
    assert closed == [True]


def test_the_checkpoint_of_another_configuration_is_refused(tmp_path: Path) -> None:
    folder = folder_in(tmp_path)
    run_cell(small_cell(), folder, stop=stop_after(1))
    other = small_cell(overrides=(("horizon", 128), ("minibatch_size", 32)))
    with pytest.raises(StudyError, match=r"not this cell's.*horizon.*move .* away"):
        run_cell(other, folder)


@pytest.mark.parametrize("what", ["checkpoint", "results"])
def test_a_full_disk_loses_nothing_that_was_saved(
    tmp_path: Path, whole: pa.Table, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    folder, saved = folder_in(tmp_path), []
    real = checkpoint.save

    def save(path: Path, state: dict[str, Any]) -> None:
        if what == "checkpoint" and len(saved) == 2:
            raise FULL
        real(path, state)
        saved.append(path)

    def publish(*_: Any) -> None:
        raise FULL

    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "save", save)
        if what == "results":
            patch.setattr(StudyFolder, "publish", publish)
        with pytest.raises(DiskFullError, match=r"the disk is full. The last checkpoint is kept; make room"):
            run_cell(small_cell(), folder)
    assert not list(folder.work.glob("**/*.partial"))
    assert run_cell(small_cell(), folder) == "finished"
    assert first_mismatch(whole, rows_of(folder)) == ""
    last = read_metadata(folder.cell_file(small_cell()))["sessions"][-1]["from_epoch"]
    assert last == {"checkpoint": 20, "results": 30}[what]


def test_a_damaged_result_is_not_overwritten(tmp_path: Path) -> None:
    cell, folder = small_cell(epochs=10), folder_in(tmp_path)
    run_cell(cell, folder)
    path = folder.cell_file(cell)
    for damage in (path.read_bytes()[:-10], path.read_bytes().replace(b"test", b"tesT", 1), b""):
        path.write_bytes(damage)
        assert folder.state(cell) == "damaged"
        with pytest.raises(StudyError, match=r"is damaged: restore it \(git checkout -- .*\), or delete it"):
            run_cell(cell, folder)
        assert path.read_bytes() == damage


def test_the_damaged_companion_is_named_and_what_to_delete(tmp_path: Path) -> None:
    cell, folder = small_cell(epochs=1, keeps_policies=True), folder_in(tmp_path)
    run_cell(cell, folder)
    for path in folder.policy_files(cell):
        whole = path.read_bytes()
        path.write_bytes(whole[:-10])
        with pytest.raises(
            StudyError, match=rf"{path}, or its line .*restore it .*delete {folder.cell_file(cell)} "
        ):
            run_cell(cell, folder)
        path.write_bytes(whole)
    assert run_cell(cell, folder) == "was finished"
    folder.policy_files(cell)[0].unlink()
    folder.cell_file(cell).unlink()
    assert run_cell(cell, folder) == "finished"  # what the message says helps


def test_an_impossible_folder_is_found_out_before_the_first_epoch(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "results").touch()
    monkeypatch.setattr(one_cell, "MeasuredTrainer", lambda cell: pytest.fail("it has begun"))
    with pytest.raises(OSError, match="results"):
        run_cell(small_cell(), folder_in(tmp_path))


def test_results_of_another_configuration_are_not_mixed_in(tmp_path: Path) -> None:
    folder = folder_in(tmp_path)
    run_cell(small_cell(epochs=10), folder)
    with pytest.raises(StudyError, match="another configuration or study version"):
        run_cell(small_cell(epochs=20), folder)


def test_final_policies_and_their_returns(tmp_path: Path) -> None:
    cell, folder = small_cell(family="logit-normal", epochs=1, keeps_policies=True), folder_in(tmp_path)
    run_cell(cell, folder)
    policies, returns = folder.policy_files(cell)
    loaded = load_policies(policies)
    rows = pq.read_table(returns).to_pylist()
    counts = Counter((row["seed"], row["greedy"]) for row in rows)
    assert counts == {(s, w): 10 for s in (0, 1) for w in ("mean", "median", "mode", "sample")}
    sampled = [row["return"] for row in rows if row["greedy"] == "sample"]
    assert len(set(sampled)) == 20
    first = int(generator_of(1, 2**31).integers(2**31, size=10)[0])
    total = played_by_gymnasium(lambda obs: loaded[1].act(obs, "mode"), first)
    (found,) = [r["return"] for r in rows if (r["seed"], r["greedy"], r["episode"]) == (1, "mode", 0)]
    assert found == pytest.approx(total, rel=1e-4, abs=1e-3)


def test_other_policies_stay_in_the_work_folder(tmp_path: Path) -> None:
    cell, folder = small_cell(epochs=1), folder_in(tmp_path)
    run_cell(cell, folder)
    assert len(load_policies(folder.policy_files(cell)[0])) == 2
    assert not (folder.results / "policies").exists()


def test_a_diverged_seed_is_marked_and_the_cell_goes_on(tmp_path: Path) -> None:
    run = MeasuredTrainer(small_cell(epochs=10))
    run.epoch()
    run.trainer.networks.actor.theta[1] = float("nan")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(9):
            run.epoch()
    table = run.table()
    assert table["diverged"].to_pylist()[-2:] == [False, True]
    for name in ("greedy_return", "action_std", "kl"):
        good, bad = table[name].to_pylist()[-2:]
        assert np.isfinite(good), name
        assert np.isnan(bad), f"{name}: the robot of a diverged seed goes on, but it is nobody's result"


def test_rows_end_with_the_epoch_in_which_a_seed_diverged() -> None:
    """What a robot does while it has no policy, it stands still and its episodes end, is no result."""
    config = small_cell(epochs=3).config
    records = [
        {"epoch": e, "env_steps": 64 * (e + 1), "seconds": 1.0, "episodes": np.array([2, 2])}
        | {"return_mean": np.array([10.0 + e, 20.0 + e]), "diverged": np.array([False, e > 0])}
        for e in range(3)
    ]
    measured = {"epoch": 2, "kl": np.array([0.1, 0.2]), "evaluation_seconds": 1.0}
    table = table_of(config, records, [measured])
    assert np.array_equal(table["return_mean"], [10, 20, 11, 21, 12, np.nan], equal_nan=True)
    assert table["episodes"].to_pylist() == [2, 2, 2, 2, 2, 0]
    assert np.isnan(table["kl"].to_pylist()[-1])
    assert table["evaluation_seconds"].to_pylist()[-1] == 1


def test_the_policies_of_some_seeds_alone_are_kept(tmp_path: Path) -> None:
    whole = small_cell("ppo", "beta", seeds=(3, 4, 5), epochs=1, keeps_policies=True)
    some = replace(whole, arm="some", keeps_seeds=(5, 3))
    folder = folder_in(tmp_path)
    assert run_cell(some, folder) == run_cell(whole, folder) == "finished"
    kept, every = (load_policies(folder.policy_files(cell)[0]) for cell in (some, whole))
    assert [policy.seed for policy in kept] == [5, 3]
    assert not file_checks.wrong_policies(some, folder.policy_files(some)[0])
    assert file_checks.wrong_policies(whole, folder.policy_files(some)[0])
    obs = np.linspace(-1, 1, 11)  # of Hopper
    assert np.array_equal(kept[0].act(obs), every[2].act(obs))
    assert np.array_equal(kept[1].act(obs), every[0].act(obs))
    assert not np.array_equal(kept[0].act(obs), kept[1].act(obs))
    with pytest.raises(ValueError, match=r"not \[9\]"):
        run_cell(replace(whole, arm="none", keeps_seeds=(9,)), folder)
