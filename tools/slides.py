"""Slides for who teaches: of every core chapter a deck of its key statements and figures.

    python tools/slides.py                     all core chapters, into _build/slides  (needs `make book`)
    python tools/slides.py --pages ppo trpo    these alone

A deck is one HTML file: the question, what the class will know, each definition and statement without its proof, each
figure, the exercises with their minutes, the summary. Arrow keys turn the slides; printed, each is a page. A slide with
more to say than it has room is set smaller. The pictures lie beside the decks, in `figures`, named by chapter and
number, to be put into slides of one's own.
"""

import argparse
import html
import re
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import one_document
from bs4 import BeautifulSoup, Tag

from inbounds.book.pages.contents import contents

ROOT = Path(__file__).resolve().parents[1]
HTML = ROOT / "_build" / "html"
OUT = ROOT / "_build" / "slides"
STYLE = Path(__file__).with_name("slides.css")
FIGURES = "figure.inbounds-figure, figure:has(> picture)"  # a chapter's own, and those of the study
TURN = """
const slides = [...document.querySelectorAll('section.slide')];
const now = () => Math.max(0, slides.findIndex((slide) => '#' + slide.id === location.hash));
const go = (to) => { location.hash = slides[Math.min(slides.length - 1, Math.max(0, to))].id; };
const fit = (slide) => {
  slide.style.fontSize = '';
  for (let percent = 95; percent >= 60 && slide.scrollHeight > innerHeight; percent -= 5) {
    slide.style.fontSize = `${percent}%`;
  }
};
const show = () => slides.forEach((slide, i) => {
  slide.classList.toggle('shown', i === now());
  if (i === now()) fit(slide);
});
addEventListener('hashchange', show);
addEventListener('resize', show);
addEventListener('load', show);
document.fonts.ready.then(show);
addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  const { key } = event;
  if (['ArrowRight', 'PageDown', ' '].includes(key)) go(now() + 1);
  else if (['ArrowLeft', 'PageUp'].includes(key)) go(now() - 1);
  else if (key === 'Home') go(0);
  else if (key === 'End') go(slides.length - 1);
  else return;
  event.preventDefault();
});
document.documentElement.classList.add('turned');
show();
"""


def section_title(section: Tag) -> str:
    """Return a section's heading without its number; of the chapter itself with it."""
    return re.sub(r"^\d+(\.\d+)+\.? ", "", one_document.heading_of(section, "h1", "h2", "h3", "h4"))


def place_of(figure: Tag) -> str:
    """Return where a figure stands: the heading of its section, or the title of the solution that it belongs to."""
    solution = figure.find_parent(class_="solution")
    if isinstance(solution, Tag) and (title := solution.select_one(".admonition-title")):
        return title.get_text(" ", strip=True)
    section = figure.find_parent("section")
    return section_title(section) if isinstance(section, Tag) else ""


def caption_of(figure: Tag) -> str:
    """Return what stands below a figure, as HTML, without its number and the fold that tells what it shows."""
    caption = figure.figcaption
    if not isinstance(caption, Tag):
        return ""
    return "".join(
        str(child)
        for child in caption.children
        if not (isinstance(child, Tag) and (child.name == "details" or "number" in child.get("class", [])))
    ).strip()


def parts(found: Tag) -> Iterator[tuple[str, str]]:
    """Give what stands on the slides of a chapter, in its order: a heading, and HTML.

    Args:
        found: the article of a built page.
    """
    heading = one_document.title(found)
    question = found.select_one("h1 ~ p > strong")
    yield heading, f'<p class="question">{question.decode_contents() if question else ""}</p>'
    wanted = f"#what-you-will-know, div.proof:not([id=proof]), {FIGURES}, #exercises, #summary"
    for each in found.select(wanted):
        if each.get("id") == "exercises":
            titles = [one.select_one(".admonition-title") for one in each.select("div.exercise")]
            lines = "".join(f"<li>{title.decode_contents()}</li>" for title in titles if title)
            if lines:
                yield "Exercises", f'<ul class="exercises">{lines}</ul>'
        elif each.name == "section":
            yield section_title(each), "".join(map(str, each.find_all(["ul", "ol"], recursive=False)))
        elif each.name == "figure":
            yield place_of(each), f"{each.img}<p>{caption_of(each)}</p>"
        else:
            title = each.select_one(".admonition-title")
            said = "".join(str(child) for child in each.children if child is not title)
            yield title.get_text(" ", strip=True) if title else "", said


def deck(book: Path, name: str, out: Path) -> int:
    """Write the deck of a chapter, and its figures; return the number of slides."""
    soup = BeautifulSoup((book / "notebooks" / f"{name}.html").read_text("utf8"), "html.parser")
    found = one_document.article(soup)
    one_document.for_paper(found, book / "notebooks")
    for link in found.find_all("a"):
        link.unwrap()
    (out / "figures").mkdir(parents=True, exist_ok=True)
    for number, picture in enumerate(found.select(f":is({FIGURES}) img"), 1):
        source = (book / "notebooks" / str(picture["src"])).resolve()
        target = out / "figures" / f"{name}-{number}{source.suffix}"
        shutil.copyfile(source, target)
        picture["src"] = f"figures/{target.name}"
        picture["class"] = ["tall"] if int(picture.get("height", 0)) > int(picture.get("width", 0)) else []
    slides = list(parts(found))
    body = "\n".join(
        f'<section class="slide" id="{i}"><h2>{html.escape(title)}</h2><div class="said">{said}</div>'
        f"<footer>{html.escape(slides[0][0])} · {i} / {len(slides)}</footer></section>"
        for i, (title, said) in enumerate(slides, 1)
    )
    styles = '<link rel="stylesheet" href="_static/formulas.css">'
    (out / f"{name}.html").write_text(
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{html.escape(slides[0][0])}</title>{styles}<style>{STYLE.read_text('utf8')}</style></head>\n"
        f"<body>{body}<script>{TURN}</script></body></html>",
        encoding="utf8",
    )
    return len(slides)


def formulas_for(book: Path, out: Path) -> None:
    """Put style and fonts of the formulas beside the decks."""
    static = book / "_static"
    (out / "_static").mkdir(parents=True, exist_ok=True)
    shutil.copyfile(static / "formulas.css", out / "_static" / "formulas.css")
    shutil.copytree(static / "mathjax", out / "_static" / "mathjax", dirs_exist_ok=True)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--html", type=Path, default=HTML, help="folder of the built book (_build/html)")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the decks (_build/slides)")
    parser.add_argument("--pages", nargs="+", metavar="CHAPTER", help="these alone, such as ppo")
    args = parser.parse_args(arguments)
    names = args.pages or contents(ROOT / "_toc.yml").core
    missing = [name for name in names if not (args.html / "notebooks" / f"{name}.html").exists()]
    if missing:
        print(f"no page notebooks/{missing[0]} in {args.html}: run `make book` first", file=sys.stderr)
        return 1
    if not (args.html / "_static" / "formulas.css").exists():
        print(
            "the formulas of the book are not set: run `make book` where npm can be reached", file=sys.stderr
        )
        return 1
    args.out.mkdir(parents=True, exist_ok=True)
    formulas_for(args.html, args.out)
    for name in names:
        print(f"{name}: {deck(args.html, name, args.out)} slides", flush=True)
    print(f"Open {args.out / f'{names[0]}.html'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
