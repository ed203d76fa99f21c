"""Print the built book: one PDF with page numbers, an outline, contents and tags.

    python tools/print_book.py                         the whole book, _build/pdf/in-bounds.pdf  (needs `make book`)
    python tools/print_book.py --pages notebooks/ppo notebooks/trpo --out two.pdf
    python tools/print_book.py --keep                  keep the one document that is printed, beside the PDF

The pages are joined into one document in the book's order (`one_document`), and Chromium prints it twice: the second
time the contents have the page numbers that the first one shows. What is folded is open on paper, a film is three of
its frames, an explorable its picture, and what is too wide for the paper is made smaller.
"""

import argparse
import contextlib
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import one_document

ROOT = Path(__file__).resolve().parents[1]
HTML = ROOT / "_build" / "html"
OUT = ROOT / "_build" / "pdf" / "in-bounds.pdf"
LEFT_RIGHT, TOP, BOTTOM = "18mm", "16mm", "18mm"
PAPER = {"width": int(174 / 25.4 * 96), "height": 1000}  # px: A4 without the margins
FOOTER = """<div style="width:100%;font:8pt sans-serif;color:#555;text-align:center">
<span class="pageNumber"></span></div>"""
# What is wider than the paper, or a picture that is longer, is made smaller until it fits; long code goes on overleaf.
FIT = """() => {
  for (const it of document.querySelectorAll('figure img, .cell_output img')) {
    const {width, height} = it.getBoundingClientRect();
    if (height > LONGEST) it.style.setProperty('width', `${width * LONGEST / height}px`, 'important');
  }
  for (const it of document.querySelectorAll('.highlight, .admonition, details')) {
    if (it.getBoundingClientRect().height < 450) continue;
    for (let each = it; each.tagName !== 'MAIN'; each = each.parentElement) {
      each.style.setProperty('break-inside', 'auto', 'important');
      each.style.setProperty('overflow', 'visible', 'important');
      if (getComputedStyle(each).display === 'flex') each.style.setProperty('display', 'block', 'important');
    }
  }
  const page = document.querySelector('main').clientWidth;
  for (const it of document.querySelectorAll('table, mjx-container[display=true], .inbounds-static img')) {
    const room = Math.min(page, it.parentElement.closest('div, section, figure, main').clientWidth || page);
    const wide = Math.max(it.scrollWidth, it.getBoundingClientRect().width);
    if (wide > room + 1) it.style.zoom = String(Math.max(0.35, room / wide * 0.99));
  }
}""".replace("LONGEST", "850")  # px of the paper's 990, for there is a caption, too
SETTLED = """async () => {
  await document.fonts.ready;
  if (window.MathJax?.startup) await MathJax.startup.promise;
}"""
MINUTES = 10


def print_once(document: Path, out: Path, browser: Any = None) -> None:
    """Let Chromium, or a browser that runs already, print a document; tagged, with an outline of its headings."""
    sys.path.insert(0, str(ROOT))
    from tests.pages.browser import chromium  # the browser of the page tests

    limit = MINUTES * 60_000
    with contextlib.nullcontext(browser) if browser else chromium() as running:
        page = running.new_page(viewport=PAPER, color_scheme="light")
        page.set_default_timeout(limit)
        page.emulate_media(media="print")
        page.goto(document.as_uri(), wait_until="load", timeout=limit)
        page.evaluate(SETTLED)
        page.evaluate(FIT)
        page.pdf(
            path=str(out),
            format="A4",
            margin={"left": LEFT_RIGHT, "right": LEFT_RIGHT, "top": TOP, "bottom": BOTTOM},
            display_header_footer=True,
            header_template="<span></span>",
            footer_template=FOOTER,
            print_background=True,
            tagged=True,
            outline=True,
        )
        page.close()


def page_numbers(pdf: Path, names: Sequence[str]) -> dict[str, int]:
    """Return on which page of a PDF each page of the book begins, by the destinations that its contents link to."""
    from pypdf import PdfReader  # not above: `--help` needs none

    reader = PdfReader(pdf)
    where = {name.lstrip("/"): at for name, at in reader.named_destinations.items()}
    found = {}
    for name in names:
        target = where.get(one_document.anchor(name))
        number = None if target is None else reader.get_destination_page_number(target)
        if number is not None:
            found[name] = number + 1
    return found


def print_book(
    html: Path, names: Sequence[str], out: Path, *, keep: bool = False, browser: Any = None
) -> Mapping[str, int]:
    """Print pages of a built book into one PDF.

    Args:
        html: folder of the built book.
        names: of the pages, in the order of the print.
        out: the PDF.
        keep: keep the document that was printed.
        browser: Playwright's, if one runs already; else Chromium is started.

    Returns:
        The first page of each, by its name.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    document = (
        html / "notebooks" / "whole-book-for-print.htm"
    )  # a neighbour of the pages: their links to pictures hold
    try:
        start: dict[str, int] = {}
        for turn in ("contents without numbers", "contents with numbers"):
            begun = time.perf_counter()
            document.write_text(one_document.join(html, names, start), encoding="utf8")
            print_once(document, out, browser)
            start = page_numbers(out, names)
            print(f"printed, {turn}  ({time.perf_counter() - begun:.0f} s)", flush=True)
    finally:
        if keep and document.exists():
            print(f"Kept: {document}")
        else:
            document.unlink(missing_ok=True)
    return start


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--html", type=Path, default=HTML, help="folder of the built book (_build/html)")
    parser.add_argument("--out", type=Path, default=OUT, help="the PDF (_build/pdf/in-bounds.pdf)")
    parser.add_argument("--pages", nargs="+", metavar="PAGE", help="these alone, such as notebooks/ppo")
    parser.add_argument("--keep", action="store_true", help="keep the document that is printed")
    args = parser.parse_args(arguments)
    names = args.pages or one_document.in_order(ROOT / "_toc.yml")
    missing = [name for name in names if not (args.html / f"{name}.html").exists()]
    if missing:
        print(f"no page {missing[0]} in {args.html}: run `make book` first", file=sys.stderr)
        return 1
    try:
        start = print_book(args.html.resolve(), names, args.out.resolve(), keep=args.keep)
    except (ImportError, RuntimeError) as error:
        print(f"not printed: {error}\n`make pdf` installs what printing needs.", file=sys.stderr)
        return 1
    print(f"{len(start)} pages of the book, {args.out.stat().st_size / 1e6:.0f} MB.\nOpen {args.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
