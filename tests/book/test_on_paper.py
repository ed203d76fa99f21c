"""The book as one document, and as slides: labels stay apart, links hold, folds open, films become frames."""

import base64
import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from bs4 import BeautifulSoup

from inbounds.book.drawing import videos

ROOT = Path(__file__).resolve().parents[2]
PAGE = """<html><head><link rel="stylesheet" href="../_static/{name}.css"><script>window.MathJax = {{}}</script>
<script>alert(1)</script></head>
<body><nav>menu</nav>
<article class="bd-article"><section id="{name}"><h1>{number}. {title}<a class="headerlink">#</a></h1>
<p><strong>Why {name}?</strong></p>
<section id="what-you-will-know"><h2>{number}.1. What you will know</h2><ul><li>Result of {name}</li></ul></section>
<details><summary>Fold</summary><p>inside <a href="{other}.html#summary">there</a> <a href="{other}.html">all</a>
<a href="#summary">here</a> <a href="missing.html">gone</a> <a href="https://example.org/a#b">out</a></p></details>
<div class="proof theorem admonition" id="thm-{name}">
<p class="admonition-title">Theorem 1 (T)</p><p>It holds.</p></div>
<div class="proof admonition" id="proof"><p>Because.</p></div>
<figure class="inbounds-figure"><img src="../_images/a.png" alt="long">
<figcaption><span class="number">Figure 1.</span> <span aria-hidden="true">A curve.</span>
<details><summary>What it shows</summary><p>It climbs.</p></details></figcaption></figure>
<video aria-label="a film"><source src="../_images/film.mp4"></video>
<video aria-label="a lost film"><source src="../_images/lost.mp4"></video>
<button>press</button><script>alert(2)</script>
<section id="exercises"><h2>Exercises</h2><div class="exercise admonition">
<p class="admonition-title">Exercise 1 (five, 5 min)</p></div>
<div class="solution"><p class="admonition-title">Solution to Exercise 1</p><section id="solution-content">
<figure><picture><source srcset="../_images/narrow.png">
<img src="../_images/a.png" alt="" width="2" height="3"></picture>
<figcaption>Bars.</figcaption></figure></section></div></section>
<section id="summary"><h2>Summary</h2><ul><li>End of {name}</li></ul></section>
</section></article></body></html>"""
NAMES = ["notebooks/one", "notebooks/two"]


@pytest.fixture(scope="module")
def tools() -> Iterator[tuple]:
    sys.path.insert(0, str(ROOT / "tools"))
    try:
        yield importlib.import_module("one_document"), importlib.import_module("slides")
    finally:
        sys.path.remove(str(ROOT / "tools"))


@pytest.fixture(scope="module")
def book(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("book")
    (folder / "notebooks").mkdir()
    (folder / "_images").mkdir()
    (folder / "_images" / "a.png").write_bytes(b"picture")
    shades = [np.full((32, 32, 3), value, np.uint8) for value in (0, 80, 160, 240)]
    film = videos._mediapy().compress_video(shades, fps=10)
    (folder / "_images" / "film.mp4").write_bytes(film)
    for number, (name, other) in enumerate((("one", "two"), ("two", "one")), 1):
        text = PAGE.format(name=name, other=other, number=number, title=name.title())
        (folder / "notebooks" / f"{name}.html").write_text(text, encoding="utf8")
    return folder


@pytest.fixture(scope="module")
def document(tools: tuple, book: Path) -> BeautifulSoup:
    return BeautifulSoup(tools[0].join(book, NAMES, {"notebooks/two": 7}), "html.parser")


def test_every_link_leads_to_the_one_place_that_it_means(document: BeautifulSoup) -> None:
    labels = [each["id"] for each in document.find_all(id=True)]
    assert len(labels) == len(set(labels))
    links = {link.get_text(): link["href"] for link in document.select("#page-one details a")}
    assert links == {
        "there": "#page-two--summary",
        "all": "#page-two",
        "here": "#page-one--summary",
        "out": "https://example.org/a#b",
    }
    assert all(link["href"][1:] in labels for link in document.select('a[href^="#"]'))
    assert "gone" in document.select_one("#page-one details").get_text()


def test_what_only_a_screen_can_use_is_left_out(document: BeautifulSoup) -> None:
    assert not document.select("article script, button, video, nav:not(.contents), .headerlink")
    assert all(each.has_attr("open") for each in document.find_all("details"))
    assert [str(each.string) for each in document.select("head script")] == ["window.MathJax = {}"]
    assert [each["href"] for each in document.select("head link")] == [
        "../_static/one.css",
        "../_static/two.css",
    ]


def test_a_film_is_three_of_its_frames(document: BeautifulSoup) -> None:
    frames = document.select("#page-one .frames img")
    assert [each["alt"] for each in frames] == [f"a film, frame {i} of 3" for i in (1, 2, 3)]
    shades = [
        videos._mediapy().decompress_image(base64.b64decode(each["src"].partition(",")[2])) for each in frames
    ]
    assert np.all(np.diff([shade.mean() for shade in shades]) > 60)
    assert document.select_one("#page-one .no-film").get_text() == "a lost film"


def test_the_contents_have_titles_and_page_numbers(document: BeautifulSoup) -> None:
    lines = [line.get_text("|") for line in document.select("nav.contents li")]
    assert lines == ["1. One", "2. Two|7"]


def test_the_whole_book_is_in_order(tools: tuple) -> None:
    names = tools[0].in_order(ROOT / "_toc.yml")
    assert names[0] == "notebooks/front_page"
    assert names.index("notebooks/ppo") < names.index("notebooks/trpo") < names.index("book/glossary")
    assert len(names) == len(set(names))


@pytest.mark.parametrize(
    ("address", "page"),
    [("two.html", "notebooks/two"), ("../book/glossary.html", "book/glossary"), ("../index.html", "index")],
)
def test_an_address_is_read_from_its_page(tools: tuple, address: str, page: str) -> None:
    assert tools[0].resolved("notebooks/one", address) == page


def test_a_page_without_an_article_says_what_to_do(tools: tuple) -> None:
    with pytest.raises(RuntimeError, match="make book FORCE=1"):
        tools[0].article(BeautifulSoup("<p>no</p>", "html.parser"))


def test_a_deck_has_statements_figures_and_exercises(tools: tuple, book: Path, tmp_path: Path) -> None:
    assert tools[1].deck(book, "one", tmp_path) == 7
    deck = BeautifulSoup((tmp_path / "one.html").read_text("utf8"), "html.parser")
    headings = [each.get_text() for each in deck.select(".slide > h2")]
    ends = ["Exercises", "Solution to Exercise 1", "Summary"]
    assert headings == ["1. One", "What you will know", "Theorem 1 (T)", "1. One", *ends]
    assert "Why one?" in deck.select_one(".question").get_text()
    assert "Because." not in deck.get_text()
    assert [each.get_text() for each in deck.select("footer")][3] == "1. One · 4 / 7"


def test_a_deck_has_the_figures_of_the_chapter_and_of_the_study(
    tools: tuple, book: Path, tmp_path: Path
) -> None:
    tools[1].deck(book, "one", tmp_path)
    deck = BeautifulSoup((tmp_path / "one.html").read_text("utf8"), "html.parser")
    curve, forest = deck.select(".said > img")
    assert curve.find_next_sibling("p").get_text() == "A curve."
    assert forest.find_next_sibling("p").get_text() == "Bars."
    assert ("tall" in curve.get("class", []), "tall" in forest["class"]) == (False, True)
    assert curve["src"] != forest["src"]
    assert {(tmp_path / each["src"]).read_bytes() for each in (curve, forest)} == {b"picture"}


@pytest.mark.parametrize("which", [0, 1])
def test_without_a_built_book_the_tools_say_what_to_do(
    tools: tuple, which: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tool = [importlib.import_module("print_book"), tools[1]][which]
    assert tool.main(["--html", str(tmp_path), "--out", str(tmp_path / "out")]) == 1
    assert "make book" in capsys.readouterr().err
