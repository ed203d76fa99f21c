"""The shipped results are what they say, and the engine still gives them: a change that alters them fails here.

Where a cell of a column ran on this processor with these wheels, its first two epochs must be repeated exactly;
elsewhere the rewards of the first steps are compared (`inbounds.study.verify`), and the engine's own golden runs
stand in.
"""

from pathlib import Path

import pyarrow.parquet as pq
import pytest

from inbounds.study import StudyFolder, all_cells
from inbounds.study.cell import SECOND_VERSION, STUDY_VERSION
from inbounds.study.running.check_ways import check_replay, wrong_evaluation
from inbounds.study.running.play_records import RECORDS, read_records, records_file
from inbounds.study.running.verify import (
    NOTHING_TO_RERUN,
    check_cells,
    check_column,
    check_sums,
    columns,
)
from inbounds.study.store import COLUMNS, read_cell, read_metadata, sha256
from inbounds.study.ways_played import EPISODES, evaluated, evaluation_file, read_nothing, read_ways

ROOT = Path(__file__).parents[2]
RESULTS = StudyFolder(ROOT / "results", ROOT / "runs" / "study")
CELLS = all_cells()


def test_files_have_their_checksums_and_are_of_this_study() -> None:
    wrong = [finding for finding in [*check_sums(RESULTS), *check_cells(CELLS, RESULTS)] if not finding.ok]
    assert wrong == []


def test_no_foreign_cell_is_shipped() -> None:
    planned = {cell.id for cell in CELLS}
    assert {path.stem for path in (RESULTS.results / "cells").glob("*.parquet")} <= planned


def test_every_column_means_what_the_table_of_columns_says() -> None:
    for path in (RESULTS.results / "cells").glob("*.parquet"):
        for field in pq.read_schema(path):
            kind, meaning = COLUMNS[field.name]
            assert (field.type, field.metadata) == (kind, {b"meaning": meaning.encode()}), (
                path.name,
                field.name,
            )


@pytest.mark.slow
@pytest.mark.parametrize(("algorithm", "family", "engine"), columns(CELLS))
def test_the_engine_repeats_two_epochs(
    algorithm: str, family: str, engine: str, capsys: pytest.CaptureFixture[str]
) -> None:
    finding = check_column(CELLS, RESULTS, algorithm, family, engine, epochs=2)
    with capsys.disabled():
        print(f"\n{finding.subject}: {finding.message}")
    assert finding.ok, (
        f"{finding.message}. If the change is meant: raise STUDY_VERSION, name it in the CHANGELOG"
    )
    finished = any(
        RESULTS.state(cell) == "finished"
        for cell in CELLS
        if (cell.algorithm, cell.family, cell.engine) == (algorithm, family, engine)
    )
    assert (finding.message == NOTHING_TO_RERUN) is not finished


def test_the_changelog_names_every_later_version_of_the_study() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf8")
    for version in {cell.version for cell in CELLS} - {STUDY_VERSION, SECOND_VERSION}:
        assert f"study version {version}" in changelog.lower()


def test_every_shipped_policy_has_been_played_or_is_new() -> None:
    """A cell that arrives is played by `inbounds study evaluate`; what has been played is of the policies beside it."""
    played = evaluated(RESULTS, CELLS)
    assert len(played) >= 38
    assert [said for cell in played if (said := wrong_evaluation(cell, RESULTS))] == []
    assert {path.stem for path in (RESULTS.results / "evaluations").glob("*.parquet")} == {
        "nothing",
        "records",
        *(cell.id for cell in played),
    }
    assert {robot: returns.shape for robot, returns in read_nothing(RESULTS).items()} == {
        robot: (10, episodes) for robot, episodes in EPISODES.items()
    }
    mine = {cell.id for cell in CELLS if cell.family == "logit-normal" and cell.keeps_policies}
    mine &= {path.stem for path in (RESULTS.results / "policies").glob("*.safetensors")}
    records, policies = read_records(RESULTS), RESULTS.results / "policies"
    assert len(records) >= 20
    assert records.keys() <= mine
    played = read_metadata(records_file(RESULTS), "policies")["policies"]
    assert played == {name: sha256(policies / f"{name}.safetensors") for name in records}
    assert all(kinds.keys() == RECORDS.keys() for kinds in records.values())


def test_the_evaluations_repeat_the_returns_of_the_final_policies() -> None:
    """Played at other times, from the same starts: bit for bit on the cell's processor, with ten episodes a seed."""
    compared = 0
    for cell in evaluated(RESULTS, CELLS):
        here = read_metadata(evaluation_file(RESULTS, cell))["session"]["processor"]
        if (
            EPISODES[cell.robot] < 10
            or len(cell.kept_seeds) < len(cell.seeds)  # played in another batch: to rounding only
            or read_metadata(RESULTS.cell_file(cell))["sessions"][-1]["processor"] != here
        ):
            continue
        rows = read_cell(RESULTS.policy_files(cell)[1]).to_pylist()
        for way, played in read_ways(RESULTS, cell).items():
            stored = [row["return"] for row in rows if row["greedy"] == way]
            if stored:
                assert played.returns.ravel().tolist() == stored, (cell.id, way)
                compared += 1
    assert compared > 60


@pytest.mark.slow
def test_a_shipped_evaluation_can_be_remade() -> None:
    cell = next(cell for cell in CELLS if cell.id == "standard-hopper-ppo-logit-normal")
    finding = check_replay(cell, RESULTS)
    assert finding.ok, finding.message
