"""How tables are stored and read, those of a run and those of the studies' cells."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from inbounds.learning.storage.run_metadata import METADATA_KEY, parsed
from inbounds.learning.storage.whole_files import damaged, says_nothing_of_the_file

DIGEST_KEY = f"{METADATA_KEY}-sha256"


def parquet_bytes(table: pa.Table, metadata: str) -> Any:
    """Return a table as a Parquet file: floats without loss, their bytes split into streams, compressed by zstd."""
    encodings = {
        field.name: "BYTE_STREAM_SPLIT" if pa.types.is_floating(field.type) else "DELTA_BINARY_PACKED"
        for field in table.schema
        if pa.types.is_floating(field.type) or pa.types.is_integer(field.type)
    }
    sink = pa.BufferOutputStream()
    pq.write_table(
        table.replace_schema_metadata({METADATA_KEY: metadata, DIGEST_KEY: _digest(metadata, table.schema)}),
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
        table = file.read()
        _require_digest(table.schema)
        return table


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
        schema = pq.read_schema(path)
        _require_digest(schema)
        found = about_of(schema)
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


def _digest(metadata: str, schema: pa.Schema) -> str:
    """Return the SHA-256 of what Parquet's own checksums, which are of pages, do not cover."""
    columns = [f"{field.name} {field.type}" for field in schema]
    return hashlib.sha256("\n".join([metadata, *columns]).encode()).hexdigest()


def _require_digest(schema: pa.Schema) -> None:
    """Raise unless a schema is the one that was written; an older table has no digest."""
    said = schema.metadata or {}
    if (kept := said.get(DIGEST_KEY.encode())) is None:
        return
    if kept.decode(errors="replace") != _digest(
        said.get(METADATA_KEY.encode(), b"").decode(errors="replace"), schema
    ):
        raise ValueError("the checksum of its columns and of what it says of itself is wrong")


@contextlib.contextmanager
def _damage_named(path: str | Path, remedy: str) -> Iterator[None]:
    try:
        yield
    except (pa.ArrowException, OSError, ValueError) as error:
        if says_nothing_of_the_file(error):
            raise
        raise damaged(Path(path), error, remedy) from error
