"""Every numbered equation is beside its code, or says why there is none; code and tests are there."""

import ast
import importlib
import pydoc
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def extension():
    """The book's extension, which is no part of the package, and its neighbour."""
    sys.path.insert(0, str(ROOT / "book" / "_ext"))
    yield importlib.import_module("code_and_equations")
    sys.path.remove(str(ROOT / "book" / "_ext"))
    for name in ("code_and_equations", "statements"):
        sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def numbered(extension):
    return list(extension.equations(ROOT / "notebooks"))


@pytest.fixture(scope="module")
def known(extension):
    return extension.entries(ROOT / "book")


def test_each_equation_is_listed_once_and_nothing_else(extension, numbered, known) -> None:
    labels = [equation.label for equation in numbered]
    assert len(labels) == len(set(labels)) > 0
    assert set(labels) - set(known) == set(), "name their code in book/equations.toml, or why there is none"
    stated = {statement.label for statement in extension.statements.statements(ROOT / "notebooks")}
    assert set(known) - set(labels) - stated == set(), "no chapter has these"


def test_an_equation_has_words_and_either_code_with_tests_or_a_reason(extension, numbered, known) -> None:
    tests = extension.statements.tests_of(ROOT / "book")
    for equation in numbered:
        entry = known[equation.label]
        assert entry.says, equation.label
        assert bool(entry.code) != bool(entry.exempt), f"{equation.label}: code, or why there is none"
        if entry.code:
            assert entry.tests or tests.get(equation.statement or ""), f"{equation.label}: name a test"


def test_a_listed_statement_has_code_and_its_tests_elsewhere(numbered, known) -> None:
    for label in set(known) - {equation.label for equation in numbered}:
        assert known[label].code, label
        assert not known[label].tests, f"{label}: its tests belong into book/statements.toml"


def test_all_code_is_there_and_on_the_api_page(known) -> None:
    api = (ROOT / "book" / "api.md").read_text(encoding="utf8")
    documented = set(re.findall(r"\.\. auto\w+:: (\S+)", api))
    for owner, members in re.findall(r"\.\. autoclass:: (\S+)\n   :members: (.+)", api):
        documented |= {f"{owner}.{member}" for member in members.split(", ")}
    for label, entry in known.items():
        for name in entry.code:
            assert pydoc.locate(name) is not None, f"{label}: {name}"
            assert name in documented, f"{label}: book/api.md lacks {name}"


def test_each_test_is_there(known) -> None:
    for label, entry in known.items():
        for test in entry.tests:
            file, _, name = test.partition("::")
            tree = ast.parse((ROOT / file).read_text(encoding="utf8"))
            assert name in [n.name for n in tree.body if isinstance(n, ast.FunctionDef)], f"{label}: {test}"


CHAPTER = """\
````{prf:theorem} A title
:label: thm-a

$$
x = 1
$$ (eq-inside)
````

$$ y = 2 $$ (eq-outside)

```{prf:proof}
$$
z = 3
$$ (eq-proof)
```
"""


def test_an_equation_knows_the_statement_it_stands_in(extension, tmp_path) -> None:
    import nbformat

    cells = [nbformat.v4.new_markdown_cell(CHAPTER)]
    nbformat.write(nbformat.v4.new_notebook(cells=cells), tmp_path / "01_a.ipynb")
    found = {e.label: e.statement for e in extension.equations(tmp_path)}
    assert found == {"eq-inside": "thm-a", "eq-outside": None, "eq-proof": "thm-a"}


def test_chapters_come_in_the_books_order(extension, tmp_path) -> None:
    import nbformat

    (tmp_path / "notebooks").mkdir()
    for name in ("beta", "gamma", "alpha", "elsewhere"):
        cells = [
            nbformat.v4.new_markdown_cell(f"$$ y = 2 $$ (eq-{name})\n\n{CHAPTER.replace('-', f'-{name}-')}")
        ]
        nbformat.write(nbformat.v4.new_notebook(cells=cells), tmp_path / "notebooks" / f"{name}.ipynb")
    core, depth = (
        "  - {file: notebooks/gamma}\n  - {file: notebooks/alpha}\n",
        "  - {file: notebooks/beta}\n",
    )
    parts = f"- numbered: 2\n  chapters:\n{core}- caption: Going deeper\n  chapters:\n{depth}"
    (tmp_path / "_toc.yml").write_text(f"root: index\nparts:\n{parts}")
    order = ["gamma", "alpha", "beta", "elsewhere"]
    found = list(extension.equations(tmp_path / "notebooks"))
    assert list(dict.fromkeys(e.chapter for e in found)) == order
    known = {e.label: extension.Entry(says="it") for e in found}
    lines = "\n".join(extension.to_code(found, [], known, order))
    assert [lines.index(f"notebooks/{name}`") for name in order] == sorted(
        lines.index(f"notebooks/{name}`") for name in order
    )
    stated = extension.statements.statements(tmp_path / "notebooks")
    assert [s.chapter for s in stated if s.kind == "theorem"] == order


def test_the_page_goes_both_ways(extension) -> None:
    known = {
        "eq-a": extension.Entry(
            says="a density", code=("p.f",), tests=("tests/x.py::test_density_and_moments",)
        ),
        "eq-b": extension.Entry(says="a step", exempt="a definition"),
        "thm-c": extension.Entry(code=("p.f", "p.Law.g", "p.Law")),
    }
    numbered = [extension.Equation("eq-a", "01_x", "thm-c"), extension.Equation("eq-b", "01_x", None)]
    proved = [extension.statements.Statement("theorem", "Title", "thm-c", "01_x")]
    lines = list(extension.to_code(numbered, proved, known, ["00_w", "01_x"]))
    start = lines.index("* - {eq}`eq-a` a density")
    assert lines[start + 1 : start + 3] == [
        "  - {py:obj}`p.f <p.f>`",
        "  - tests of {prf:ref}`thm-c`; *density and moments*, `x.py`",
    ]
    assert "  - – a definition" in lines
    assert "* - {prf:ref}`thm-c`: Title" in lines
    lines = list(extension.to_equations(known, ["eq-a", "eq-b", "thm-c"]))
    assert lines[lines.index("* - {py:obj}`p.f <p.f>`") + 1] == "  - {eq}`eq-a`, {prf:ref}`thm-c`"
    assert lines.index("* - {py:obj}`Law <p.Law>`") < lines.index("* - {py:obj}`Law.g <p.Law.g>`")
