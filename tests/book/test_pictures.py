"""Films and pictures of a page become files, have room before they come, and come when they are near."""

import base64
import io
import re
from pathlib import Path
from types import ModuleType, SimpleNamespace
from xml.etree import ElementTree

import matplotlib.pyplot as plt
import numpy as np
import pytest
from bs4 import BeautifulSoup
from PIL import Image

from inbounds.book.drawing import videos
from inbounds.book.drawing.alt_text import svg_uri
from inbounds.robots import Film
from tests.book.test_extension import load


@pytest.fixture(scope="module")
def pictures() -> ModuleType:
    return load("pictures")


@pytest.fixture
def html(tmp_path: Path) -> Path:
    (tmp_path / "_images").mkdir()
    Image.new("RGB", (30, 20)).save(tmp_path / "_images" / "figure.png")
    return tmp_path


def page(pictures: ModuleType, html: Path, body: str) -> BeautifulSoup:
    """What the handler makes of a page in the folder *notebooks*."""
    app = SimpleNamespace(
        builder=SimpleNamespace(format="html", images={"cache/later.png": "figure2.png"}),
        outdir=html,
        srcdir=html,
    )
    context = {"body": body, "pathto": lambda name, _: f"../{name}"}
    pictures.bring_when_near(app, "notebooks/ppo", "page.html", context, None)
    return BeautifulSoup(context["body"], "html.parser")


def png(width: int, height: int) -> bytes:
    buffer = io.BytesIO()
    Image.new("RGB", (width, height), (width, height, 0)).save(buffer, format="png")
    return buffer.getvalue()


def carried(content: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(content).decode()}"


def test_films_become_files_that_wait_to_be_played(pictures: ModuleType, html: Path) -> None:
    row = videos.show_films({"One": Film(np.zeros((10, 32, 48, 3), np.uint8), 25.0, 0.0)})
    found = page(pictures, html, row._repr_html_())
    (film,) = row
    for address, content in ((found.source["src"], film.mp4), (found.video["poster"], film.poster)):
        assert (html / "notebooks" / address).resolve().read_bytes() == content
    assert found.video["preload"] == "none"
    assert "base64" not in str(found)


def test_pictures_become_files_and_a_page_that_shows_one_twice_has_one(
    pictures: ModuleType, html: Path
) -> None:
    wide, narrow = png(40, 10), png(20, 30)
    body = f'<picture><source srcset="{carried(narrow)}" width="10"><img src="{carried(wide)}" alt="A curve"></picture>'
    found = page(pictures, html, body * 2)
    assert (html / "notebooks" / found.img["src"]).resolve().read_bytes() == wide
    assert (html / "notebooks" / found.source["srcset"]).resolve().read_bytes() == narrow
    assert len(list((html / "_images").iterdir())) == 3
    assert (found.img["width"], found.img["height"], found.img["loading"]) == ("40", "10", "lazy")
    assert (found.source["width"], found.source["height"]) == ("10", "15")
    assert "loading" not in found.source.attrs


def test_a_figure_has_another_shape_for_a_phone_and_a_link_to_the_wide_one(
    pictures: ModuleType, html: Path
) -> None:
    fig = plt.figure(figsize=(4, 2))
    link = '<a href="../_images/figure.png"><img src="../_images/figure.png" alt="A curve"></a>'
    plain = f'<figure class="inbounds-figure">{link}<figcaption>1</figcaption></figure>'
    both = plain.replace("<a ", f'<source srcset="{svg_uri(fig)}"><a ')
    plt.close(fig)
    found = page(pictures, html, both + plain)
    first, second = found.find_all("figure")
    assert first.a.picture.img["src"] == second.a.img["src"] == "../_images/figure.png"
    assert first.source["media"] == "(max-width: 30rem)"
    assert (html / "notebooks" / first.source["srcset"]).resolve().is_file()
    assert (first.source["width"], first.source["height"]) == ("384", "192")
    assert second.picture is None
    style = (Path(pictures.__file__).parents[1] / "_static" / "book.css").read_text(encoding="utf8")
    assert f"@media {pictures.PHONE}" in style


def test_a_drawing_in_its_address_becomes_a_file(pictures: ModuleType, html: Path) -> None:
    fig, ax = plt.subplots(figsize=(4, 3))
    ax.set_title("50 % of “a & b” < 1 #")
    found = page(pictures, html, f'<img src="{svg_uri(fig)}" alt="A line">')
    plt.close(fig)
    drawing = ElementTree.parse((html / "notebooks" / found.img["src"]).resolve())
    assert drawing.find(".//{http://www.w3.org/2000/svg}path") is not None
    assert (found.img["width"], found.img["height"]) == ("384", "288")  # pixels, 96 an inch


@pytest.mark.parametrize(
    ("written", "size"),
    [
        ('<img src="../_images/figure.png" alt="A curve" style="width: 15px;" />', ("30", "20")),
        ('<img src="../_images/figure.png" alt="A curve" width="15">', ("15", "10")),
        (
            '<img src="../_images/figure.png" alt="A curve" width="15px" />',
            ("15px", "10"),
        ),  # Sphinx, of an SVG
        ('<img src="../_images/figure.png" alt="A curve" width="15" height="12">', ("15", "12")),
        ('<img src="../_images/missing.png" alt="A curve">', (None, None)),
        ('<img src="https://example.org/a.png" alt="A curve">', (None, None)),
    ],
)
def test_a_figure_says_its_size(
    pictures: ModuleType, html: Path, written: str, size: tuple[str | None, str | None]
) -> None:
    found = page(pictures, html, written)
    assert (found.img.get("width"), found.img.get("height")) == size
    assert found.img["loading"] == "lazy"
    assert found.img["alt"] == "A curve"
    assert found.img["src"] == re.search('src="([^"]*)"', written)[1]


def test_a_figure_that_sphinx_has_still_to_copy_says_its_size(pictures: ModuleType, html: Path) -> None:
    (html / "cache").mkdir()
    Image.new("RGB", (8, 6)).save(html / "cache" / "later.png")
    found = page(pictures, html, '<img src="../_images/figure2.png" alt="x" style="width: 4px;">')
    assert (found.img["width"], found.img["height"]) == ("8", "6")


def test_what_says_how_it_comes_keeps_its_word(pictures: ModuleType, html: Path) -> None:
    found = page(pictures, html, '<p>5 > 3</p><img loading="eager" src="../_images/figure.png" alt="x">')
    assert found.img["loading"] == "eager"
    assert found.p.get_text() == "5 > 3"


def test_a_drawing_without_a_size_is_refused(pictures: ModuleType, html: Path) -> None:
    (html / "_images" / "bare.svg").write_text("<svg/>")
    with pytest.raises(ValueError, match=r"bare\.svg.*width and height"):
        page(pictures, html, '<img src="../_images/bare.svg" alt="x">')
