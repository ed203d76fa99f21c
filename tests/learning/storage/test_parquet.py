"""Stored tables: what they say of themselves, and how a damaged one is told from a sound one."""

import errno
import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from inbounds.learning.storage.parquet import about_of, parquet_bytes, read_about, read_table
from inbounds.learning.storage.run_metadata import METADATA_KEY
from inbounds.learning.storage.run_store import config_of
from inbounds.learning.storage.whole_files import DamagedFileError

TABLE = pa.table({"x": pa.array([float(i) for i in range(4000)], pa.float32())})
ABOUT = {"id": "ours", "config": {}}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "table.parquet"
    path.write_bytes(parquet_bytes(TABLE, json.dumps(ABOUT)))
    return path


def test_a_table_comes_back_with_what_it_says_of_itself(path: Path) -> None:
    table = read_table(path)
    assert table.equals(TABLE)
    assert read_about(path, keys={"id", "config"}) == about_of(table.schema) == ABOUT


def test_a_flipped_bit_a_lost_end_and_a_foreign_table_are_told_with_the_remedy(path: Path) -> None:
    whole = path.read_bytes()
    flipped = bytearray(whole)
    flipped[200] ^= 1
    path.write_bytes(flipped)
    with pytest.raises(DamagedFileError, match="make it again"):
        read_table(path, "make it again")
    path.write_bytes(whole[:-9])
    for read in (read_table, read_about):
        with pytest.raises(DamagedFileError, match="make it again"):
            read(path, "make it again")
    pq.write_table(TABLE, path)
    with pytest.raises(DamagedFileError, match=r"inbounds did not write it.*make it again"):
        read_about(path, "make it again")
    with pytest.raises(ValueError, match="inbounds did not write it"):
        config_of(read_table(path))


def test_another_word_about_itself_is_damage(path: Path) -> None:
    table = pq.read_table(path)
    about = table.schema.metadata | {METADATA_KEY.encode(): json.dumps(ABOUT | {"id": "mine"}).encode()}
    pq.write_table(table.replace_schema_metadata(about), path)
    for read in (read_table, read_about):
        with pytest.raises(DamagedFileError, match="of its columns and of what it says of itself"):
            read(path)


def test_another_name_of_a_column_is_damage(path: Path) -> None:
    table = pq.read_table(path)
    pq.write_table(table.rename_columns(["y"]).replace_schema_metadata(table.schema.metadata), path)
    with pytest.raises(DamagedFileError, match="of its columns"):
        read_table(path)


def test_an_older_table_without_that_checksum_is_read(path: Path) -> None:
    pq.write_table(TABLE.replace_schema_metadata({METADATA_KEY: json.dumps(ABOUT)}), path)
    assert read_about(path) == ABOUT
    assert read_table(path).equals(TABLE)


def test_a_table_of_ours_that_is_no_runs_has_no_configuration(path: Path) -> None:
    with pytest.raises(ValueError, match="of no run"):
        config_of(read_table(path))


@pytest.mark.parametrize("said", ["no JSON", "[1]", "null"])
def test_words_that_are_no_entries_are_damage(said: str, path: Path) -> None:
    path.write_bytes(parquet_bytes(TABLE, said))
    with pytest.raises(DamagedFileError):
        read_about(path)


def test_a_missing_entry_is_named(path: Path) -> None:
    with pytest.raises(DamagedFileError, match="it does not say its seconds"):
        read_about(path, keys={"id", "seconds"})


def test_a_file_that_is_not_there_is_no_damage_and_a_folder_is(path: Path) -> None:
    for read in (read_table, read_about):
        with pytest.raises(FileNotFoundError):
            read(path.with_name("none.parquet"))
        with pytest.raises(DamagedFileError, match="is a directory"):
            read(path.parent)  # which PyArrow would read as one table


@pytest.mark.parametrize(
    "error",
    [PermissionError(errno.EACCES, "no"), OSError(errno.EMFILE, "too many"), pa.ArrowMemoryError("no room")],
)
def test_what_says_nothing_of_the_file_is_no_damage(
    path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(pq, "ParquetFile", fail)
    monkeypatch.setattr(pq, "read_schema", fail)
    for read in (read_table, read_about):
        with pytest.raises(type(error)) as found:
            read(path)
        assert found.value is error
