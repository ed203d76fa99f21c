"""Each planted error is noticed by the test that claims to notice it (`make mutants`)."""

from dataclasses import replace
from pathlib import Path

import pytest

from tests import planting
from tests.mutants import MUTANTS, Mutant

FAILED = pytest.ExitCode.TESTS_FAILED


def outcome(mutant: Mutant, folder: Path) -> tuple[int | None, str]:
    """Plant a mutant in a copy of the package; return the exit status of its test, and what it said."""
    target = planting.copy_package(folder) / mutant.file
    sound = target.read_text(encoding="utf8")
    target.write_text(sound.replace(mutant.old, mutant.new), encoding="utf8")
    return planting.run_tests([mutant.test], folder)


def test_there_are_enough() -> None:
    assert len(MUTANTS) >= 150
    assert len({mutant.name for mutant in MUTANTS}) == len(MUTANTS)


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.name)
def test_the_snippet_is_still_there(mutant: Mutant) -> None:
    assert (planting.PACKAGE / mutant.file).read_text(encoding="utf8").count(mutant.old) == 1


@pytest.mark.mutants
def test_all_pass_without_a_mutant(tmp_path: Path) -> None:
    """The named tests pass on an unharmed copy: what kills a mutant is the mutation."""
    planting.copy_package(tmp_path)
    status, said = planting.run_tests(sorted({mutant.test for mutant in MUTANTS}), tmp_path)
    assert status == pytest.ExitCode.OK, said[-4000:]


@pytest.mark.mutants
@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.name)
def test_killed(mutant: Mutant, tmp_path: Path) -> None:
    status, said = outcome(mutant, tmp_path)
    assert status == FAILED, f"{mutant.name} survived {mutant.test}\n{said[-4000:]}"


SOUND = Mutant(
    "nothing is changed but a comment",
    "distributions/bounds.py",
    "from __future__ import annotations",
    "from __future__ import annotations  # unharmed",
    "tests/distributions/test_contract.py::test_kl_needs_equal_bounds",
)


@pytest.mark.mutants
@pytest.mark.parametrize(
    ("mutant", "status"),
    [
        (SOUND, pytest.ExitCode.OK),
        (replace(SOUND, new="raise ValueError"), pytest.ExitCode.USAGE_ERROR),
        (replace(SOUND, test="tests/distributions/test_contract.py::test_gone"), pytest.ExitCode.USAGE_ERROR),
    ],
    ids=["nobody notices", "nothing can be imported", "the test is gone"],
)
def test_what_is_not_noticed_by_its_test_is_not_killed(mutant: Mutant, status: int, tmp_path: Path) -> None:
    assert outcome(mutant, tmp_path)[0] == status != FAILED
