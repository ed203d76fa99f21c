"""How tables are stored, those of a run and those of the study's cells."""

from __future__ import annotations

from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from inbounds.learning.storage.run_metadata import METADATA_KEY


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
