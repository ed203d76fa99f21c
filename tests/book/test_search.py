"""The search lists the right page first, for each phrase of `book/search.toml`, and for queries that are in no list."""

import json
import re
import subprocess
import tomllib
from pathlib import Path
from types import SimpleNamespace

import nbformat
import pytest
import yaml
from docutils import nodes
from docutils.utils import new_document

from inbounds.book.npm import node
from inbounds.book.pages.contents import contents
from tests.book.test_extension import load

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "book" / "_static" / "search.js"
PHRASES: dict[str, list[str]] = tomllib.loads((ROOT / "book/search.toml").read_text(encoding="utf8"))[
    "phrases"
]
ASKED = [(phrase, page) for page, phrases in PHRASES.items() for phrase in phrases]
# In other words than the list's, or in a title.
FREE = [
    ("which policy", "which_policy"),
    ("Which policy should I use?", "which_policy"),
    ("KL invariance", "kl_invariance"),
    ("is the KL invariant", "kl_invariance"),
    ("boundary effect", "boundary_effect"),
    ("logit normal mode", "logit_normal_moments"),
    ("the mode of a logit-normal", "logit_normal_moments"),
    ("confidence intervals", "how_to_compare_ten_seeds"),
    ("installing", "preface"),
    ("how do I install it", "preface"),
    ("conjugate gradients", "trpo"),
    ("squashed Gaussians", "logit_normal_density"),
    ("beta policy", "beta_policies"),
    ("storing actions", "storing_actions"),
    ("greedy action", "greedy_action"),
    ("errata", "errata"),
    ("glossary", "glossary"),
    ("notation", "notation"),
    ("ppo", "ppo"),
    ("compare seeds", "how_to_compare_ten_seeds"),
]


def book() -> list[list]:
    """Every page of the table of contents as the search page knows it, with headings and without passages."""
    toc, kinds = yaml.safe_load((ROOT / "_toc.yml").read_text()), contents(ROOT / "_toc.yml")
    files = [toc["root"]] + [each["file"] for part in toc["parts"] for each in part["chapters"]]
    pages = []
    for name in files:
        path = ROOT / f"{name}.md"
        if path.exists():
            text = re.sub(r"```.*?```", "", path.read_text(encoding="utf8"), flags=re.DOTALL)
        else:
            cells = nbformat.read(path.with_suffix(".ipynb"), as_version=4).cells
            text = "\n\n".join(cell.source for cell in cells if cell.cell_type == "markdown")
        headings = re.findall(r"^#{1,3} (.*)$", text, flags=re.MULTILINE)
        sections = [[heading, heading, ""] for heading in headings]
        pages.append(
            [name, headings[0], kinds.kind(name.rpartition("/")[2]), PHRASES.get(name, []), sections]
        )
    return pages


def ranked(queries: list[str], pages: list[list], found: list[str] = []) -> list[list[str]]:  # noqa: B006
    """The addresses that the page's script lists for each query, best first."""
    code = f"""const {{ rank }} = require({json.dumps(str(SCRIPT))});
    const {{ queries, pages, found }} = JSON.parse(require("node:fs").readFileSync(0, "utf8"));
    const answers = queries.map((query) => rank(query, pages, new Set(found)).map((page) => page.address));
    process.stdout.write(JSON.stringify(answers));"""
    values = json.dumps({"queries": queries, "pages": pages, "found": found})
    done = subprocess.run([str(node()), "-e", code], input=values, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def test_phrases_lead_to_pages_that_exist_and_to_one_each() -> None:
    addresses = {page[0] for page in book()}
    assert PHRASES.keys() <= addresses
    lowered = [phrase.lower() for phrase, _ in ASKED]
    assert len(lowered) == len(set(lowered))


def test_right_page_is_first() -> None:
    asked = ASKED + [(query, page) for query, page in FREE]
    answers = ranked([query for query, _ in asked], book())
    wrong = {
        query: answer[:3]
        for (query, page), answer in zip(asked, answers, strict=True)
        if not answer or answer[0].rpartition("/")[2] != page.rpartition("/")[2]
    }
    assert wrong == {}


def test_what_nobody_wrote_finds_nothing_but_what_sphinx_found() -> None:
    pages = book()
    assert ranked(["zeppelin"], pages) == [[]]
    assert ranked(["zeppelin"], pages, ["notebooks/trpo"]) == [["notebooks/trpo"]]
    assert ranked(["the of"], [["a", "The of", "", [], []]]) == [["a"]]


@pytest.fixture(scope="module")
def extension():
    return load("search_pages")


def test_passages_are_plain_first_paragraphs_of_their_own_section(extension, tmp_path: Path) -> None:
    document = new_document("page")
    plain = nodes.paragraph("", "A first paragraph of plain words, long enough to say something. " * 5)
    inner = nodes.section(
        "",
        nodes.title("", "Inner"),
        nodes.paragraph("", "Words of the inner section, which are its own."),
        ids=["inner"],
    )
    formula = nodes.paragraph(
        "", "A paragraph with a formula, which no excerpt can show: ", nodes.math("", "x")
    )
    document += nodes.section("", nodes.title("", "Outer"), formula, inner, plain, ids=["outer"])
    (outer, within) = extension.sections(document)
    assert outer[:2] == ("outer", "Outer")
    assert outer[2].startswith("A first paragraph")
    assert outer[2].endswith(" …")
    assert len(outer[2]) <= extension.LONGEST + 2
    assert within == ("inner", "Inner", "Words of the inner section, which are its own.")


def test_pages_that_are_gone_are_not_listed(extension, tmp_path: Path) -> None:
    (tmp_path / "book").mkdir()
    (tmp_path / "book/search.toml").write_text('[phrases]\n"notebooks/a" = ["one"]')
    (tmp_path / "_toc.yml").write_text("root: a\nparts: [{numbered: 2, chapters: [{file: notebooks/a}]}]")
    (tmp_path / "_static").mkdir()
    env = SimpleNamespace(titles={"notebooks/a": nodes.title("", "A")}, found_docs={"notebooks/a"})
    app = SimpleNamespace(
        builder=SimpleNamespace(name="html"), doctreedir=tmp_path, srcdir=tmp_path, outdir=tmp_path, env=env
    )
    (tmp_path / extension.PARTS).mkdir()
    for name in ("notebooks/a", "notebooks/gone"):
        part = tmp_path / extension.PARTS / f"{name.replace('/', '-')}.json"
        part.write_text(json.dumps([name, [["s", "S", "Text."]]]))
    extension.write(app, None)
    text = (tmp_path / "_static" / extension.SCRIPT).read_text()
    listed = json.loads(text.removeprefix("window.inboundsPages = ").rstrip().removesuffix(";"))
    assert listed == [["notebooks/a", "A", "core", ["one"], [["s", "S", "Text."]]]]
