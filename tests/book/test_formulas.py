"""Formulas are set when the book is built."""

import re
from pathlib import Path

import pytest

from inbounds.book import formulas
from inbounds.book.npm import NpmError

INLINE = r'<span class="math notranslate nohighlight">\(a &lt; \E[b + a] + \E[b]\)</span>'
NUMBER = '<span class="eqno">(1)<a class="headerlink" href="#eq">#</a></span>'
DISPLAY = rf'<div class="math notranslate nohighlight" id="eq">{chr(10)}{NUMBER}\[\frac{{a}}{{b}} = \{{ c \}}\]</div>'
PAGE = f"""<html><head>
<script>window.MathJax = {{"tex": {{"macros": {{"E": "\\\\mathbb{{E}}"}}}}}}</script>
<script defer="defer" src="../_static/mathjax/tex-chtml.js"></script>
</head><body>{INLINE}{DISPLAY}</body></html>"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A built book of one page, with MathJax beside it."""
    (tmp_path / "_static" / formulas.FONTS).mkdir(parents=True)
    (tmp_path / "_static" / formulas.FONTS / "a.woff").touch()
    (tmp_path / "_static" / "mathjax" / "tex-chtml.js").touch()
    (tmp_path / "notebooks").mkdir()
    (tmp_path / "notebooks" / "page.html").write_text(PAGE, encoding="utf8")
    return tmp_path


def test_tex_is_found_in_lines_and_alone() -> None:
    assert formulas.formulas(PAGE) == [(r"a < \E[b + a] + \E[b]", False), (r"\frac{a}{b} = \{ c \}", True)]


def test_a_page_has_its_formulas_and_no_script(folder: Path) -> None:
    if why := formulas.write(folder):
        pytest.skip(f"formulas are not set here: {why}")
    page = (folder / "notebooks" / "page.html").read_text(encoding="utf8")
    assert page.count("<mjx-container") == 2
    assert "<mi>a</mi><mo>&lt;</mo>" in page  # for screen readers
    assert 'data-tex="a &lt; \\E[b + a] + \\E[b]"' in page  # for who copies it
    assert NUMBER in page
    assert len(re.findall("<wbr>", page.partition(NUMBER)[0])) == 2  # after < and the second +
    assert len(re.findall('<wbr class="on-a-phone">', page)) == 1
    assert "<script" not in page
    assert page.index("../_static/formulas.css?v=") < page.index("</head>")
    assert [path.name for path in (folder / "_static").rglob("*.*")] == ["formulas.css", "a.woff"]
    assert "Apache License" in (folder / "_static" / "mathjax" / "LICENSE").read_text(encoding="utf8")
    styles = (folder / "_static" / "formulas.css").read_text(encoding="utf8")
    for glyph in ("1D44E.TEX-I", "7B", "5B", "1D53C.TEX-A"):  # a { [ E: a brace is one in the sheet, too
        assert f".mjx-c{glyph}::before {{" in styles
    assert ".mjx-c1D467" not in styles  # no z
    before = page
    assert formulas.write(folder) == ""  # set once
    assert (folder / "notebooks" / "page.html").read_text(encoding="utf8") == before


@pytest.mark.parametrize(
    ("tex", "breaks"),
    [
        ("(1 - a)^m", [True]),
        (r"x = a\big(b - c\big) + d + e + f", [False, True, False, False, False]),  # large brackets, too
    ],
    ids=["a short formula", "within brackets"],
)
def test_some_breaks_are_for_a_phone_alone(tex: str, breaks: list[bool]) -> None:
    try:
        made, _ = formulas.set_all([(tex, False)], {})
    except NpmError as error:
        pytest.skip(f"formulas are not set here: {error}")
    found = re.findall("<wbr[^>]*>", made[tex, False]["html"])
    assert ["on-a-phone" in each for each in found] == breaks


def test_a_formula_that_is_wrong_stops_the_build(folder: Path) -> None:
    path = folder / "notebooks" / "page.html"
    path.write_text(PAGE.replace(r"\E[b]", r"\unheard{b}"), encoding="utf8")
    try:
        formulas.set_all([("a", False)], {})
    except NpmError as error:
        pytest.skip(f"formulas are not set here: {error}")
    with pytest.raises(ValueError, match=r"notebooks/page.html: Undefined control sequence \\unheard"):
        formulas.write(folder)


def test_without_npm_the_pages_stay_as_they_are(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def unreachable(*_: object) -> Path:
        raise NpmError("npm could not bring the packages: no network")

    monkeypatch.setattr(formulas, "made_once", unreachable)
    assert formulas.write(folder) == "npm could not bring the packages: no network"
    assert (folder / "notebooks" / "page.html").read_text(encoding="utf8") == PAGE
    assert (folder / "_static" / "mathjax" / "tex-chtml.js").exists()


def test_fonts_are_kept_after_a_build_that_was_interrupted(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "LICENSE").touch()
    monkeypatch.setattr(formulas, "_mathjax", lambda: tmp_path)
    left = folder / "_static" / "fonts-of-formulas"
    left.mkdir()
    (left / "b.woff").touch()
    formulas._keep_fonts_only(folder / "_static")
    assert [path.name for path in (folder / "_static" / formulas.FONTS).iterdir()] == ["a.woff"]
    assert not left.exists()
