"""Command lines of runs that take a moment."""

import contextlib
import io
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa

from inbounds.cli import main

SMALL = (
    *("--seeds", "2", "--algorithm.horizon", "128", "--algorithm.minibatch-size", "64"),
    *("--algorithm.num-epochs", "1", "--network.hidden-sizes", "8", "--checkpoint-every", "2"),
)


def small(run_dir: Path, epochs: int = 3, env: str = "Hopper-v5", *more: str) -> list[str]:
    return ["train", env, *SMALL, "--epochs", str(epochs), "--out", str(run_dir), *more]


def run(*args: str | Path) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command line, run in this process as on its own."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter("default")
        code = main([str(arg) for arg in args])
    return code, out.getvalue(), err.getvalue()


def succeeds(args: Sequence[str | Path]) -> str:
    code, out, err = run(*args)
    assert (code, err) == (0, "")
    return out


def same_rows(a: pa.Table, b: pa.Table) -> bool:
    """Whether two tables agree bit for bit (NaN equals NaN), wall time apart."""
    assert a.schema.equals(b.schema)
    return all(
        np.array_equal(a[name].to_numpy().view("V1"), b[name].to_numpy().view("V1"))
        for name in a.column_names
        if name != "seconds"
    )


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
