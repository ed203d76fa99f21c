"""Evaluations: starts and returns of the final evaluation, bang-bang and doing nothing, written whole, resumable."""

import dataclasses
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pyarrow as pa
import pytest

import inbounds.robots
from inbounds.learning import TrainConfig, load_policies
from inbounds.learning.storage.parquet import parquet_bytes
from inbounds.learning.storage.whole_files import DamagedFileError
from inbounds.study import Cell, StudyFolder, read_cell, run_cell, store
from inbounds.study.running import check_ways as checks
from inbounds.study.running import evaluate, play_ways
from inbounds.study.running.play_records import records_of
from inbounds.study.running.play_ways import evaluate_cells, final_starts, play_cell
from inbounds.study.running.verify import check_sums
from inbounds.study.ways_played import (
    COLUMNS,
    FIRST_STEPS,
    Played,
    evaluation_file,
    nothing_file,
    read_nothing,
    read_ways,
    summary,
    ways_of,
    wrong_ways,
)
from tests.study.small import folder_in, small_cell

LIMIT = 40
FAMILIES = ("gaussian", "logit-normal")


def cell_of(family: str) -> Cell:
    return small_cell(family=family, robot="Swimmer", epochs=1, keeps_policies=True)


@pytest.fixture(autouse=True, scope="module")
def short_episodes() -> Iterator[None]:
    def make(config: TrainConfig, num_envs: int) -> Any:
        return inbounds.robots.make(config.env, num_envs, max_episode_steps=LIMIT)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluate, "make_environments", make)
        patch.setattr(play_ways, "ROBOTS", ("Swimmer",))
        yield


@pytest.fixture(scope="module")
def done(short_episodes: None, tmp_path_factory: pytest.TempPathFactory) -> StudyFolder:
    folder = folder_in(tmp_path_factory.mktemp("played"))
    for family in FAMILIES:
        run_cell(cell_of(family), folder)
    assert evaluate_cells([cell_of(family) for family in FAMILIES], folder) == list(map(cell_of, FAMILIES))
    return folder


@pytest.fixture
def folder(done: StudyFolder, tmp_path: Path) -> StudyFolder:
    """A copy to damage."""
    shutil.copytree(done.results, tmp_path / "results")
    return folder_in(tmp_path)


def ways(folder: StudyFolder, family: str = "logit-normal") -> dict[str, Played]:
    return read_ways(folder, cell_of(family))


@pytest.mark.parametrize("family", FAMILIES)
def test_the_returns_of_the_final_evaluation_are_repeated(done: StudyFolder, family: str) -> None:
    cell, played = cell_of(family), ways(done, family)
    stored = read_cell(done.policy_files(cell)[1]).to_pylist()
    compared = 0
    for way in set(played) & {"mean", "median", "mode", "sample"}:
        expected = [row["return"] for row in stored if row["greedy"] == way]
        assert played[way].returns.ravel().tolist() == expected
        compared += 1
    assert compared == (2 if family == "gaussian" else 4)


def test_bang_bang_is_the_median_at_the_nearer_bound(done: StudyFolder) -> None:
    """By Gymnasium's robot, one policy and start at a time."""
    cell, played = cell_of("logit-normal"), ways(done)
    env = gymnasium.make("Swimmer-v5")
    for s, policy in enumerate(load_policies(done.policy_files(cell)[0])):
        obs, _ = env.reset(seed=int(final_starts(policy.seed)[2]))
        total = 0.0
        for _ in range(LIMIT):
            obs, reward, *_ = env.step(np.where(policy.act(obs) < 0, -1.0, 1.0).astype(np.float32))
            total += float(reward)
        assert played["median-snapped"].returns[s, 2] == pytest.approx(total, rel=1e-4, abs=1e-3)
    for way in ("median-snapped", "sample-snapped"):
        assert (played[way].actions["at_bounds"] == 1).all()
        assert (played[way].actions["abs_q05"] == 1).all()


@pytest.fixture(scope="module")
def hoppers(short_episodes: None, tmp_path_factory: pytest.TempPathFactory) -> tuple[Cell, StudyFolder]:
    """Untrained hoppers, which fall before the limit at full torque."""
    cell = dataclasses.replace(cell_of("logit-normal"), robot="Hopper")
    folder = folder_in(tmp_path_factory.mktemp("hoppers"))
    run_cell(cell, folder)
    return cell, folder


def test_an_episode_ends_where_the_robot_falls(hoppers: tuple[Cell, StudyFolder]) -> None:
    """By Gymnasium's robot, one policy and start at a time."""
    cell, folder = hoppers
    players = play_ways.WatchedPlayers(play_ways.run_with_policies(cell, folder), 5)
    rows = iter(players.rows("median-snapped"))
    players.close()
    env, lengths = gymnasium.make("Hopper-v5", max_episode_steps=LIMIT), []
    for policy in load_policies(folder.policy_files(cell)[0]):
        for start in final_starts(policy.seed)[:5]:
            row, actions, rewards, over = next(rows), [], [], False
            obs, _ = env.reset(seed=int(start))
            while not over:
                actions.append(np.where(policy.act(obs) < 0, -1.0, 1.0))
                obs, reward, fallen, late, _ = env.step(actions[-1])
                rewards.append(float(reward))
                over = fallen or late
            lengths.append(len(rewards))
            told = {
                "length": len(rewards),
                "return": sum(rewards),
                "first_reward": sum(rewards[:FIRST_STEPS]),
            }
            told |= summary(np.array(actions), len(actions))
            assert {name: row[name] for name in told} == pytest.approx(told, rel=1e-3, abs=1e-3)
    assert min(lengths) < LIMIT


def test_records_are_of_the_steps_before_the_fall(hoppers: tuple[Cell, StudyFolder]) -> None:
    cell, folder = hoppers
    players = play_ways.WatchedPlayers(play_ways.run_with_policies(cell, folder), 1)
    lengths = [row["length"] for row in players.rows("sample")]
    players.close()
    assert [row["steps"] for row in records_of(cell, folder) if row["record"] == "latent, float32"] == lengths
    assert min(lengths) < LIMIT


def test_snapped_samples_are_the_samples_at_their_bounds(done: StudyFolder) -> None:
    """The first action of both is of one draw, so both move the robot to the same side."""
    sample, snapped = (rows_by(done, way) for way in ("sample", "sample-snapped"))
    for one, other in zip(sample, snapped, strict=True):
        np.testing.assert_array_equal(np.where(one[0] < 0, -1.0, 1.0), other[0])
    assert any((np.sign(one[0]) != np.sign(sample[0][0])).any() for one in sample)


def rows_by(folder: StudyFolder, way: str) -> list[np.ndarray]:
    """The actions `[T, A]` of each episode."""
    players = play_ways.WatchedPlayers(play_ways.run_with_policies(cell_of("logit-normal"), folder), 3)
    players.rows(way)
    players.close()
    return list(np.stack(players._seen, 1))


def test_doing_nothing_is_the_middle_of_the_box(done: StudyFolder) -> None:
    returns = read_nothing(done)["Swimmer"]
    env = gymnasium.make("Swimmer-v5")
    env.reset(seed=int(final_starts(3)[1]))
    total = sum(float(env.step(np.zeros(2))[1]) for _ in range(LIMIT))
    assert returns.shape == (10, 10)
    assert returns[3, 1] == pytest.approx(total, rel=1e-6)


def test_what_describes_actions() -> None:
    actions = np.array([[0.5, -1.0], [-0.5, -1.0], [0.5, 1.0], [7.0, 7.0]])
    found = summary(actions, 3)
    assert found["at_bounds"] == 0.5
    assert found["reversals"] == 0.75  # of four changes the second component's first is none
    assert (found["abs_q05"], found["abs_q50"], found["abs_q95"]) == (0.5, 0.75, 1.0)
    assert summary(actions, 1)["reversals"] == 0
    assert all(np.isnan(value) for value in summary(np.full((3, 2), np.nan), 3).values())
    assert ways_of("clipped-gaussian") == ("mean", "median", "sample", "median-snapped", "sample-snapped")


def test_what_is_played_stays(folder: StudyFolder) -> None:
    cells = [cell_of(family) for family in FAMILIES]
    before = {path: path.stat().st_mtime_ns for path in (folder.results / "evaluations").iterdir()}
    evaluation_file(folder, cells[0]).unlink()
    said: list[str] = []
    assert evaluate_cells(cells, folder, said.append) == cells[:1]
    assert said == [f"{cells[0].id}: played (1 of 2)"]
    changed = {p.name for p, t in before.items() if p.stat().st_mtime_ns != t}
    assert changed == {evaluation_file(folder, cells[0]).name}
    assert all(finding.ok for finding in check_sums(folder))
    assert evaluate_cells([small_cell()], folder) == []  # keeps no policies


def test_a_replay_repeats_the_rows(done: StudyFolder) -> None:
    found = checks.check_ways([cell_of(family) for family in FAMILIES], done)
    assert [finding.ok for finding in found] == [True, True]
    assert all("20 episodes (median-snapped) repeated exactly" in finding.message for finding in found)


def test_a_replay_notices_another_number(folder: StudyFolder) -> None:
    cell = cell_of("gaussian")
    rewrite(folder, cell, "return", lambda values: values + 1e-12 * (np.arange(len(values)) == 50))
    assert not checks.check_replay(cell, folder).ok
    assert checks.check_replay(cell, folder, ["median"]).ok  # row 50 is of another way


@pytest.mark.parametrize(("by", "ok"), [(1e-5, True), (1.0, False)])
def test_on_another_processor_the_first_steps_are_compared(
    folder: StudyFolder, monkeypatch: pytest.MonkeyPatch, by: float, ok: bool
) -> None:
    cell = cell_of("gaussian")
    rewrite(folder, cell, "return", lambda values: values + 1)
    rewrite(folder, cell, "first_reward", lambda values: values + by)
    here = play_ways.provenance() | {"processor": "another"}
    monkeypatch.setattr(checks, "provenance", lambda: here)
    finding = checks.check_replay(cell, folder)
    assert finding.ok == ok
    assert "another processor" in finding.message


def rewrite(folder: StudyFolder, cell: Cell, column: str, change: Any, **about: Any) -> None:
    path = evaluation_file(folder, cell)
    table, metadata = read_cell(path), store.read_metadata(path) | about
    values = pa.array(change(table[column].to_numpy()), COLUMNS[column][0])
    table = table.set_column(table.column_names.index(column), table.schema.field(column), values)
    folder.publish({path: parquet_bytes(table, json.dumps(metadata))})


def test_rows_of_other_policies_are_noticed(folder: StudyFolder) -> None:
    cell = cell_of("gaussian")
    assert checks.wrong_evaluation(cell, folder) == ""
    rewrite(folder, cell, "return", lambda values: values, policies="0" * 64)
    assert "of other policies" in checks.wrong_evaluation(cell, folder)
    assert not checks.check_ways([cell], folder)[0].ok


def test_a_damaged_evaluation_is_told_once_and_another_of_its_family_is_played(
    folder: StudyFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    cells = [cell_of("gaussian"), dataclasses.replace(cell_of("gaussian"), arm="another")]
    monkeypatch.setattr(checks, "evaluated", lambda *_: cells)
    monkeypatch.setattr(checks, "wrong_evaluation", lambda cell, _: "damaged" if cell == cells[0] else "")
    monkeypatch.setattr(checks, "check_replay", lambda cell, _: checks.Checked(cell.id, True, "played"))
    assert checks.check_ways(cells, folder) == [
        (f"evaluations/{cells[0].id}", False, "damaged"),
        (cells[1].id, True, "played"),
    ]


def test_an_evaluation_of_other_policies_is_not_read_and_is_played_again(folder: StudyFolder) -> None:
    cell, other = cell_of("gaussian"), cell_of("logit-normal")
    expected = ways(folder, "gaussian")
    rewrite(folder, cell, "return", lambda values: values + 1, policies="0" * 64)
    with pytest.raises(DamagedFileError, match=f"of other policies.*inbounds study evaluate {cell.id}"):
        ways(folder, "gaussian")
    assert evaluate_cells([cell, other], folder) == [cell]
    for way, played in ways(folder, "gaussian").items():
        np.testing.assert_array_equal(played.returns, expected[way].returns)
    assert all(finding.ok for finding in check_sums(folder))


def test_an_evaluation_without_its_policies_says_so(folder: StudyFolder) -> None:
    cell = cell_of("gaussian")
    policies = folder.policy_files(cell)[0]
    policies.write_bytes(policies.read_bytes()[:-9])
    with pytest.raises(DamagedFileError, match=f"delete .*cells/{cell.id}.parquet and run the cell"):
        play_cell(cell, folder)
    policies.unlink()
    with pytest.raises(FileNotFoundError, match=f"inbounds study run {cell.id}"):
        play_cell(cell, folder)
    with pytest.raises(DamagedFileError, match=f"{cell.id}.safetensors is missing"):
        ways(folder, "gaussian")


@pytest.mark.parametrize("key", ["session", "policies"])
def test_an_evaluation_that_does_not_say_its_origin_is_damaged(folder: StudyFolder, key: str) -> None:
    cell = cell_of("gaussian")
    path = evaluation_file(folder, cell)
    about = store.read_metadata(path)
    del about[key]
    folder.publish({path: parquet_bytes(read_cell(path), json.dumps(about))})
    assert f"it does not say its {key}" in checks.wrong_evaluation(cell, folder)
    assert not checks.check_replay(cell, folder).ok


def test_what_was_not_played_says_how_to(folder: StudyFolder) -> None:
    nothing_file(folder).unlink()
    with pytest.raises(FileNotFoundError, match=r"\(inbounds study evaluate\)"):
        read_nothing(folder)
    nothing_file(folder).write_bytes(b"cut")
    with pytest.raises(DamagedFileError, match=r"restore it .*nothing.parquet.*\(inbounds study evaluate\)"):
        read_nothing(folder)


def test_rows_that_are_not_the_cells_are_not_read(folder: StudyFolder) -> None:
    cell = cell_of("gaussian")
    table = read_cell(evaluation_file(folder, cell))
    assert wrong_ways(cell, table) == ""
    assert wrong_ways(cell, table.slice(1)).startswith("79 rows that are not")
    assert wrong_ways(cell, table.drop_columns(["reversals"])) == "column reversals is missing"
    metadata = json.dumps(store.read_metadata(evaluation_file(folder, cell)))
    folder.publish({evaluation_file(folder, cell): parquet_bytes(table.slice(1), metadata)})
    with pytest.raises(DamagedFileError, match=f"79 rows.*inbounds study evaluate {cell.id}"):
        read_ways(folder, cell)


def test_a_diverged_seed_has_no_return(folder: StudyFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    real = play_ways.run_with_policies

    def with_diverged(cell: Cell, where: StudyFolder) -> Any:
        trainer = real(cell, where)
        trainer.diverged[1] = True
        return trainer

    monkeypatch.setattr(play_ways, "run_with_policies", with_diverged)
    rows = play_cell(cell_of("gaussian"), folder, ["median"])
    assert [bool(np.isnan(row["return"])) for row in rows] == [False] * 10 + [True] * 10


def test_nothing_is_published_once(folder: StudyFolder) -> None:
    nothing_file(folder).unlink()
    said: list[str] = []
    evaluate_cells([cell_of("gaussian")], folder, said.append)
    assert said == ["nothing: played"]


def test_of_some_seeds_the_kept_are_played(short_episodes: None, tmp_path: Path) -> None:
    whole = small_cell(family="beta", seeds=(3, 4, 5), epochs=1, keeps_policies=True)
    some, folder = dataclasses.replace(whole, arm="some", keeps_seeds=(5, 3)), folder_in(tmp_path)
    for cell in (some, whole):
        run_cell(cell, folder)
    assert evaluate_cells([some, whole], folder) == [some, whole]
    assert checks.wrong_evaluation(some, folder) == ""
    assert checks.check_replay(some, folder).ok
    two, three = (read_ways(folder, cell)["median"] for cell in (some, whole))
    np.testing.assert_allclose(two.returns, three.returns[[2, 0]], rtol=1e-4, atol=1e-4)  # another batch
    assert abs(two.returns - three.returns[:2]).max() > 0.1
