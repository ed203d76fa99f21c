"""The book's own Sphinx extension: no page asks another host for anything, and each loads only what it uses.

* sphinx-thebe's scripts are dropped. Jupyter Book 1.x puts them on every page, even with thebe off, where they
  throw ``THEBE_JS_URL has already been declared``.
* No script holds up a page: what a page needs runs once the page is read (see ``let_pages_go_first``), BokehJS and the
  explorables when the reader comes near one (``_static/load_explorables.js``); the search's index is loaded by the
  search alone (``_templates``).
* BokehJS and the explorables' own scripts are copied into the book, and loaded on the pages that show one. A page with
  a live robot loads two small scripts, which load the rest when the reader asks for it; one with a part of
  the study to choose from loads that part's own.
* Docstrings are read the way they are written (see ``shield``, ``restore`` and ``resolve_public_name``).
* Numbers that a notebook glues into a sentence are set as the prose sets them (see ``set_numbers``).
* An interval and a number with its per cent sign stay on one line (see ``keep_intervals``).
* A full stop behind a DOI or an address stays with it (see ``keep_full_stops``).
* Roles and labels that hide from a screen reader what others see are mended (see ``mend_labels``).
* The theme that the system asks for is set before anything is drawn.
* A page that quotes a number of another notebook, or continues its program, is read again when that one has changed.
* The execution cache's folder is named by ``tools/build_book.py`` (a digest of package, data and pins).
"""

import json
import os
import pydoc
import re
import shutil
import zlib
from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.environment import BuildEnvironment

from inbounds.book.explorables.frame import javascript_files
from inbounds.book.explorer.assets import SCRIPTS as OF_THE_STUDY
from inbounds.book.pages.glue import ROLE
from inbounds.book.pages.programs import continued
from inbounds.book.report.html import together

FOLDER = "explorables"
EXPLORABLE = 'class="inbounds-explorable"'
LIVE_FOLDER = "live"  # filled by tools/build_book.py
LIVE_ROBOT = 'class="inbounds-live-robot"'
SHORT = 20
"""Characters of code that stay on one line of text, on a phone too."""


def use_named_cache(app: Sphinx, config: Config) -> None:
    """Let the build tool choose the execution cache."""
    if "INBOUNDS_NB_CACHE" in os.environ:
        config.nb_execution_cache_path = os.environ["INBOUNDS_NB_CACHE"]


def sources(page: Path) -> set[Path]:
    """Return the notebooks whose numbers a page quotes, and those whose program it continues.

    Args:
        page: a notebook, or Markdown.
    """
    quoted = ROLE.findall(page.read_text(encoding="utf8"))
    found = {(page.parent / other).resolve() for other, _, _ in quoted if other}
    earlier = continued(page) if page.suffix == ".ipynb" else None
    while earlier is not None:
        found.add(earlier.resolve())
        earlier = continued(earlier)
    return found


def read_again(
    app: Sphinx, env: BuildEnvironment, added: set[str], changed: set[str], removed: set[str]
) -> list[str]:
    """Return the pages that show something of a notebook that has changed, which Sphinx does not know."""
    new = {Path(env.doc2path(name)).resolve() for name in added | changed}
    others = sorted(env.found_docs - added - changed)
    return [name for name in others if sources(Path(env.doc2path(name))) & new]


def copy_explorables(app: Sphinx) -> None:
    """Serve BokehJS and the explorables' scripts from the book itself; before pages name them with their checksums."""
    if app.builder.format == "html":
        target = Path(app.outdir) / "_static" / FOLDER
        target.mkdir(parents=True, exist_ok=True)
        for script in [*javascript_files(), *chain(*OF_THE_STUDY.values())]:
            shutil.copy2(script, target / script.name)


def choose_scripts(
    app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Drop thebe's scripts from every page; add those of explorables and live robots to the pages that need them."""
    context["default_mode"] = "auto"  # follow the system; the theme logs an error where this is empty
    if EXPLORABLE in context.get("body", ""):
        wanted = addresses(javascript_files(), context["pathto"](f"_static/{FOLDER}/", 1))
        app.add_js_file("load_explorables.js", **{"data-scripts": json.dumps(wanted)})
    shown = [
        scripts for name, scripts in OF_THE_STUDY.items() if f'class="{name}"' in context.get("body", "")
    ]
    for script in dict.fromkeys(chain(*shown)):  # a page may show two elements that share a script
        app.add_js_file(f"{FOLDER}/{script.name}")
    if LIVE_ROBOT in context.get("body", ""):
        for name in ("status.js", "boot.js"):  # all else is loaded when the reader asks for it
            app.add_js_file(f"{LIVE_FOLDER}/{name}")
    context["script_files"] = [script for script in context["script_files"] if not is_thebe(script)]


def addresses(scripts: Iterable[Path], folder: str) -> list[str]:
    """Return where a page finds scripts: a digest of each joins its address, so that no browser keeps an old one.

    Args:
        scripts: the files.
        folder: address of the folder in which the book has them, ending in a slash.
    """
    return [f"{folder}{script.name}?v={zlib.crc32(script.read_bytes()):08x}" for script in scripts]


def let_pages_go_first(
    app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Let scripts wait until the page is read. They keep their order; inline ones need ``documentation_options.js``.

    The search page stays as it is: what the theme adds there at the end needs the scripts of the head.
    """
    if pagename != "search":
        context["script_files"] = [deferred(script) for script in context["script_files"]]


def deferred(script: Any) -> Any:
    """The script tag, told to wait; those of several pages are the same object."""
    if not script.filename or "documentation_options" in str(script.filename):
        return script
    return type(script)(script.filename, priority=script.priority, **script.attributes | {"defer": "defer"})


MENDED = {
    '<div class="proof admonition" id="proof">\n<p>Proof. ': (
        '<div class="proof admonition" id="proof">\n<p><span class="proof-begins">Proof.</span> '
    ),
    ' role="doc-biblioentry"': ' role="listitem"',  # deprecated by ARIA, and no child for the list around it
    ' aria-label="Toggle hidden content"': "",  # on a summary that says "Show code cell source"
}


LONELY = re.compile(r"((?:doi:|https?://)[^<]*)([^<]{4})</a>\.")
TOGETHER = r'\1<span style="white-space:nowrap">\2.</span></a>'


def keep_full_stops(
    app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Keep the full stop behind a DOI or an address with its end: both break anywhere, and it would stand alone."""
    context["body"] = LONELY.sub(TOGETHER, context.get("body", ""))


def mend_labels(
    app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Say to assistive technology what the page says to the eye."""
    for written, right in MENDED.items():
        context["body"] = context.get("body", "").replace(written, right)


SHIELDED: dict[str, list[str]] = {}


def shield(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Keep one-line attribute docstrings from Napoleon, which reads ``Name: what it is`` as a type and its text."""
    if what in ("attribute", "property", "data"):
        SHIELDED[name] = lines[:]
        lines.clear()


def restore(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Give the shielded docstrings back, and let reStructuredText read mathematics as mathematics.

    A docstring writes ``|μ|`` for an absolute value, where reStructuredText sees a substitution, and ``$$ ... $$`` on
    a line of its own for a formula, as the notebooks do.
    """
    lines[:] = SHIELDED.pop(name, lines)
    for i, line in enumerate(lines):
        if formula := re.fullmatch(r"(\s*)\$\$(.*)\$\$\s*", line):
            lines[i] = f"{formula[1]}.. math:: {formula[2].strip()}"
        elif not re.match(r"\s*(>>>|\.\.\. |[|+])", line):
            parts = re.split(r"(`+[^`]*`+)", line)
            lines[i] = "".join(part if part.startswith("`") else part.replace("|", r"\|") for part in parts)


def resolve_public_name(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, contnode: nodes.TextElement
) -> nodes.Node | None:
    """Link a name of ours that an annotation writes short, or by the module in which it is defined.

    The API page documents ``inbounds.learning.Collector``; an annotation says ``Collector``, or names its module too.
    """
    if node.get("refdomain") != "py":
        return None
    target = node["reftarget"]
    domain = env.get_domain("py")
    known = [name for name in domain.objects if name.rpartition(".")[2] == target.rpartition(".")[2]]
    if "." in target:
        known = [
            name
            for name in known
            if pydoc.locate(name) is not None and pydoc.locate(name) is pydoc.locate(target)
        ]
    if len(known) != 1:
        return None
    return domain.resolve_xref(env, node["refdoc"], app.builder, "obj", known[0], node, contnode)


SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def as_prose(number: str) -> str:
    """Return a formatted number as it is typed: real minus signs, powers of ten, narrow spaces in it and before %."""

    def power(found: re.Match[str]) -> str:
        mantissa = "" if found["mantissa"] == "1" else f"{found['mantissa']} · "
        return f"{mantissa}10{str(int(found['exponent'])).translate(SUPERSCRIPT)}"

    number = re.sub(r"(?<![\w.])(?P<mantissa>\d(\.\d+)?)e(?P<exponent>[+-]\d+)(?!\w)", power, number)
    number = re.sub(r"(?<=\d)%", "\N{NARROW NO-BREAK SPACE}%", number)
    number = re.sub(r"(?<=\d),(?=\d{3}(?!\d))", "\N{NARROW NO-BREAK SPACE}", number)
    return re.sub(r"(?<![\w)\]])-(?=\d)", "\N{MINUS SIGN}", number)


def set_numbers(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Set glued numbers, which Python's format codes write with hyphens and commas, as typed ones are."""
    for inline in doctree.findall(nodes.inline):
        if "pasted-text" in inline["classes"]:
            for text in list(inline.findall(nodes.Text)):
                text.parent.replace(text, nodes.Text(as_prose(text.astext())))


def keep_intervals(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Keep the two ends of an interval on one line, and a per cent sign with its number, but for code and formulas."""
    for text in list(doctree.findall(nodes.Text)):
        # Who made a figure's HTML anew has given its text no parent.
        if text.parent is None or isinstance(
            text.parent, nodes.FixedTextElement | nodes.literal | nodes.math | nodes.raw
        ):
            continue
        # A glued number before it is a node of its own.
        glued = text.startswith(" %") and follows_number(text)
        kept = together(f"0{text.astext()}")[1:] if glued else together(text.astext())
        if text == ", " and between_ends(text):
            kept = ",\N{NO-BREAK SPACE}"
        if kept != text.astext():
            text.parent.replace(text, nodes.Text(kept))


def follows_number(text: nodes.Text) -> bool:
    """Whether a text stands behind a number that a notebook has glued into the sentence."""
    place = text.parent.index(text)
    before = text.parent[place - 1] if place else None
    return isinstance(before, nodes.Element) and "pasted-text" in before["classes"]


def keep_words(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Keep short code on one line, and a formula with the word that a hyphen ties to it, such as $p$-value."""
    for literal in doctree.findall(nodes.literal):
        if len(literal.astext()) <= SHORT:
            literal["classes"].append("together")
    for math in list(doctree.findall(nodes.math)):
        place = math.parent.index(math)
        after = math.parent[place + 1] if place + 1 < len(math.parent) else None
        if isinstance(after, nodes.Text) and (tied := re.match(r"-\w+", after)):
            both = nodes.inline("", "", math.deepcopy(), nodes.Text(tied[0]), classes=["together"])
            math.parent[place : place + 2] = [both, nodes.Text(after[tied.end() :])]


def between_ends(text: nodes.Text) -> bool:
    """Whether a text stands between the two ends of an interval that a notebook has glued into the sentence."""
    around = text.parent.children
    place = text.parent.index(text)
    if not 1 < place < len(around) - 2:
        return False
    opening, low, _, high, closing = around[place - 2 : place + 3]
    ends = [low, high]
    glued = all(isinstance(end, nodes.Element) and "pasted-text" in end["classes"] for end in ends)
    return glued and opening.astext().endswith("[") and closing.astext().startswith("]")


# "auto" shows the logo of either theme until the theme's script has run, and then the page moves.
CHOOSE_THEME = """if (document.documentElement.dataset.theme === "auto")
  document.documentElement.dataset.theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";"""


def is_thebe(script: Any) -> bool:
    """Whether a script tag comes from sphinx-thebe: its file, or its inline settings."""
    attributes = getattr(script, "attributes", {})
    return "thebe" in str(getattr(script, "filename", "")) or "THEBE_JS_URL" in (attributes.get("body") or "")


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the handlers (called by Sphinx)."""
    app.add_js_file(None, body=CHOOSE_THEME, priority=1)
    app.connect("config-inited", use_named_cache, priority=100)
    app.connect("html-page-context", choose_scripts, priority=900)
    app.connect("html-page-context", let_pages_go_first, priority=950)
    app.connect("html-page-context", mend_labels)
    app.connect("html-page-context", keep_full_stops)
    app.connect("autodoc-process-docstring", shield, priority=400)  # Napoleon is at 500
    app.connect("autodoc-process-docstring", restore, priority=600)
    app.connect("missing-reference", resolve_public_name)
    app.connect("doctree-resolved", set_numbers)
    app.connect("doctree-resolved", keep_intervals, priority=600)  # when the glued numbers are set
    app.connect("doctree-resolved", keep_words)
    app.connect("builder-inited", copy_explorables)
    app.connect("env-get-outdated", read_again)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
