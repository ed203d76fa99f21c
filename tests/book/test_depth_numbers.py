"""Statements, exercises and equations of a page without a number are told from those of a chapter."""

import re
from pathlib import Path

import pytest

from tests.book import small_book

ROOT = """# Front

```{toctree}
:numbered: 2

chapter
```

```{toctree}
deep
```
"""
PAGE = """# {name}

```{{prf:theorem}} T
:label: thm-{name}

It holds.
```

$$ x = 1 $$ (eq-{name})

```{{exercise-start}} E
:label: ex-{name}
```

Do it.

```{{exercise-end}}
```

Of the other: {{prf:ref}}`thm-{other}`, {{eq}}`eq-{other}`, {{ref}}`ex-{other}`.
"""
SETTINGS = {
    "extensions": ["myst_nb", "sphinx_proof", "sphinx_exercise", "depth_numbers"],
    "myst_enable_extensions": ["dollarmath"],
    "numfig": True,
    "math_numfig": True,
}


def said(folder: Path, name: str) -> str:
    text = (folder / "html" / f"{name}.html").read_text(encoding="utf8")
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", "", text))


@pytest.fixture
def book(tmp_path: Path) -> Path:
    (tmp_path / "index.md").write_text(ROOT, encoding="utf8")
    for name, other in (("chapter", "deep"), ("deep", "chapter")):
        (tmp_path / f"{name}.md").write_text(PAGE.format(name=name, other=other), encoding="utf8")
    assert small_book.build(tmp_path, SETTINGS) == ""
    return tmp_path


def test_a_number_without_a_chapter_has_a_letter(book: Path) -> None:
    chapter, deep = said(book, "chapter"), said(book, "deep")
    assert "Theorem 1.1" in chapter
    assert "Of the other: Theorem D.1, (D.1), Exercise D.1." in chapter
    assert "Theorem D.1" in deep
    assert "Of the other: Theorem 1.1, (1.1), Exercise 1.1." in deep


def test_a_second_build_writes_only_what_has_changed(book: Path) -> None:
    page = book / "html" / "deep.html"
    written = page.stat().st_mtime_ns
    small_book.build(book, SETTINGS, fresh=False)
    assert page.stat().st_mtime_ns == written
    (book / "chapter.md").write_text((book / "chapter.md").read_text() + "\nMore.\n")
    small_book.build(book, SETTINGS, fresh=False)
    assert page.stat().st_mtime_ns == written
    assert "Of the other: Theorem D.1, (D.1), Exercise D.1. More." in said(book, "chapter")
