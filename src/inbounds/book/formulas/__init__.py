"""Sets the formulas of a built book beforehand, so that nothing moves while a page opens.

Sphinx writes TeX and lets MathJax set it in the browser, after the text stands. `write` replaces the TeX in every page
by what MathJax makes of it, in one run of node, and takes its script off the page. What MathJax would measure in a
browser is left to the style sheet: a formula's em is the x-height of the text around it, over that of MathJax's font.
Glyphs have their widths by style, so that nothing moves when the fonts come. The TeX stays for who copies a formula
(`data-tex`, and `book.js`).

Not MathML alone: a browser breaks no line in it, and on a phone long formulas in the text would be cut off.

    python -m inbounds.book.formulas FOLDER
"""

from __future__ import annotations

import hashlib
import html
import json
import re
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from inbounds.book.npm import CACHE, NpmError, esbuild, made_once, node

JS = Path(__file__).parent / "js"
STYLES = "formulas.css"
FONTS = "mathjax/output/chtml/fonts/woff-v2"  # below _static, where sphinx-mathjax-offline puts them
_INPUTS = ("package.json", "package-lock.json", "set.entry.js")
_PATIENCE = 600  # seconds for all formulas; a book of 2,600 takes three
_INLINE = re.compile(r'<span class="math notranslate nohighlight">\\\((?P<tex>.*?)\\\)</span>', re.DOTALL)
_DISPLAY = re.compile(
    r'(?P<open><div class="math notranslate nohighlight"[^>]*)>(?P<before>\s*(?:<span class="eqno">.*?</span>)?)'
    r"\\\[(?P<tex>.*?)\\\]\s*</div>",
    re.DOTALL,
)
_SETTINGS = re.compile(r"\s*<script>window\.MathJax = (\{.*?\})</script>")
_SCRIPT = re.compile(r'\s*<script [^>]*src="(?P<static>[^"]*_static/)mathjax/[^"]*"></script>')
_LINK = re.compile(r'(_static/formulas\.css\?v=)[0-9a-f]*"')
_GLYPH = re.compile(r"\.mjx-c[0-9A-F]+")
# The x-height of MathJax's TeX font is 0.442 em; a formula's should be that of its text.
_SIZE = "mjx-container { font-size: calc(1ex / 0.442); }\n"


def write(folder: Path) -> str:
    """Set the formulas of all pages in a folder that have not been set yet.

    Args:
        folder: a built book.

    Returns:
        An empty text, or why MathJax sets them in the reader's browser: then the pages are as they were.

    Raises:
        ValueError: MathJax does not understand a formula; the message names it and its page.

    Example:
        >>> write(Path("_build/html"))  # doctest: +SKIP
        ''
    """
    pages = {
        path: path.read_text(encoding="utf8")
        for path in sorted(folder.rglob("*.html"))
        if "_static" not in path.relative_to(folder).parts
    }
    unset = {path: text for path, text in pages.items() if _SCRIPT.search(text)}
    if not unset:
        return ""
    wanted = {each: str(path.relative_to(folder)) for path, text in unset.items() for each in formulas(text)}
    settings = next(iter(unset.values()))
    try:
        made, styles = set_all(list(wanted), _macros(settings))
    except NpmError as error:
        return str(error)
    for formula, result in made.items():
        if "error" in result:
            raise ValueError(f"{wanted[formula]}: {result['error']} in the formula {formula[0]}")
    pages |= {
        path: replaced(text, {each: done["html"] for each, done in made.items()})
        for path, text in unset.items()
    }
    styles = _SIZE + only_used(styles, pages.values())
    (folder / "_static" / STYLES).write_text(styles, encoding="utf8")
    version = hashlib.sha256(styles.encode()).hexdigest()[:8]
    for path, text in pages.items():
        path.write_text(_LINK.sub(rf'\g<1>{version}"', text), encoding="utf8")
    _keep_fonts_only(folder / "_static")
    return ""


def formulas(page: str) -> list[tuple[str, bool]]:
    r"""Return a page's formulas as TeX, each with whether it stands in a line of its own.

    Args:
        page: HTML that Sphinx wrote.

    Example:
        >>> formulas(r'<span class="math notranslate nohighlight">\(a &lt; b\)</span>')
        [('a < b', False)]
    """
    found = [(pattern, pattern is _DISPLAY) for pattern in (_INLINE, _DISPLAY)]
    return [
        (html.unescape(match["tex"]), display)
        for pattern, display in found
        for match in pattern.finditer(page)
    ]


def replaced(page: str, made: dict[tuple[str, bool], str]) -> str:
    r"""Return the page with its formulas set, and with a style sheet in place of MathJax's script.

    Args:
        page: HTML that Sphinx wrote.
        made: of every formula of the page its HTML.

    Example:
        >>> replaced(r'<span class="math notranslate nohighlight">\(a\)</span>', {("a", False): "<i>a</i>"})
        '<span class="math notranslate nohighlight" data-tex="a"><i>a</i></span>'
    """

    def inline(match: re.Match[str]) -> str:
        tex = html.unescape(match["tex"])
        attribute = html.escape(tex.strip())
        return f'<span class="math notranslate nohighlight" data-tex="{attribute}">{made[tex, False]}</span>'

    def display(match: re.Match[str]) -> str:
        tex = html.unescape(match["tex"])
        attribute = html.escape(tex.strip())
        return f'{match["open"]} data-tex="{attribute}">{match["before"]}{made[tex, True]}\n</div>'

    page = _DISPLAY.sub(display, _INLINE.sub(inline, page))
    static = _SCRIPT.search(page)
    page = _SCRIPT.sub("", _SETTINGS.sub("", page))
    if static is None:
        return page
    link = f'<link rel="stylesheet" type="text/css" href="{static["static"]}{STYLES}?v=" />'
    return page.replace("</head>", f"{link}\n</head>", 1)


def set_all(
    wanted: list[tuple[str, bool]], macros: dict[str, Any], cache: Path = CACHE / "formulas"
) -> tuple[dict[tuple[str, bool], dict[str, str]], str]:
    """Return of each formula its HTML or what is wrong with it, and MathJax's style sheet with all its glyphs.

    Args:
        wanted: TeX, and whether the formula stands in a line of its own.
        macros: TeX macros, as MathJax's settings have them.
        cache: where the bundled MathJax is kept.

    Raises:
        NpmError: there is no node, or npm cannot be reached.

    Example:
        >>> made, styles = set_all([("x^2", False)], {})  # doctest: +SKIP
        >>> "<mi>x</mi>" in made["x^2", False]["html"]  # doctest: +SKIP
        True
    """
    script = _mathjax(cache) / "set.js"
    asked = {
        "formulas": [{"tex": tex, "display": display} for tex, display in wanted],
        "macros": macros,
        "fonts": FONTS,
    }
    done = subprocess.run(
        [node(), script],
        input=json.dumps(asked),
        capture_output=True,
        encoding="utf8",
        check=False,
        timeout=_PATIENCE,
    )
    if done.returncode:
        raise NpmError(f"node could not set the formulas: {done.stderr.strip()[-300:]}")
    answer = json.loads(done.stdout)
    return dict(zip(wanted, answer["set"], strict=True)), answer["css"]


def only_used(styles: str, pages: Iterable[str]) -> str:
    r"""Return MathJax's style sheet without the glyphs that no page shows.

    Args:
        styles: rules, each `SELECTOR {`, declarations and `}` in lines of their own.
        pages: HTML.

    Example:
        >>> only_used(".mjx-c31 {\n  a\n}\n.mjx-c32 {\n  b\n}", ['<mjx-c class="mjx-c32"></mjx-c>'])
        '.mjx-c32 {\n  b\n}\n'
    """
    used = {f".{name}" for page in pages for name in re.findall(r"\bmjx-c[0-9A-F]+\b", page)}
    rules = re.findall(
        r"^\S[^\n]*\{\n.*?^\}", styles, re.DOTALL | re.MULTILINE
    )  # a declaration may have braces, too
    kept = [
        rule for rule in rules if not (named := set(_GLYPH.findall(rule.partition("{")[0]))) or named & used
    ]
    return "".join(rule.strip() + "\n" for rule in kept)


def _mathjax(cache: Path = CACHE / "formulas") -> Path:
    """Return the folder with the bundled MathJax and its licence."""
    return made_once(cache, [*(JS / name for name in _INPUTS), Path(__file__)], _make)


def _make(folder: Path, made: Path) -> None:
    esbuild(folder, "set.entry.js", made / "set.js", "--platform=node", "--format=cjs", "--target=node20")
    shutil.copy2(folder / "node_modules" / "mathjax-full" / "LICENSE", made)


def _macros(page: str) -> dict[str, Any]:
    """Return the TeX macros that a page gives to MathJax."""
    settings = _SETTINGS.search(page)
    macros: dict[str, Any] = json.loads(settings[1])["tex"]["macros"] if settings else {}
    return macros


def _keep_fonts_only(static: Path) -> None:
    """Remove MathJax's scripts, 15 MB, that no page asks for any more; beside the fonts stays their licence."""
    fonts, kept = static / FONTS, static / "fonts-of-formulas"
    if fonts.is_dir():
        shutil.rmtree(kept, ignore_errors=True)  # of a build that was interrupted here
        fonts.rename(kept)
        shutil.rmtree(static / "mathjax")
        fonts.parent.mkdir(parents=True)
        kept.rename(fonts)
        shutil.copy2(_mathjax() / "LICENSE", static / "mathjax")
