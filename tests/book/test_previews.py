"""Previews are what the linked pages say."""

from pathlib import Path

from inbounds.book import previews

TERM = (
    '<dl><dt id="term-box">box<a class="headerlink" href="#">#</a></dt><dd><p>A <em>set</em>.</p>\n</dd></dl>'
)
PROOF = '<div class="proof theorem admonition" id="thm-a"><p>Theorem 1</p><div><p id="x">All.</p></div></div>'
OTHER = '<div class="highlight" id="thm-code">code</div><section id="heading">A heading</section>'
CITED = (
    '<div class="citation" id="id7" role="listitem"><p>A. Author. <a href="https://doi.org">doi</a></p></div>'
)


def link(target: str) -> str:
    return f'<a class="reference internal" href="{target}">see</a>'


def test_only_terms_statements_equations_and_sources_have_one() -> None:
    page = TERM + PROOF + OTHER + CITED
    found = previews.previews(page, {"term-box", "thm-a", "thm-code", "heading", "id7", "nowhere"})
    assert found == {
        "term-box": "<p><strong>box</strong></p><p>A <em>set</em>.</p>",
        "thm-a": '<div class="proof theorem admonition"><p>Theorem 1</p><div><p>All.</p></div></div>',
        "id7": '<div class="citation"><p>A. Author. <span>doi</span></p></div>',
    }
    assert previews.previews(page, set()) == {}


def test_a_book_has_one_script_a_page_with_targets(tmp_path: Path) -> None:
    for name, body in (
        ("notebooks/a.html", PROOF + link("#thm-a") + link("../book/b.html#term-box") + link("#thm-code")),
        ("book/b.html", TERM + PROOF),
    ):
        path = tmp_path / name
        path.parent.mkdir()
        path.write_text(f"<html><head>\n<title>T</title>\n</head><body>{body}</body></html>", encoding="utf8")
    assert previews.write(tmp_path) == 2
    home = tmp_path / "_static" / "previews"
    assert sorted(path.name for path in home.iterdir()) == [
        "book.b.html.js",
        "hover.css",
        "hover.js",
        "notebooks.a.html.js",
    ]
    script = (home / "book.b.html.js").read_text(encoding="utf8")
    assert script.startswith('inbounds.previews.come("book/b.html", {"term-box":')
    assert "</" not in script  # nothing ends the script early
    before = (tmp_path / "notebooks" / "a.html").read_text(encoding="utf8")
    assert before.count('src="../_static/previews/hover.js"') == 1
    previews.write(tmp_path)
    assert (tmp_path / "notebooks" / "a.html").read_text(encoding="utf8") == before
