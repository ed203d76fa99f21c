"""The book's Sphinx extension sets glued numbers as the prose sets typed ones."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest
from docutils import nodes
from docutils.utils import new_document


@pytest.fixture(scope="module")
def extension() -> ModuleType:
    path = Path(__file__).parents[2] / "book" / "_ext" / "inbounds_book.py"
    spec = importlib.util.spec_from_file_location("inbounds_book", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("written", "set_"),
    [
        ("-1,234.5", "−1\N{NARROW NO-BREAK SPACE}234.5"),
        ("12,800 steps", "12\N{NARROW NO-BREAK SPACE}800 steps"),
        ("[-10, 5]", "[−10, 5]"),
        ("1, 2, 345", "1, 2, 345"),
        ("1e-05", "10⁻⁵"),
        ("-2.5e+12", "−2.5 · 10¹²"),
        ("0x1e-05", "0x1e-05"),
        ("34%", "34\N{NARROW NO-BREAK SPACE}%"),
        ("five-fold", "five-fold"),
        ("standard-hopper-ppo-gaussian", "standard-hopper-ppo-gaussian"),
        ("v5-1", "v5-1"),
    ],
)
def test_numbers_are_set_and_words_are_not(extension: ModuleType, written: str, set_: str) -> None:
    assert extension.as_prose(written) == set_


def test_only_glued_text_is_touched(extension: ModuleType) -> None:
    document = new_document("page")
    glued = nodes.inline("", "-1,000", classes=["pasted-text"])
    typed = nodes.inline("", "-1,000")
    document += nodes.paragraph("", "", glued, typed)
    extension.set_numbers(None, document, "page")
    assert document.astext() == "−1\N{NARROW NO-BREAK SPACE}000-1,000"
