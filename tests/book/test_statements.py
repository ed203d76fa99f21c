"""Every theorem of the book is beside its tests, and the tests are there."""

import ast
import importlib.util
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def extension():
    """The book's extension, which is no part of the package."""
    spec = importlib.util.spec_from_file_location("statements", ROOT / "book" / "_ext" / "statements.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["statements"] = module  # dataclasses look there
    spec.loader.exec_module(module)
    yield module
    del sys.modules["statements"]


def test_each_statement_is_listed_once_and_nothing_else(extension) -> None:
    labels = [statement.label for statement in extension.statements(ROOT / "notebooks")]
    assert len(labels) == len(set(labels)) > 0
    listed = extension.tests_of(ROOT / "book")
    assert set(labels) - set(listed) == set(), "name their tests in book/statements.toml"
    assert set(listed) - set(labels) == set(), "no chapter states these"


def test_each_test_is_there(extension) -> None:
    for label, tests in extension.tests_of(ROOT / "book").items():
        for test in tests:
            file, _, name = test.partition("::")
            functions = [
                n.name for n in ast.parse((ROOT / file).read_text()).body if isinstance(n, ast.FunctionDef)
            ]
            assert name in functions, f"{label}: {test}"


def test_the_page_shows_each_statement_with_its_tests(extension) -> None:
    statement = extension.Statement("theorem", "Density", "thm-x", "04_chapter")
    lines = list(extension.page([statement], {"thm-x": ["tests/a.py::test_b"]}))
    assert "::::{dropdown} Theorem: Density" in lines
    assert ":::{literalinclude} ../tests/a.py" in lines
    assert ":pyobject: test_b" in lines
    assert any("own cells" in line for line in extension.page([statement], {"thm-x": []}))
