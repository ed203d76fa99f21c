"""The book's Sphinx extension sets glued numbers as the prose sets typed ones."""

import importlib.util
import json
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
from docutils import nodes
from docutils.utils import new_document
from PIL import Image
from sphinx.builders.html._assets import _JavaScript

EXTENSIONS = Path(__file__).parents[2] / "book" / "_ext"


def load(name: str) -> ModuleType:
    """An extension of the book: its folder is no package."""
    spec = importlib.util.spec_from_file_location(name, EXTENSIONS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(EXTENSIONS))  # an extension may ask its neighbours
        spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def extension() -> ModuleType:
    return load("inbounds_book")


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


def test_an_interval_stays_on_its_line_and_a_list_of_code_is_left_alone(extension: ModuleType) -> None:
    document = new_document("page")
    said = "12 % more [−1571, 1\u202f058], of [3, 4, 5]"
    document += nodes.paragraph("", said)
    glued = nodes.inline("", "40", classes=["pasted-text"])
    document += nodes.paragraph("", "", nodes.Text("by "), glued, nodes.Text(" % or so"))
    document += nodes.literal_block("", "[1, 2] at 12 %")
    document += nodes.paragraph("", "", nodes.literal("", "[1, 2]"), nodes.math("", "[1, 2]"))
    ends = [nodes.inline("", end, classes=["pasted-text"]) for end in ("1", "2", "3")]
    parts = ["of [", ends[0], ", ", ends[1], "], and ", ends[2], ", too"]
    last = nodes.paragraph("", "", *(nodes.Text(part) if isinstance(part, str) else part for part in parts))
    document += last
    extension.keep_intervals(None, document, "page")
    assert last.astext() == "of [1,\u00a02], and 3, too"
    document.remove(last)
    first, second, *others = document
    assert second.astext() == "by 40\u00a0% or so"
    assert first.astext() == "12\u00a0% more [−1571,\u00a01\u202f058], of [3, 4, 5]"
    assert [other.astext() for other in others] == ["[1, 2] at 12 %", "[1, 2][1, 2]"]


def test_short_code_and_a_formula_with_its_word_stay_on_their_line(extension: ModuleType) -> None:
    document = new_document("page")
    short, long = nodes.literal("", "latent_to_value"), nodes.literal("", "torch.distributions.Distribution")
    formula, lone = nodes.math("", "p"), nodes.math("", "p")
    text = nodes.paragraph("", "", short, nodes.Text(" "), long, formula, nodes.Text("-values of "), lone)
    document += text
    extension.keep_words(None, document, "page")
    assert (short["classes"], long["classes"]) == (["together"], [])
    assert text.astext() == "latent_to_value torch.distributions.Distributionp-values of p"
    (tied,) = text.findall(nodes.inline)
    assert (tied["classes"], tied.astext()) == (["together"], "p-values")
    assert [type(part).__name__ for part in tied] == ["math", "Text"]
    assert text[-1] is lone


@pytest.fixture(scope="module")
def metadata() -> ModuleType:
    return load("metadata")


def test_descriptions_are_cut_behind_a_word(metadata: ModuleType) -> None:
    assert metadata.shorten("two\n words") == "two words"
    assert metadata.shorten("logit-normal " * 60).endswith("logit-normal…")
    cut = metadata.shorten("word, " * 60)
    assert len(cut) <= metadata.LONGEST
    assert cut.endswith("word…")


def test_a_page_is_described_by_words_without_formulas(metadata: ModuleType) -> None:
    document = new_document("page")
    section = nodes.section()
    section += nodes.paragraph("", "Where ", nodes.math("", r"\gamma"), nodes.Text(" is small."))
    section += nodes.paragraph("", "What is a bound?")
    document += section
    assert metadata.first_words(document) == "What is a bound?"
    assert metadata.first_words(None) == ""


@pytest.mark.parametrize("site", ["", "https://someone.example/in-bounds/"])
def test_a_picture_needs_the_address_of_the_site(metadata: ModuleType, site: str) -> None:
    config = SimpleNamespace(html_title="In Bounds", html_baseurl=site)
    written = metadata.tags(config, "A <title>", "What?", f"{site}a.html" if site else "")
    assert 'property="og:title" content="A &lt;title&gt;"' in written
    assert ("https://someone.example/in-bounds/_static/social.png" in written) is bool(site)
    assert ('property="og:url"' in written) is bool(site)


def test_the_picture_is_as_its_tags_say(metadata: ModuleType) -> None:
    path = Path(__file__).parents[2] / "book" / "_static" / metadata.PICTURE
    assert path.stat().st_size < 60_000
    with Image.open(path) as picture:
        assert picture.size == metadata.PICTURE_SIZE
        assert picture.format == "PNG"


@pytest.mark.parametrize(
    ("page", "label"),
    [("notebooks/core_one", "Core chapter"), ("notebooks/deep_one", "Going deeper"), ("book/api", "")],
)
def test_a_page_says_its_kind_and_its_minutes(tmp_path: Path, page: str, label: str) -> None:
    (tmp_path / "_toc.yml").write_text(
        "root: a\nparts:\n  - {numbered: 2, chapters: [{file: notebooks/core_one}]}\n"
        "  - {caption: Going deeper, chapters: [{file: notebooks/deep_one}]}\n"
    )
    (tmp_path / "notebooks").mkdir()
    for name in ("core_one", "deep_one"):
        cells = [{"cell_type": "markdown", "source": ["word " * 300], "metadata": {}}]
        (tmp_path / "notebooks" / f"{name}.ipynb").write_text(json.dumps({"cells": cells}))
    context = {"body": "<h1>A <i>title</i></h1><p>Text.</p><h1>Another</h1>"}
    load("kinds").say_kind(SimpleNamespace(srcdir=tmp_path), page, "page.html", context, None)
    assert context["body"].count("page-kind-") == bool(label)
    if label:
        assert "</h1>\n<p class" in context["body"]
        assert label in context["body"]
        assert "about 2 minutes of reading" in context["body"]


def test_programs_are_written_beside_the_pages(tmp_path: Path) -> None:
    """Each page with a program has its file, the others have none."""
    notebooks = tmp_path / "src" / "notebooks"
    notebooks.mkdir(parents=True)
    for name, tags in (("with_one", ["program"]), ("without", [])):
        cells = [
            {"cell_type": "markdown", "source": ["# A title\n", "\n", "Text."], "metadata": {}},
            {"cell_type": "code", "source": ["x = 1"], "metadata": {"tags": tags}},
        ]
        (notebooks / f"{name}.ipynb").write_text(json.dumps({"cells": cells}))
    app = SimpleNamespace(
        srcdir=tmp_path / "src",
        outdir=tmp_path / "html",
        builder=SimpleNamespace(format="html"),
        env=SimpleNamespace(found_docs={"notebooks/with_one", "notebooks/without", "book/api"}),
    )
    load("program").write_programs(app, None)
    (written,) = (tmp_path / "html" / "_static" / "programs").iterdir()
    assert written.name == "with_one.py"
    assert written.read_text().startswith('"""A title: the program')
    assert "\nx = 1\n" in written.read_text()


def test_a_full_stop_stays_with_its_doi(extension: ModuleType) -> None:
    context = {
        "body": '<a href="https://doi.org/10.1/123456">doi:10.1/123456</a>. <a href="#">elsewhere</a>.'
    }
    extension.keep_full_stops(None, "book/bibliography", "", context, None)
    assert context["body"] == (
        '<a href="https://doi.org/10.1/123456">doi:10.1/12<span style="white-space:nowrap">3456.</span></a>'
        ' <a href="#">elsewhere</a>.'
    )
    context["body"] = '<a href="https://a.org/1234567">https://a.org/1234567</a>.'
    extension.keep_full_stops(None, "book/bibliography", "", context, None)
    assert context["body"].endswith('a.org/123<span style="white-space:nowrap">4567.</span></a>')


def test_scripts_wait_for_the_page(extension: ModuleType) -> None:
    """All but the one whose values inline scripts change; and each page has tags of its own."""
    options, late, inline = (
        _JavaScript(name, priority=500, **given)
        for name, given in (("documentation_options.js", {}), ("book.js", {"x": "y"}), ("", {"body": "1"}))
    )
    context = {"script_files": [options, late, inline]}
    extension.let_pages_go_first(None, "page", "", context, None)
    assert [script.attributes for script in context["script_files"]] == [
        {},
        {"x": "y", "defer": "defer"},
        {"body": "1"},
    ]
    assert late.attributes == {"x": "y"}
    search = {"script_files": [options, late, inline]}
    extension.let_pages_go_first(None, "search", "", search, None)
    assert search["script_files"] == [options, late, inline]


def test_scripts_have_their_order_and_new_addresses_when_they_change(
    extension: ModuleType, tmp_path: Path
) -> None:
    files = [tmp_path / name for name in ("first.js", "second.js")]
    for file in files:
        file.write_text("1")
    before = extension.addresses(files, "../_static/x/")
    assert [address.partition("?v=")[0] for address in before] == [
        "../_static/x/first.js",
        "../_static/x/second.js",
    ]
    files[0].write_text("2")
    after = extension.addresses(files, "../_static/x/")
    assert after[0] != before[0]
    assert after[1] == before[1]


def notebook(path: Path, text: str, **about: str) -> Path:
    cells = [{"cell_type": "markdown", "source": text, "metadata": {}}]
    said = {"cells": cells, "metadata": {"program": about}, "nbformat": 4, "nbformat_minor": 5}
    path.write_text(json.dumps(said), encoding="utf8")
    return path


def test_a_page_is_read_again_when_what_it_shows_of_another_has_changed(
    extension: ModuleType, tmp_path: Path
) -> None:
    notebook(tmp_path / "first.ipynb", "# First")
    notebook(tmp_path / "second.ipynb", "# Second", continues="first")
    notebook(tmp_path / "third.ipynb", "# Third", continues="second")
    notebook(tmp_path / "quoting.ipynb", "{glue:text}`other.ipynb::x:.1f` and {glue:text}`own`")
    (tmp_path / "other.ipynb").write_text((tmp_path / "first.ipynb").read_text())
    env = SimpleNamespace(
        found_docs={path.stem for path in tmp_path.glob("*.ipynb")},
        doc2path=lambda name: tmp_path / f"{name}.ipynb",
    )
    for changed, again in (
        ("first", ["second", "third"]),
        ("second", ["third"]),
        ("other", ["quoting"]),
        ("third", []),
    ):
        assert extension.read_again(None, env, set(), {changed}, set()) == again


def test_the_books_own_pages_quote_and_continue(extension: ModuleType) -> None:
    """Were the pattern wrong, no page of the book would have sources."""
    found = {
        path.stem: {source.stem for source in extension.sources(path)}
        for path in (EXTENSIONS.parents[1] / "notebooks").glob("*.ipynb")
    }
    others = {"storing_actions", "greedy_action", "what_happened", "objective_bonus_horizon"}
    assert found["which_policy"] == others
    assert found["trpo"] >= {"policy_that_learns"}
    assert not found["greedy_action"]
