"""How tables are stored and read, those of a run and those of the studies' cells."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from inbounds.learning.storage.run_metadata import METADATA_KEY, parsed
from inbounds.learning.storage.whole_files import damaged, says_nothing_of_the_file


def parquet_bytes(table: pa.Table, metadata: str) -> Any:
    """Return a table as a Parquet file: floats without loss, their bytes split into streams, compressed by zstd."""
    encodings = {
        field.name: "BYTE_STREAM_SPLIT" if pa.types.is_floating(field.type) else "DELTA_BINARY_PACKED"
        for field in table.schema
        if pa.types.is_floating(field.type) or pa.types.is_integer(field.type)
    }
    sink = pa.BufferOutputStream()
    pq.write_table(
        table.replace_schema_metadata({METADATA_KEY: metadata}),
        sink,
        compression="zstd",
        compression_level=9,
        use_dictionary=False,
        column_encoding=encodings,
        write_page_checksum=True,
    )
    return sink.getvalue()


def read_table(path: str | Path, remedy: str = "") -> pa.Table:
    """Read a table that `parquet_bytes` has stored, each page against its checksum.

    Args:
        path: of the file.
        remedy: what to do about a damaged file; by default what `damaged` says.

    Raises:
        FileNotFoundError: there is no such file.
        DamagedFileError: it is damaged.
    """
    with _damage_named(path, remedy), pq.ParquetFile(path, page_checksum_verification=True) as file:
        return file.read()


def read_about(path: str | Path, remedy: str = "", keys: Collection[str] = ()) -> dict[str, Any]:
    """Read what a stored table says of itself, without its rows.

    Args:
        path: of the file.
        remedy: what to do about a damaged file; by default what `damaged` says.
        keys: entries without which the file is none of ours.

    Raises:
        FileNotFoundError: there is no such file.
        DamagedFileError: it is damaged, or says nothing of itself, or lacks a key.
    """
    with _damage_named(path, remedy):
        found = about_of(pq.read_schema(path))
        if missing := [key for key in keys if key not in found]:
            raise ValueError(f"it does not say its {missing[0]}")
        return found


def about_of(schema: pa.Schema) -> dict[str, Any]:
    """Return what a stored table says of itself, from its schema.

    Raises:
        ValueError: it says nothing; other software wrote it, or an operation on the table has lost it.

    Example:
        >>> about_of(pa.schema([], {METADATA_KEY: '{"id": "ours"}'}))
        {'id': 'ours'}
    """
    return parsed((schema.metadata or {}).get(METADATA_KEY.encode()))


@contextlib.contextmanager
def _damage_named(path: str | Path, remedy: str) -> Iterator[None]:
    try:
        yield
    except (pa.ArrowException, OSError, ValueError) as error:
        if says_nothing_of_the_file(error):
            raise
        raise damaged(Path(path), error, remedy) from error
