"""Nothing that a test leaves in the temporary folder outlives the session."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
UNTIDY = """
import subprocess, sys, tempfile
from pathlib import Path

def test_untidy(tmp_path):
    Path(tempfile.mkdtemp(), "log").write_text("of a peer")
    subprocess.run([sys.executable, "-c", "import tempfile; tempfile.mkdtemp()"], check=True)
    (tmp_path / "kept").write_text("for whoever looks at a failure")
    {}
"""


def left_by(folder: Path, last_line: str, *options: str) -> set[str]:
    """Names of the files and folders that a session with an untidy test leaves in its temporary folder."""
    (folder / "test_untidy.py").write_text(UNTIDY.format(last_line))
    temporary = folder / "temporary"
    temporary.mkdir()
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-c",
            "pyproject.toml",
            "-p",
            "tests.temporary",
            *options,
            folder,
        ],
        cwd=ROOT,
        env={**os.environ, "TMPDIR": str(temporary), "PYTEST_ADDOPTS": "-p no:cacheprovider"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == ("assert False" in last_line), done.stdout + done.stderr
    return {path.name for path in temporary.rglob("*") if path.is_file() or path.name.startswith("tmp")}


@pytest.mark.slow
@pytest.mark.parametrize("options", [(), ("-n", "1")], ids=["one process", "a worker"])
def test_nothing_is_left(tmp_path: Path, options: tuple[str, ...]) -> None:
    assert left_by(tmp_path, "pass", *options) == set()


@pytest.mark.slow
def test_of_a_failure_pytests_own_folder_is_left(tmp_path: Path) -> None:
    assert left_by(tmp_path, "assert False") == {"kept"}
