"""Where mutants are planted: each in a process of its own, forked from one that has imported the libraries.

A copy of the package carries the mutant, and the new process finds that copy before any other. The standard library's
fork server does the forking. What it preloads imports nothing of the package, and starts no thread but that of Arrow's
allocator, which a fork does without.
"""

import gc
import multiprocessing
import os
import shutil
import sys
from pathlib import Path
from unittest import mock

import hypothesis
import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "inbounds"
LIBRARIES = [
    *(
        "pytest",
        "hypothesis",
        "torch",
        "torch._dynamo",  # which the first optimiser imports
        "numba",
        "scipy.stats",
        "mpmath",
        "mujoco",
        "gymnasium",
        "pyarrow.parquet",
        "tyro",
    ),
    *("matplotlib.pyplot", "bokeh.plotting", "nbformat"),
]
ANOTHER_PACKAGE = 70
"""Exit status of a run that imported another copy of the package than the one it was given."""


def copy_package(folder: Path) -> Path:
    """Copy the package, with its bytecode, into ``folder``, and return the copy."""
    return Path(shutil.copytree(PACKAGE, folder / "inbounds"))


def run_tests(nodes: list[str], folder: Path, seconds: float = 600) -> tuple[int | None, str]:
    """Run tests against the copy in ``folder``; return pytest's exit status (None: no end in time) and its output."""
    output = folder / "output.txt"
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(LIBRARIES)
    process = context.Process(target=_run, args=(nodes, str(folder), str(output)))
    with mock.patch.object(sys, "path", [str(folder), *sys.path]):  # the new process starts with this path
        process.start()
    process.join(seconds)
    status = process.exitcode
    process.kill()
    process.join()
    return status, output.read_text(encoding="utf8") if output.exists() else ""


def _run(nodes: list[str], folder: str, output: str) -> None:
    """Run pytest in the new process, and end it at once: neither threads nor exit handlers may hold it up."""
    gc.freeze()  # pytest collects garbage four times, and none of it is the libraries'
    file = os.open(output, os.O_WRONLY | os.O_CREAT)
    os.dup2(file, 1)
    os.dup2(file, 2)
    os.chdir(ROOT)
    os.environ |= {"PYTHONPATH": folder, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    # A mutant is killed by any example: there is no use for the smallest, nor for remembering it.
    phases = (hypothesis.Phase.explicit, hypothesis.Phase.generate)
    hypothesis.settings.register_profile("mutants", phases=phases, database=None)
    hypothesis.settings.load_profile("mutants")
    import inbounds

    status = pytest.main(["-q", "-x", "-p", "no:cacheprovider", *nodes])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status if Path(inbounds.__file__).is_relative_to(folder) else ANOTHER_PACKAGE)
