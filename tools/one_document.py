"""The built book as one document, ready for paper: what `print_book` prints.

Pages keep their markup. Labels that several pages have get the page's name; links between pages become links within
the document. Scripts go, but for the one that sets formulas; folds are open; a film becomes three of its frames.
"""

import base64
import html
import posixpath
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath

import yaml
from bs4 import BeautifulSoup, Tag

from inbounds.book.drawing.videos import stills

ROOT = Path(__file__).resolve().parents[1]
STYLE = Path(__file__).with_name("print.css")
NOT_ON_PAPER = (
    "script, .headerlink, .copybtn, .prev-next-footer, .toggle-button, .inbounds-live, .inbounds-explorable style, "
    "noscript > iframe, button"
)
POINTERS = ("for", "aria-labelledby", "aria-describedby", "aria-controls")
FRAMES = 3


def in_order(toc: Path) -> list[str]:
    """Return the names of a book's pages, as `_toc.yml` has them."""
    contents = yaml.safe_load(toc.read_text(encoding="utf8"))
    return [contents["root"], *(each["file"] for part in contents["parts"] for each in part["chapters"])]


def captions(toc: Path) -> dict[str, str]:
    """Return the caption of the part that begins with a page, by the page's name."""
    parts = yaml.safe_load(toc.read_text(encoding="utf8"))["parts"]
    return {part["chapters"][0]["file"]: part["caption"] for part in parts if "caption" in part}


def anchor(name: str) -> str:
    """Return the label of a page within the document."""
    return f"page-{PurePosixPath(name).name}"


def join(book: Path, names: Sequence[str], numbers: Mapping[str, int]) -> str:
    """Return the document.

    Args:
        book: folder of the built pages.
        names: of the pages, in order.
        numbers: the paper's page on which each begins, for the contents; empty before it is known.
    """
    soups = {name: BeautifulSoup((book / f"{name}.html").read_text("utf8"), "html.parser") for name in names}
    articles = {name: article(soup) for name, soup in soups.items()}
    shared = {
        label
        for label, count in Counter(
            each["id"] for found in articles.values() for each in found.find_all(id=True)
        ).items()
        if count > 1
    }
    for name, found in articles.items():
        for_paper(found, (book / name).parent)
        relabel(found, name, shared, articles)
    head = union(soups, "link[rel=stylesheet], head style") + union(soups, "head script", "athJax")
    titles = {name: title(found) for name, found in articles.items()}
    body = "\n".join(str(found) for found in articles.values())
    return (
        '<!DOCTYPE html>\n<html lang="en" data-theme="light" data-mode="light"><head><meta charset="utf-8">'
        "<title>In Bounds</title>"
        f"{head}<style>{STYLE.read_text('utf8')}</style></head>\n"
        f'<body><main class="bd-content">{title_page()}{listed(names, titles, numbers)}\n{body}</main></body></html>'
    )


def union(soups: Mapping[str, BeautifulSoup], what: str, containing: str = "") -> str:
    """Return the elements of all heads that a selector finds, each once: no page needs all of them."""
    found = dict.fromkeys(str(each) for soup in soups.values() for each in soup.select(what))
    return "".join(each for each in found if containing.lower() in each.lower())


def article(soup: BeautifulSoup) -> Tag:
    """Return what a page says, without what surrounds it."""
    found = soup.select_one("article.bd-article")
    if found is None:
        raise RuntimeError("a page without an article: build the book anew, with `make book FORCE=1`")
    return found


def title(found: Tag) -> str:
    """Return a page's title as text, with its number."""
    return heading_of(found, "h1")


def heading_of(found: Tag, *levels: str) -> str:
    """Return the first heading of some levels, as text."""
    heading = found.find(levels)
    return " ".join(heading.get_text().replace("#", "").split()) if isinstance(heading, Tag) else ""


def for_paper(found: Tag, folder: Path) -> None:
    """Open what is folded, take out what only a screen can use, and show films as frames.

    Args:
        found: what the page says.
        folder: of the page, for the addresses of its films.
    """
    for each in found.select(NOT_ON_PAPER):
        each.decompose()
    for each in found.find_all("details"):
        each["open"] = ""
    for each in found.select(".dropdown, .toggle"):
        each["class"] = [
            name for name in each["class"] if name not in ("dropdown", "toggle", "toggle-hidden")
        ]
    for each in found.select("input.sd-tab-label, .sd-tab-set > input"):
        each.decompose()  # its label becomes the heading of what was behind the tab
    for each in found.find_all("img", loading=True):
        del each["loading"]
    for film in found.find_all("video"):
        film.replace_with(BeautifulSoup(frames(film, folder), "html.parser"))


def frames(film: Tag, folder: Path) -> str:
    """Return three frames of a film, from its beginning to its end, in a row."""
    said = html.escape(film.get("aria-label", "film"), quote=True)
    source = film.find("source") or film
    file = folder / str(source.get("src", ""))
    if not file.is_file():
        return f'<p class="no-film">{said}</p>'
    pictures = "".join(
        f'<img alt="{said}, frame {i} of {FRAMES}" src="data:image/jpeg;base64,{base64.b64encode(data).decode()}">'
        for i, data in enumerate(stills(file.read_bytes(), FRAMES), 1)
    )
    return f'<div class="frames">{pictures}</div>'


def relabel(found: Tag, name: str, shared: set[str], articles: Mapping[str, Tag]) -> None:
    """Give labels that several pages have the page's name, and let links lead to where they lead in the document."""

    def here(page: str, label: str) -> str:
        return f"{anchor(page)}--{label}" if label in shared else label

    for each in found.find_all(id=True):
        each["id"] = here(name, each["id"])
    for pointer in POINTERS:
        for each in found.find_all(attrs={pointer: True}):
            each[pointer] = " ".join(here(name, label) for label in str(each[pointer]).split())
    for link in found.find_all("a", href=True):
        address, _, label = link["href"].partition("#")
        if re.match(r"[a-z]+:", address):
            continue
        page = resolved(name, address) if address else name
        if page in articles:
            link["href"] = f"#{here(page, label) if label else anchor(page)}"
        elif address:
            link.unwrap()  # a download, or a page that is not printed
    found["id"] = anchor(name)


def resolved(name: str, address: str) -> str:
    """Return the name of the page to which a relative address leads.

    Example:
        >>> resolved("notebooks/ppo", "../book/notation.html")
        'book/notation'
    """
    return posixpath.normpath(posixpath.join(posixpath.dirname(name), address)).removesuffix(".html")


def title_page() -> str:
    """Return the first page."""
    about = yaml.safe_load((ROOT / "_config.yml").read_text("utf8"))
    name, author = html.escape(about["title"]), html.escape(about["author"])
    return f'<div class="title-page"><p class="name">{name}</p><p>{author}</p></div>'


def listed(names: Sequence[str], titles: Mapping[str, str], numbers: Mapping[str, int]) -> str:
    """Return the contents: a line a page, with its number on paper once that is known."""
    part = captions(ROOT / "_toc.yml")
    lines = []
    for name in names:
        if name in part:
            lines.append(f'<li class="part">{html.escape(part[name])}</li>')
        number = f'<span class="at">{numbers[name]}</span>' if name in numbers else ""
        lines.append(f'<li><a href="#{anchor(name)}">{html.escape(titles[name])}</a>{number}</li>')
    return f'<nav class="contents" aria-label="Contents"><h1>Contents</h1><ol>{"".join(lines)}</ol></nav>'
