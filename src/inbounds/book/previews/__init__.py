"""What a link leads to, shown beside it: terms, statements, equations and sources, from `file://` too.

`write` takes the targets of the links out of the built pages, formulas and all, and writes one script for each page
that has some: `_static/previews/PAGE.js`. A page loads `hover.js`, which loads the script of the link's page when a
reader's pointer or focus first rests on such a link, and nothing before.
"""

from __future__ import annotations

import json
import posixpath
import re
import shutil
from collections import defaultdict
from pathlib import Path

from inbounds.book.templates import script_json

HERE = Path(__file__).parent
FOLDER = "previews"  # below _static
_LINK = re.compile(r'<a class="reference internal" href="(?P<page>[^"#:]*)#(?P<id>[^"]+)"')
_TARGET = re.compile(r'<(?P<tag>dt|div)\b(?P<attributes>[^>]*\bid="(?P<id>[^"]+)"[^>]*)>')
_KINDS = re.compile(r'\bclass="(?:proof|math|citation)\b')
_OWN = re.compile(r"<!-- previews -->.*?<!-- /previews -->", re.DOTALL)


def write(folder: Path) -> int:
    """Write the previews of a built book anew, and let its pages load them; return how many there are.

    Args:
        folder: a built book, its formulas set.

    Example:
        >>> write(Path("_build/html"))  # doctest: +SKIP
        524
    """
    pages = {
        path.relative_to(folder).as_posix(): path.read_text(encoding="utf8")
        for path in sorted(folder.rglob("*.html"))
        if "_static" not in path.relative_to(folder).parts
    }
    wanted: dict[str, set[str]] = defaultdict(set)
    for name, text in pages.items():
        for page, target in links(name, text):
            wanted[page].add(target)
    home = folder / "_static" / FOLDER
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir(parents=True)
    for each in ("hover.js", "hover.css"):
        shutil.copy2(HERE / each, home / each)
    made = 0
    for name, targets in wanted.items():
        if found := previews(pages.get(name, ""), targets):
            made += len(found)
            script = f"inbounds.previews.come({json.dumps(name)}, {script_json(found)});\n"
            (home / f"{name.replace('/', '.')}.js").write_text(script, encoding="utf8")
    for name, text in pages.items():
        static = posixpath.relpath(f"_static/{FOLDER}", posixpath.dirname(name) or ".")
        own = f'<!-- previews --><link rel="stylesheet" href="{static}/hover.css" />'
        own += f'<script defer src="{static}/hover.js"></script><!-- /previews -->'
        text = _OWN.sub("", text)
        (folder / name).write_text(text.replace("</head>", f"{own}</head>", 1), encoding="utf8")
    return made


def links(name: str, page: str) -> set[tuple[str, str]]:
    """Return the page and the target of every link inside the book that has one.

    Args:
        name: the page's path in the book.
        page: its HTML.

    Example:
        >>> sorted(links("notebooks/a.html", '<a class="reference internal" href="../book/b.html#c">'))
        [('book/b.html', 'c')]
    """
    home = posixpath.dirname(name)
    return {
        (posixpath.normpath(posixpath.join(home, match["page"])) if match["page"] else name, match["id"])
        for match in _LINK.finditer(page)
    }


def previews(page: str, targets: set[str]) -> dict[str, str]:
    """Return of each target that is a term, a statement, an equation or a source what is shown of it.

    Args:
        page: HTML with the targets.
        targets: their ids.

    Example:
        >>> previews('<dt id="term-box">box</dt><dd><p>A set.</p></dd>', {"term-box"})
        {'term-box': '<p><strong>box</strong></p><p>A set.</p>'}
    """
    found = {}
    for match in _TARGET.finditer(page):
        if match["id"] not in targets:
            continue
        if match["tag"] == "dt":
            term = page[match.end() : page.index("</dt>", match.end())]
            start = page.find("<dd>", match.end())
            if match["id"].startswith("term-") and start >= 0:
                text = page[start + 4 : page.index("</dd>", start)].strip()
                found[match["id"]] = plain(f"<p><strong>{term}</strong></p>{text}")
        elif _KINDS.search(match["attributes"]):
            found[match["id"]] = plain(_whole(page, match.start()))
    return found


def plain(html: str) -> str:
    """Return HTML without ids, links and their marks: a copy that only says something.

    Args:
        html: a piece of a page.

    Example:
        >>> plain('<p id="a">see <a href="b">there</a><a class="headerlink" href="#a">#</a></p>')
        '<p>see <span>there</span></p>'
    """
    html = re.sub(r'<a class="headerlink".*?</a>', "", html, flags=re.DOTALL)
    html = re.sub(r"<a\b[^>]*>", "<span>", html).replace("</a>", "</span>")
    return re.sub(r' (?:id|role|tabindex)="[^"]*"', "", html)


def _whole(page: str, start: int) -> str:
    """Return the `div` that starts here, with all that is in it."""
    depth = 0
    for tag in re.compile(r"<(/?)div\b").finditer(page, start):
        depth += -1 if tag[1] else 1
        if depth == 0:
            return page[start : page.index(">", tag.end()) + 1]
    return ""
