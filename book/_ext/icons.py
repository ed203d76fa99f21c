"""Icons without a library: the theme's script of 1.5 MB goes, and of its font the glyphs in use stay.

The theme carries FontAwesome twice: as a script with every icon, which each page loads, and as a font with a rule for
each icon in its style sheet. The font does for a dozen icons. fontTools, which Matplotlib brings, takes them out of it.
"""

import re
from pathlib import Path
from typing import Any

import pydata_sphinx_theme
from fontTools import subset
from fontTools.ttLib import TTFont
from sphinx.application import Sphinx

SCRIPT = re.compile(r'\s*<script defer src="[^"]*_static/scripts/fontawesome\.js[^"]*"></script>')
FONTS = "_static/vendor/fontawesome/webfonts"
STYLES = "_static/styles/pydata-sphinx-theme.css"
FULL = (
    Path(pydata_sphinx_theme.__file__).parent
    / "theme/pydata_sphinx_theme/static/vendor/fontawesome/webfonts/fa-solid-900.ttf"
)
# A rule of the style sheet: the names of an icon, and its code point.
RULE = re.compile(r'((?:\.fa-[\w-]+::?before,?)+)\{content:"\\([0-9a-f]+)"\}')
UNUSED = (f"{FONTS}/*.woff2", f"{FONTS}/*.ttf", "_static/scripts/fontawesome.js*")
SOURCES = re.compile(r"src:url\((\.\./vendor/fontawesome/webfonts/fa-solid-900)\.woff2\)[^;}]*")


def in_use(html: Path) -> set[int]:
    """Return the code points of the icons that pages, style sheets and scripts of a built book name."""
    styles = (html / STYLES).read_text(encoding="utf8")
    points = {
        name: point
        for names, point in re.findall(RULE, styles)
        for name in re.findall(r"\.(fa-[\w-]+)", names)
    }
    texts = [path.read_text(encoding="utf8") for path in html.rglob("*.html")]
    texts += [path.read_text(encoding="utf8") for path in (html / "_static/scripts").glob("*theme.js")]
    named = {name for text in texts for name in re.findall(r"\bfa-[\w-]+", text)}
    found = {int(points[name], 16) for name in named & points.keys()}
    # Style sheets name glyphs of their own, by number: those of admonitions and of the theme's folds.
    sheets = [styles] + [
        path.read_text(encoding="utf8")
        for path in html.glob("_static/**/*.css")
        if path.name != Path(STYLES).name
    ]
    rules = re.sub(r"\.fa-[^{}]*\{[^}]*\}", "", "".join(sheets))
    return (
        found
        | {int(point, 16) for point in re.findall(r'["\\]\\?(f[0-9a-f]{3})"', rules)}
        | {ord(char) for char in re.findall("[\uf000-\uf8ff]", rules)}
    )


def keep_what_is_used(app: Sphinx, exception: Exception | None) -> None:
    """Take the script out of every page, and the unused glyphs out of the font."""
    if exception is not None or app.builder.name != "html":
        return
    html = Path(app.outdir)
    for page in html.rglob("*.html"):
        text = page.read_text(encoding="utf8")
        if (without := SCRIPT.sub("", text)) != text:
            page.write_text(without, encoding="utf8")
    for pattern in UNUSED:
        for path in html.glob(pattern):
            path.unlink()
    options = subset.Options(flavor="woff", notdef_outline=True, layout_features=[])
    font = subset.Subsetter(options)
    font.populate(unicodes=in_use(html))
    with TTFont(FULL) as glyphs:
        font.subset(glyphs)
        glyphs.flavor = "woff"
        glyphs.save(html / FONTS / "fa-solid-900.woff")
    styles = html / STYLES
    text = styles.read_text(encoding="utf8")
    styles.write_text(SOURCES.sub(r'src:url(\1.woff) format("woff")', text), encoding="utf8")


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the handler (called by Sphinx)."""
    app.connect("build-finished", keep_what_is_used, priority=900)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
