"""Each planted error is noticed by the test that claims to notice it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.mutants import MUTANTS, Mutant

ROOT = Path(__file__).resolve().parents[1]


def run_tests(nodes: list[str], source: Path) -> subprocess.CompletedProcess:
    """Run tests against the package in ``source`` instead of the installed one."""
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", *nodes],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(source), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )


def test_there_are_enough() -> None:
    assert len(MUTANTS) >= 12
    assert len({mutant.name for mutant in MUTANTS}) == len(MUTANTS)


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.name)
def test_the_snippet_is_still_there(mutant: Mutant) -> None:
    assert (ROOT / "src" / "inbounds" / mutant.file).read_text(encoding="utf8").count(mutant.old) == 1


@pytest.mark.slow
@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.name)
def test_killed(mutant: Mutant, tmp_path: Path) -> None:
    copy = tmp_path / "src"
    shutil.copytree(
        ROOT / "src" / "inbounds", copy / "inbounds", ignore=shutil.ignore_patterns("__pycache__")
    )
    target = copy / "inbounds" / mutant.file
    target.write_text(target.read_text(encoding="utf8").replace(mutant.old, mutant.new), encoding="utf8")
    done = run_tests([mutant.test], copy)
    assert done.returncode == 1, (
        f"{mutant.name} survived {mutant.test}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
    )


@pytest.mark.slow
def test_all_pass_without_a_mutant(tmp_path: Path) -> None:
    """The named tests pass on an unharmed copy: what kills a mutant is the mutation."""
    shutil.copytree(
        ROOT / "src" / "inbounds", tmp_path / "inbounds", ignore=shutil.ignore_patterns("__pycache__")
    )
    done = run_tests(sorted({mutant.test for mutant in MUTANTS}), tmp_path)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
