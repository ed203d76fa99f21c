"""`inbounds bench`: the benchmark lives in the source tree, beside the peers it needs."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from inbounds.cli.errors import CommandError

SCRIPT = Path("benchmarks") / "run.py"
MODULE = "benchmarks.run"


def find_root() -> Path | None:
    """Return the root of the source tree that this package runs from, if the benchmark is in it; else None."""
    root = Path(__file__).resolve().parents[3]  # src/inbounds/cli/benchmark.py
    return root if (root / SCRIPT).is_file() else None


def run(args: Sequence[str]) -> int:
    """Run the benchmark in its own process, from the root of the source tree.

    Args:
        args: its options.

    Returns:
        Its exit code.

    Raises:
        CommandError: the source tree is not there.
    """
    root = find_root()
    if root is None:
        raise CommandError(
            f"{SCRIPT} is not part of the installed package: clone the project, and run `make bench` in it"
        )
    return subprocess.run([sys.executable, "-m", MODULE, *args], cwd=root, check=False).returncode
