"""Code folds to a line that says something, what is built stays open, figures are numbered, icons have their glyphs."""

from types import ModuleType, SimpleNamespace

import matplotlib.pyplot as plt
import pytest
from docutils import nodes
from docutils.utils import new_document

from inbounds.book.report import html as study_html
from tests.book.test_extension import load

HTML = SimpleNamespace(builder=SimpleNamespace(format="html"))


@pytest.fixture(scope="module")
def layers() -> ModuleType:
    return load("layers")


@pytest.mark.parametrize(
    ("code", "label"),
    [
        ("import numpy as np\n\nx = 1\ny = 2", "x = 1"),
        ("import numpy as np", "import numpy as np"),
        (")\nx = 1", "x = 1"),
        ("x" * 80, "x" * 59 + "…"),
        ("", ""),
    ],
)
def test_label_is_the_first_line_that_says_something(layers: ModuleType, code: str, label: str) -> None:
    assert layers.first_line(code) == label


def page(heading: str, *classes: str) -> nodes.document:
    """A page with one section and one cell in it."""
    document = new_document("page")
    source = nodes.container("", nodes.literal_block("", "a < b"), nb_element="cell_code_source")
    cell = nodes.container("", source, classes=["cell", *classes], nb_element="cell_code")
    document += nodes.section("", nodes.title("", heading), cell)
    return document


@pytest.mark.parametrize(
    ("heading", "classes", "stays"),
    [
        ("Build it", [], True),
        ("Build it: one step", [], True),
        ("Exercises", [], True),
        ("Run it", [], False),
        ("Run it", ["tag_program"], True),
        ("Rebuild it", [], False),
    ],
)
def test_what_is_built_stays_open(layers: ModuleType, heading: str, classes: list[str], stays: bool) -> None:
    document = page(heading, *classes)
    layers.fold_code(HTML, document, "page")
    before, source, after = document[0][1].children
    assert ("stays-open" in before.astext()) is stays
    assert " open><summary>" in before.astext()  # who has no JavaScript sees everything
    assert "Code, 1 line<" in before.astext()
    assert "a &lt; b" in before.astext()
    assert source["nb_element"] == "cell_code_source"
    assert after.astext() == "</details>"


def test_figures_are_numbered_and_captioned_in_order(layers: ModuleType) -> None:
    document = new_document("page")
    long = "A <curve> that falls from one to zero over ten million steps of training. " + "It ends low. " * 12
    for alt in ("Two bars, one taller than the other.", long.strip()):
        document += nodes.container("", nodes.image(uri="a.png", alt=alt, classes=["inbounds-figure"]))
    document += nodes.container("", nodes.image(uri="logo.png", alt="The book's logo."))
    layers.number_figures(HTML, document, "page")
    captions = [node.astext() for node in document.findall(nodes.raw) if "figcaption" in node.astext()]
    assert len(captions) == 2
    assert "Figure 1." in captions[0]
    assert "details" not in captions[0]
    assert "Figure 2." in captions[1]
    assert "training.</span><details>" in captions[1]
    assert captions[1].count("It ends low.") == 12
    assert "&lt;curve&gt;" in captions[1]


def test_figures_that_come_as_html_are_counted_with_the_others(layers: ModuleType) -> None:
    document = new_document("page")
    alt = 'Bars of "both" laws & their intervals.'
    figure = study_html.figure_of(lambda narrow: plt.figure(), alt, "All from one study.")
    document += nodes.raw("", figure + figure, format="html")
    document += nodes.container(
        "", nodes.image(uri="a.png", alt="Two bars, of one height.", classes=["inbounds-figure"])
    )
    layers.number_figures(HTML, document, "page")
    text = document.astext()
    assert [text.count(f'<span class="number">Figure {i}.</span>') for i in (1, 2, 3, 4)] == [1, 1, 1, 0]
    assert text.count("<p>Bars of &#34;both&#34; laws &amp; their intervals.</p></details></figcaption>") == 2
    assert text.count("All from one study.") == 2


@pytest.mark.parametrize(
    ("alt", "printed"),
    [
        ("Sigma against mu, with 95 percent bands.", "σ against μ, with 95\N{NO-BREAK SPACE}% bands."),
        ("For sigma one and lambda 0.5, at sigma root two.", "For σ = 1 and λ = 0.5, at σ = √2."),
        (
            "A Beta of alpha and beta; a percent of sigma up to one.",
            "A Beta of α and β; a percent of σ up to one.",
        ),
        ("Steps of delta log sigma and of delta mu.", "Steps of Δ log σ and of Δμ."),
        ("In the plane of delta mu; delta times log gamma.", "In the plane of Δμ; δ times log Γ."),
    ],
)
def test_a_caption_has_the_letters_of_the_text(layers: ModuleType, alt: str, printed: str) -> None:
    assert layers.as_printed(alt) == printed
    assert printed in layers.caption(1, alt)


def test_printed_sentences_wrap_and_columns_do_not(layers: ModuleType) -> None:
    document = new_document("page")
    said = "predicted 290 points an episode\nmeasured: 288", "x   y\n1   2", "a\tb"
    for text in said:
        document += nodes.container("", nodes.literal_block("", text), nb_element="cell_code_output")
    document += nodes.literal_block("", "not printed")
    layers.let_sentences_wrap(HTML, document, "page")
    marked = ["sentences" in block["classes"] for block in document.findall(nodes.literal_block)]
    assert marked == [True, False, False, False]


def test_icons_of_pages_styles_and_scripts_are_found(tmp_path) -> None:
    icons = load("icons")
    styles = tmp_path / icons.STYLES
    styles.parent.mkdir(parents=True)
    styles.write_text(
        '.fa-search:before,.fa-glass:before{content:"\\f002"}.fa-moon:before{content:"\\f186"}.note:after{content:"\\f05a"}'
    )
    (tmp_path / "page.html").write_text('<i class="fas fa-glass"></i>')
    assert icons.in_use(tmp_path) == {0xF002, 0xF05A}
