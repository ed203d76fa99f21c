"""The notebook that a new chapter starts from passes what chapters must pass; `make test` executes it, too."""

from pathlib import Path

import pytest

from tests.book import anatomy
from tests.book import test_notebooks as notebooks
from tests.book import test_student_copies as student_copies

TEMPLATE = Path(__file__).resolve().parents[2] / "tools" / "chapter_template.ipynb"


@pytest.mark.parametrize(
    "check",
    [
        notebooks.test_ignored_outputs_carry_no_claim,
        student_copies.test_a_chapters_copy_has_no_solution_and_lacks_nothing_else,
        student_copies.test_what_is_left_needs_nothing_from_a_solution,
    ],
)
def test_a_chapter_could_start_like_this(check) -> None:
    check(TEMPLATE)


def test_it_has_the_parts_of_a_chapter() -> None:
    assert list(anatomy.core_lacks(TEMPLATE)) == []


def test_it_is_stored_like_a_chapter(capsys: pytest.CaptureFixture) -> None:
    notebooks.test_stored_notebook_is_clean(TEMPLATE, capsys)
