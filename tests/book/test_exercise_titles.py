"""The titles of exercises and solutions, in a small book of two pages."""

import re

import pytest

from tests.book import small_book

INDEX = """# A page

```{toctree}
other
```

```{exercise} Half of $x$ (a part) (5 min, easy)
:label: ex-half

How much is it?
```

````{exercise-start} Twice (10 min, hard)
:label: ex-twice
````

And this?

````{exercise-end}
````

Not as easy as {ref}`ex-half`.
"""
OTHER = """# Another page

```{solution} ex-half
:class: dropdown

Half.
```

````{solution-start} ex-twice
````

Twice.

````{solution-end}
````
"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    folder = tmp_path_factory.mktemp("book")
    (folder / "index.md").write_text(INDEX, encoding="utf8")
    (folder / "other.md").write_text(OTHER, encoding="utf8")
    settings = {
        "extensions": ["myst_nb", "sphinx_exercise", "exercise_titles"],
        "myst_enable_extensions": ["dollarmath"],
        "numfig": True,
    }
    assert small_book.build(folder, settings) == ""
    index, other = (
        (folder / "html" / f"{name}.html").read_text(encoding="utf8") for name in ("index", "other")
    )
    return index, other


def titles(page: str) -> list[str]:
    """The titles of a page's boxes, as HTML."""
    return re.findall(r'<p class="admonition-title">(.*?)</p>', page, re.S)


def test_the_name_of_an_exercise_has_no_brackets_but_its_own(pages: tuple[str, str]) -> None:
    half, twice = titles(pages[0])
    assert re.fullmatch(
        r'<span class="caption-number">Exercise 1 </span>· Half of <span class="math[^>]*>[^<]*</span> '
        r"\(a part\) \(5 min, easy\)",
        half,
    )
    assert twice == '<span class="caption-number">Exercise 2 </span>· Twice (10 min, hard)'


def test_a_solution_names_its_exercise_by_number(pages: tuple[str, str]) -> None:
    half, twice = titles(pages[1])
    assert re.fullmatch(r'Solution to <a [^>]*href="index\.html#ex-half"[^>]*>Exercise 1</a>', half)
    assert re.fullmatch(r'Solution to <a [^>]*href="index\.html#ex-twice"[^>]*>Exercise 2</a>', twice)


def test_a_reference_is_as_it_was(pages: tuple[str, str]) -> None:
    assert re.search(
        r'Not as easy as <a [^>]*href="#ex-half"[^>]*><span class="[^"]*">Exercise 1</span></a>', pages[0]
    )
