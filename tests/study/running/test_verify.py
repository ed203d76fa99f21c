import contextlib
import importlib
import json
import re
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

import inbounds.robots
from inbounds.cli import main, studying
from inbounds.learning import TrainConfig, Trainer, ppo
from inbounds.learning.storage.parquet import parquet_bytes
from inbounds.learning.storage.run_store import save_policies
from inbounds.learning.storage.whole_files import DamagedFileError
from inbounds.study import StudyFolder, read_cell, run_cell, select, store, verify
from inbounds.study.grid import ROBOTS, Cell
from inbounds.study.outcomes import Outcomes
from inbounds.study.running import evaluate
from inbounds.study.running.provenance import provenance
from inbounds.study.running.verify import CHEAP_FIRST, TOLERANCE, Checked, check_rerun, first_mismatch
from tests.cli.small import run
from tests.study import synthetic
from tests.study.small import folder_in, small_cell
from tests.study.synthetic import write_cells

CELL = small_cell(epochs=10, keeps_policies=True)


@pytest.fixture(autouse=True, scope="module")
def short_evaluations() -> Iterator[None]:
    def make(config: TrainConfig, num_envs: int) -> Any:
        return inbounds.robots.make(config.env, num_envs, max_episode_steps=40)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluate, "make_environments", make)
        yield


@pytest.fixture(scope="module")
def done(short_evaluations: None, tmp_path_factory: pytest.TempPathFactory) -> StudyFolder:
    folder = folder_in(tmp_path_factory.mktemp("done"))
    run_cell(CELL, folder)
    return folder


@pytest.fixture
def folder(done: StudyFolder, tmp_path: Path) -> StudyFolder:
    """A copy to damage."""
    shutil.copytree(done.results, tmp_path / "results")
    return folder_in(tmp_path)


def bad(findings: list[Checked]) -> list[str]:
    return [f"{finding.subject}: {finding.message}" for finding in findings if not finding.ok]


def republish(folder: StudyFolder, table: pa.Table | None = None, **metadata: Any) -> None:
    path = folder.cell_file(CELL)
    about = json.dumps(store.read_metadata(path) | metadata)
    folder.publish({path: parquet_bytes(read_cell(path) if table is None else table, about)})


def test_good_results_pass_and_repeat_exactly(folder: StudyFolder) -> None:
    findings = verify([CELL, small_cell("trpo")], folder, epochs=10)
    assert bad(findings) == []
    assert [finding[::2] for finding in findings] == [
        ("checksums.txt", "3 of 3 files have their checksums"),
        (CELL.id, "10 epochs repeated exactly"),
        ("trpo × gaussian × autograd", "skipped: none of its cells is finished"),
    ]


def test_where_nothing_is_finished_there_is_nothing_to_call_good(tmp_path: Path) -> None:
    findings = verify([CELL], folder_in(tmp_path), epochs=1)
    assert bad(findings) == ["checksums.txt: nothing is finished here: another --results?"]


def test_checksums_are_what_sha256sum_reads(folder: StudyFolder) -> None:
    lines = (folder.results / "checksums.txt").read_text().splitlines()
    assert [line.split("  ") for line in lines] == [
        [store.sha256(folder.results / name), name]
        for name in (
            f"cells/{CELL.id}.parquet",
            f"policies/{CELL.id}.parquet",
            f"policies/{CELL.id}.safetensors",
        )
    ]


def test_sums_written_at_the_same_time_are_all_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, real, both = folder_in(tmp_path), StudyFolder.checksums, threading.Barrier(2)

    def meet(self: StudyFolder) -> dict[str, str]:
        """Read, and wait for another who reads the same list; in vain where that one has to wait, too."""
        sums = real(self)
        with contextlib.suppress(threading.BrokenBarrierError):
            both.wait(0.5)
        return sums

    monkeypatch.setattr(StudyFolder, "checksums", meet)
    paths = [folder.results / "cells" / f"{i}.parquet" for i in range(6)]
    threads = [threading.Thread(target=folder.publish, args=({path: b"rows"},)) for path in paths]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert set(real(folder)) == {f"cells/{i}.parquet" for i in range(6)}


def test_a_changed_byte_a_missing_and_a_foreign_file_are_found(folder: StudyFolder) -> None:
    policies, returns = folder.policy_files(CELL)
    policies.write_bytes(policies.read_bytes()[:-1] + b"?")
    returns.rename(returns.with_name("foreign.parquet"))
    (folder.results / "cells" / ".x.parquet.partial").touch()  # of a process that was killed
    found = bad(verify([CELL], folder, rerun=()))
    assert [line.partition(":")[0] for line in found] == [
        f"policies/{CELL.id}.parquet",
        f"policies/{CELL.id}.safetensors",
        "policies/foreign.parquet",
        CELL.id,  # its policies cannot be read
    ]


def test_a_list_of_checksums_that_is_no_text_is_found(folder: StudyFolder) -> None:
    (folder.results / store.CHECKSUMS_FILE).write_bytes(b"\xff\xfe")
    assert folder.state(CELL) == "damaged"
    assert bad(verify([CELL], folder, rerun=()))


def test_what_a_killed_process_left_half_written_goes_with_the_next_result(folder: StudyFolder) -> None:
    path = folder.cell_file(CELL)
    left = [p.with_name(f".{p.name}.0123abcd.partial") for p in (path, folder.results / store.CHECKSUMS_FILE)]
    for each in left:
        each.touch()
    folder.publish({path: path.read_bytes()})
    assert not any(each.exists() for each in left)


@pytest.mark.parametrize(
    ("name", "made"),
    [
        ("untrained.json", "inbounds.study.ledger.untrained_returns"),
        ("greenhouse/curves.parquet", "python -m inbounds.book.own_task.greenhouse_runs"),
        ("motions.safetensors", "python -m inbounds.book.motions"),
    ],
)
def test_files_of_no_cell_are_checked_too(folder: StudyFolder, name: str, made: str) -> None:
    path = folder.results / name
    folder.publish({path: b"numbers"})
    assert bad(verify([CELL], folder, rerun=())) == []
    path.write_bytes(b"others")
    (found,) = bad(verify([CELL], folder, rerun=()))
    assert found.startswith(f"{name}: its checksum is wrong: restore it")
    assert made in found
    sums = folder.results / "checksums.txt"
    sums.write_text("".join(line for line in sums.read_text().splitlines(True) if name not in line))
    (found,) = bad(verify([CELL], folder, rerun=()))
    assert found == f"{name}: not in checksums.txt: delete it, or restore the list"


def test_rows_cut_off_or_of_another_configuration_are_found(folder: StudyFolder) -> None:
    republish(folder, read_cell(folder.cell_file(CELL)).slice(0, 18))
    assert "18 rows instead of 20" in bad(verify([CELL], folder, rerun=()))[0]
    assert "another configuration" in bad(verify([small_cell(epochs=20)], folder, rerun=()))[0]


@pytest.mark.parametrize("which", [0, 1])
def test_a_missing_file_is_found_without_its_line_in_the_list(folder: StudyFolder, which: int) -> None:
    path = folder.policy_files(CELL)[which]
    path.unlink()
    sums = folder.results / "checksums.txt"
    kept = [line for line in sums.read_text().splitlines() if f"policies/{path.name}" not in line]
    sums.write_text("\n".join(kept) + "\n")
    assert (
        f"policies/{path.name}: missing, and not in checksums.txt" in bad(verify([CELL], folder, rerun=()))[0]
    )


def doubled(table: pa.Table) -> pa.Table:
    """As many rows as before, one of them twice."""
    return pa.concat_tables([table.slice(0, 1), table.slice(0, 19)])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (doubled, "a row of epoch 0, seed 0 where epoch 0, seed 1 is due"),
        (lambda table: table.take([1, 0, *range(2, 20)]), "a row of epoch 0, seed 1 where epoch 0, seed 0"),
        (lambda table: table.drop_columns(["kl"]), "column kl is missing"),
        (lambda table: table.drop_columns(["greedy_return"]), "column greedy_return is missing"),
        (
            lambda table: table.append_column("alpha_q50", table["kl"]),
            "column alpha_q50 does not belong to it",
        ),
        (
            lambda table: table.set_column(
                table.column_names.index("kl"), "kl", pa.nulls(len(table), pa.float32())
            ),
            "column kl has values where none are due, or lacks some",
        ),
        (
            lambda table: table.set_column(
                table.column_names.index("episodes"), "episodes", table["episodes"].cast(pa.float64())
            ),
            "column episodes is of the type double",
        ),
    ],
)
def test_rows_that_have_a_checksum_and_are_wrong_are_found(
    folder: StudyFolder, change: Any, said: str
) -> None:
    republish(folder, change(read_cell(folder.cell_file(CELL))))
    assert folder.state(CELL) == "finished"  # as far as checksums go
    (found,) = bad(verify([CELL], folder, rerun=()))
    assert said in found
    assert said in check_rerun(CELL, folder, 1).message
    with pytest.raises(DamagedFileError, match=re.escape(said)):  # what report and ledger end in
        Outcomes.read(folder, [CELL])


def test_a_file_that_does_not_say_how_it_was_made_is_found(folder: StudyFolder) -> None:
    path = folder.cell_file(CELL)
    about = store.read_metadata(path)
    del about["sessions"]
    folder.publish({path: parquet_bytes(read_cell(path), json.dumps(about))})
    assert "sessions is missing" in bad(verify([CELL], folder, rerun=[CELL]))[0]


def test_policies_of_another_family_are_found(folder: StudyFolder, tmp_path: Path) -> None:
    policies, _ = folder.policy_files(CELL)
    other = small_cell(family="logit-normal", epochs=10, keeps_policies=True)
    save_policies(tmp_path / "other", Trainer(other.config))
    folder.publish({policies: (tmp_path / "other").read_bytes()})
    (found,) = bad(verify([CELL], folder, rerun=()))
    assert (
        "policies of another configuration (policy.family is 'logit-normal' instead of 'gaussian')" in found
    )
    folder.publish({policies: b"no policies"})
    (found,) = bad(verify([CELL], folder, rerun=()))
    assert f"{policies.name} is damaged" in found


def test_returns_of_the_policies_are_looked_into(folder: StudyFolder) -> None:
    path = folder.policy_files(CELL)[1]
    about, table = json.dumps(store.read_metadata(path)), read_cell(path)
    for wrong, said in (
        (table.slice(1), "79 rows that are not mean, median, mode, sample × 2 seeds × 10 episodes"),
        (table.drop_columns(["length"]), "column length is missing"),
    ):
        folder.publish({path: parquet_bytes(wrong, about)})
        (found,) = bad(verify([CELL], folder, rerun=()))
        assert said in found
        with pytest.raises(DamagedFileError, match=re.escape(said)):
            Outcomes.read(folder, [CELL])


@pytest.mark.parametrize("command", ["report", "ledger"])
def test_a_damaged_cell_ends_a_command_in_one_line(command: str, tmp_path: Path) -> None:
    (cell,) = select(["standard-hopper-ppo-beta"])
    folder = folder_in(tmp_path)
    write_cells(folder, [cell])
    path = folder.cell_file(cell)
    about = json.dumps(store.read_metadata(path))
    folder.publish({path: parquet_bytes(read_cell(path).drop_columns(["return_mean"]), about)})
    words = ["study", command, "--results", folder.results, "--work", folder.work]
    code, out, err = run(*words, *(["--out", tmp_path / "report.html"] if command == "report" else []))
    before = "reading the cells\n" if command == "report" else ""
    assert (code, out, err.count("\n")) == (1, before, 1)
    assert "column return_mean is missing" in err
    assert "git checkout -- " in err


@pytest.mark.parametrize(
    ("words", "looked_at"), [([], 2), (["--rerun", "standard-hopper-ppo-beta"], 1), (["--random", "1"], 1)]
)
def test_of_the_cells_that_run_again_the_evaluations_are_checked_too(
    words: list[str], looked_at: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen: list[int] = []
    monkeypatch.setattr(studying, "verify", lambda *_, **__: [])
    monkeypatch.setattr(studying, "check_ways", lambda cells, *_: chosen.append(len(cells)) or [])
    assert main(["study", "verify", "standard-hopper-ppo-beta", "standard-hopper-ppo-gaussian", *words]) == 0
    assert chosen == [looked_at]


@pytest.mark.parametrize("command", ["report", "ledger", "verify"])
def test_a_folder_that_is_not_there_is_an_error(command: str, tmp_path: Path) -> None:
    code, _, err = run("study", command, "--results", tmp_path / "missing")
    assert code == 2
    assert "name it with --results" in err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("column", ["return_mean", "greedy_return", "episodes", "kl"])
def test_one_other_number_is_found(done: StudyFolder, column: str) -> None:
    table = read_cell(done.cell_file(CELL))
    values = table[column].to_pylist()
    values[-1] = 7 if column == "episodes" else 0.123
    index = table.column_names.index(column)
    changed = table.set_column(
        index, table.schema.field(column), pa.array(values, table.schema.field(column).type)
    )
    assert f"{column} is " in first_mismatch(table, changed)
    assert "in epoch 9, seed 1" in first_mismatch(table, changed)
    assert first_mismatch(table, table) == ""


@pytest.mark.parametrize(
    ("expected", "found", "where"),
    [
        ([1.0, None, np.nan], [1.0, None, np.nan], ""),
        ([1.0, None, np.nan], [1.0, None, 2.0], "kl is 2.0 instead of nan in epoch 1, seed 0"),
        ([1.0, None, 2.0], [1.0, None, np.nan], "kl is nan instead of 2.0 in epoch 1, seed 0"),
        ([np.nan, None, 2.0], [np.nan, None, 3.0], "kl is 3.0 instead of 2.0 in epoch 1, seed 0"),
        ([1.0, None, 2.0], [1.0, np.nan, 2.0], "kl is nan instead of None in epoch 0, seed 1"),
        ([1.0, np.nan, 2.0], [1.0, None, 2.0], "kl is None instead of nan in epoch 0, seed 1"),
        ([0.0, None, 2.0], [-0.0, None, 2.0], ""),
    ],
)
def test_nan_and_null_are_values_like_others(
    expected: list[float | None], found: list[float | None], where: str
) -> None:
    def rows(values: list[float | None]) -> pa.Table:
        column = pa.array(values, pa.float32(), from_pandas=False)
        return pa.table({"epoch": [0, 0, 1], "seed": [0, 1, 0], "kl": column})

    assert first_mismatch(rows(expected), rows(found)) == where


def test_another_engine_is_found(folder: StudyFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    real = ppo.clipped_surrogate
    monkeypatch.setattr(ppo, "clipped_surrogate", lambda *args: 1.0001 * real(*args))
    finding = check_rerun(CELL, folder, 10)
    assert not finding.ok
    assert "the engine now gives other results; a new study version is due" in finding.message


@pytest.mark.parametrize(
    ("versions", "exact"),
    [({"torch": "0"}, False), ({"scipy": "0"}, False), ({"inbounds": "0", "python": "2"}, True)],
)
def test_wheels_decide_whether_rows_must_be_repeated(
    folder: StudyFolder, versions: dict[str, str], exact: bool
) -> None:
    (session,) = store.read_metadata(folder.cell_file(CELL))["sessions"]
    republish(folder, sessions=[session | {"versions": session["versions"] | versions}])
    finding = check_rerun(CELL, folder, 1)
    assert finding.ok
    assert ("repeated exactly" in finding.message) is exact


def test_on_another_machine_the_first_rewards_are_compared(
    folder: StudyFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And nothing is trained for that."""
    monkeypatch.delattr(Trainer, "epoch")
    about = store.read_metadata(folder.cell_file(CELL))
    elsewhere = [about["sessions"][0] | {"processor": "abacus"}]
    republish(folder, sessions=elsewhere)
    finding = check_rerun(CELL, folder, 1)
    assert finding.ok
    assert "differ by at most 0.0e+00" in finding.message
    rewards = about["first_rewards"]
    rewards[1][15] += 3 * TOLERANCE
    republish(folder, sessions=elsewhere, first_rewards=rewards)
    assert not check_rerun(CELL, folder, 1).ok


def test_of_a_column_the_cheapest_cell_of_this_machine_runs_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    column = {cell.robot: cell for cell in select(["standard"]) if cell.id.endswith("-ppo-beta")}
    folder, module, chosen = folder_in(tmp_path), importlib.import_module(verify.__module__), []

    def note(cell: Cell, *_: Any) -> Checked:
        chosen.append(cell.robot)
        return Checked(cell.id, True, "")

    monkeypatch.setattr(module, "check_rerun", note)
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr(synthetic, "provenance", lambda: provenance() | {"processor": "abacus"})
        write_cells(folder, [column["HalfCheetah"], column["Swimmer"]])
    verify([*column.values()], folder)
    write_cells(folder, [column["Ant"], column["Hopper"]])
    verify([*column.values()], folder)
    assert chosen == ["HalfCheetah", "Hopper"]
    assert set(CHEAP_FIRST) == set(ROBOTS)
