"""Two layers of a page: *read*, in which code is folded to its first line, and *code*, in which it is open.

* Every visible input becomes a ``<details open>``: without JavaScript all of it is open. ``book.js`` folds it in
  *read*, and a button in the header switches the whole book. The browser keeps the choice, also from the disk.
* *Read* is where a visitor starts: who comes for a result or a derivation finds it without scrolling past programs,
  and one press opens them all.
* In *read* what is built stays open: the section *Build it*, the exercises, and the cells of a chapter's program. A
  check shows its output; its code is one press away. Cells that only draw (``hide-input``) have a fold of their own.
* What a program printed as a sentence wraps on a narrow page; columns scroll.
* Figures get a number and a caption, which is their alt text: its first sentence, and the rest in a fold if it is long.
"""

import html
import itertools
import re
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

STAYS_OPEN = ("Build it", "Exercises", "Exercise")
PROGRAM = "tag_program"
LONGEST_LABEL = 60  # characters of the first line
LONGEST_CAPTION = 180  # characters of an alt text that is shown whole
# What `inbounds.book.report.html.figure` writes, in one shape or in two.
STUDY_FIGURE = re.compile(
    r'(?P<picture><figure>\s*(?:<picture>\s*<source [^>]*>\s*)?<img [^>]*? alt="(?P<alt>[^"]*)">\s*(?:</picture>\s*)?)'
    r"<figcaption>(?P<caption>.*?)</figcaption>",
    re.DOTALL,
)
# An alt text is written as it is read aloud; on the page it looks like the text around it.
PRINTED = {
    r"(?<=\d) percent\b": "\N{NO-BREAK SPACE}%",
    r"\blog gamma\b": "log Γ",
    r"\b[Aa]lpha\b": "α",
    r"\bbeta\b": "β",
    r"\bgamma\b": "γ",
    r"\bdelta\b": "δ",
    r"\bepsilon\b": "ε",
    r"\b[Ll]ambda\b": "λ",
    r"\bmu\b": "μ",
    r"\b[Ss]igma\b": "σ",
    r"\broot two\b": "√2",
    r"δ (?=μ)": "Δ",
    r"δ (?=log)": "Δ ",
    r"([α-ω]) (?=\d|√|e\b|one eighth\b)": "\\1 = ",
    r"([α-ω]) one\b": "\\1 = 1",
}
COLUMNS = re.compile(r"\S(?: {2,}|\t)\S")  # in a line that a program printed
FIGURE = "inbounds-figure"  # the class that `inbounds.book.drawing.alt_text` gives a figure
# Read before anything is drawn: what is folded must not be seen open first.
CHOOSE = """document.documentElement.dataset.layer = "read";
try {
  if (localStorage.getItem("inbounds-layer") === "code") document.documentElement.dataset.layer = "code";
} catch {}"""
BUTTON = {
    "type": "javascript",
    "javascript": "inboundsSwitchLayer()",
    "text": "Code",
    "label": "layer-button",
    "tooltip": "Code of every cell: folded or open",
}


def raw(text: str) -> nodes.raw:
    """Return HTML as a node."""
    return nodes.raw("", text, format="html")


def first_line(code: str) -> str:
    """Return the first line that says something: no import, no blank, no lone bracket."""
    lines = [line.strip() for line in code.splitlines() if line.strip()]
    telling = [line for line in lines if not re.match(r"(import|from)\b|[)\]}\"']+$", line)] or lines or [""]
    line = telling[0]
    return line if len(line) <= LONGEST_LABEL else line[: LONGEST_LABEL - 1].rstrip() + "…"


def opening(code: str, *, stays: bool) -> str:
    """Return the tag and the label that stand before a folded input."""
    count = len(code.strip().splitlines())
    lines = f"{count} line{'' if count == 1 else 's'}"
    kind = "inbounds-code stays-open" if stays else "inbounds-code"
    return (
        f'<details class="{kind}" open><summary><span class="what">Code, {lines}</span> '
        f'<code class="first-line">{html.escape(first_line(code))}</code></summary>'
    )


def stays_open(cell: nodes.Element) -> bool:
    """Whether a cell is what its page is about: built there, or part of an exercise."""
    if PROGRAM in cell["classes"] or "tag_program-extension" in cell["classes"]:
        return True
    node = cell.parent
    while node is not None:
        title = node.next_node(nodes.title) if isinstance(node, nodes.section) else None
        if title is not None and title.astext().startswith(STAYS_OPEN):
            return True
        node = node.parent
    return False


def fold_code(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Put every visible input into a fold that is open."""
    if app.builder.format != "html":
        return
    for source in list(doctree.findall(nodes.container)):
        cell = source.parent
        if source.get("nb_element") == "cell_code_source" and isinstance(cell, nodes.container):
            place = cell.index(source)
            tag = opening(source.astext(), stays=stays_open(cell))
            cell.children[place : place + 1] = [raw(tag), source, raw("</details>")]
            for child in cell.children:
                child.parent = cell


def let_sentences_wrap(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Mark what a program printed as sentences: a narrow page breaks their lines, and leaves columns as they are."""
    if app.builder.format != "html":
        return
    for printed in doctree.findall(nodes.container):
        if printed.get("nb_element") == "cell_code_output":
            for block in printed.findall(nodes.literal_block):
                if not COLUMNS.search(block.astext()):
                    block["classes"].append("sentences")


def as_printed(alt: str) -> str:
    """Return an alt text as print has it: σ = 1 for sigma one, 95 % for 95 percent. A Beta, with its capital, stays."""
    for spelt, printed in PRINTED.items():
        alt = re.sub(spelt, printed, alt)
    return alt


def caption(number: int, alt: str) -> str:
    """Return a figure's caption: what a reader hears who does not see the figure.

    The sentence that is shown is hidden from screen readers, which have read it as alt text already.
    """
    alt = as_printed(alt)
    parts = [alt] if len(alt) <= LONGEST_CAPTION else re.split(r"(?<=[.!?])\s+(?=[A-Z])", alt, maxsplit=1)
    shown, rest = parts[0], parts[1] if len(parts) > 1 else ""
    fold = f"<details><summary>What it shows</summary><p>{html.escape(rest)}</p></details>" if rest else ""
    return (
        f'<figcaption><span class="number">Figure {number}.</span> <span aria-hidden="true">{html.escape(shown)}</span>'
        f"{fold}</figcaption>"
    )


def study_figure(found: re.Match[str], number: int) -> str:
    """Return a figure that came as HTML with its number, and its alt text in a fold behind the caption that it has."""
    alt = as_printed(found["alt"])  # escaped already
    return (
        f'{found["picture"]}<figcaption><span class="number">Figure {number}.</span> {found["caption"]}'
        f"<details><summary>What it shows</summary><p>{alt}</p></details></figcaption>"
    )


def number_figures(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Give every figure of a page its number and its caption, those of the study's tables and forests too."""
    if app.builder.format != "html":
        return
    numbers = itertools.count(1)
    for node in list(doctree.findall(lambda node: isinstance(node, nodes.image | nodes.raw))):
        if isinstance(node, nodes.raw):
            text = STUDY_FIGURE.sub(lambda found: study_figure(found, next(numbers)), node.astext())
            node.children = [nodes.Text(text)]
        elif FIGURE in node["classes"]:
            around, number = node.parent, next(numbers)
            place = around.index(node)
            narrow = f'<source srcset="{node["narrow"]}">' if node.get("narrow") else ""  # for `pictures`
            made = [
                raw(f'<figure class="{FIGURE}">{narrow}'),
                node,
                raw(caption(number, node["alt"]) + "</figure>"),
            ]
            around.children[place : place + 1] = made
            for child in made:
                child.parent = around


def add_button(
    app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Put the switch into the header of pages that have code."""
    if 'class="inbounds-code' in context.get("body", ""):
        context["header_buttons"].insert(0, dict(BUTTON))


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the handlers (called by Sphinx)."""
    app.add_js_file(None, body=CHOOSE, priority=1)
    app.connect("doctree-resolved", fold_code)
    app.connect("doctree-resolved", number_figures)
    app.connect("doctree-resolved", let_sentences_wrap)
    app.connect("html-page-context", add_button, priority=950)  # the theme makes the list of buttons at 501
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
