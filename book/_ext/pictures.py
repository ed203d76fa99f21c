"""Films and pictures come when they are near: a page arrives without them, and has room for them.

* A cell carries its films, and some of its pictures, in its HTML, so that a notebook needs no other file. In the book
  they are files of their own.
* Every picture says its size, so that nothing moves when it comes, and comes when the reader is near; a film comes when
  it is played, and its poster stands there until then.
"""

import base64
import hashlib
import re
import urllib.parse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from docutils import nodes
from PIL import Image
from sphinx.application import Sphinx

FOLDER = "_images"  # where Sphinx has the figures
ENDINGS = {"video/mp4": "mp4", "image/jpeg": "jpg", "image/png": "png", "image/svg+xml": "svg"}
KINDS = "|".join(map(re.escape, ENDINGS))
CARRIED = re.compile(
    rf'(?P<attribute>\b(?:src|srcset|poster)=)"data:(?P<kind>{KINDS})(?P<base64>;base64)?,(?P<data>[^"]*)"'
)
TAG = re.compile(r"<(?P<name>img|source)\b(?P<said>[^>]*?)(?P<end>\s*/?>)")
ADDRESS = re.compile(r'\bsrc(?:set)?="(?P<address>[^":]+\.(?:png|jpg|svg))"')
NARROW = re.compile(
    r'(<figure class="inbounds-figure">)<source (srcset="[^"]*")>(.*?)(<img\b[^>]*>)', re.DOTALL
)
"""A figure that has another shape for a phone, as `layers` leaves it."""
PHONE = "(max-width: 30rem)"  # as in book.css
WIDTH = re.compile(r'\swidth="(?P<pixels>\d+)(px)?"')
SIZES = re.compile(r"""\s(?P<side>width|height)=["'](?P<length>[\d.]+)(?P<unit>pt|px)?["']""")
PIXELS = {"pt": 4 / 3, "px": 1.0, None: 1.0}  # in a unit of length


def bring_when_near(
    app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Give a page's films and pictures files of their own, and its pictures a size."""
    if app.builder.format == "html" and context.get("body"):
        html = Path(app.outdir)
        body = NARROW.sub(rf'\1\3<picture><source media="{PHONE}" \2>\4</picture>', context["body"])
        body = write_files(body, html / FOLDER, context["pathto"](FOLDER, 1))
        # Sphinx copies a page's figures when all pages are written.
        later = {
            html / FOLDER / name: Path(app.srcdir, source) for source, name in app.builder.images.items()
        }
        body = make_room(body, (html / pagename).parent, later)
        context["body"] = body.replace(' preload="metadata"', ' preload="none"')


def write_files(body: str, folder: Path, address: str) -> str:
    """Write what a page carries to files, each named by a digest of its content; return the page with their addresses.

    Args:
        body: HTML of the page.
        folder: in which the files are written.
        address: of that folder, from the page.
    """

    def file(found: re.Match[str]) -> str:
        data = found["data"]
        content = base64.b64decode(data) if found["base64"] else urllib.parse.unquote(data).encode()
        name = f"{hashlib.sha256(content).hexdigest()[:20]}.{ENDINGS[found['kind']]}"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
        return f'{found["attribute"]}"{address}/{name}"'

    return CARRIED.sub(file, body)


def make_room(body: str, folder: Path, later: Mapping[Path, Path]) -> str:
    """Return a page whose pictures come when they are near, into room of their size.

    Args:
        body: HTML of the page.
        folder: that of the page, for the addresses of its pictures.
        later: for pictures that are still to come, where they are now.
    """

    def tag(found: re.Match[str]) -> str:
        name, said = found["name"], found["said"]
        if name == "img" and " loading=" not in said:
            said += ' loading="lazy"'
        source = ADDRESS.search(said)
        # Not every folder is there yet: what leads up and down again is worked out on paper.
        file = (folder / source["address"]).resolve() if source else None
        file = later.get(file, file) if file else None
        if file is not None and file.is_file() and " height=" not in said:
            width, height = size(file)
            given = WIDTH.search(said)
            shown = int(given["pixels"]) if given else round(width)
            said += ("" if given else f' width="{shown}"') + f' height="{round(shown * height / width)}"'
        return f"<{name}{said}{found['end']}"

    return TAG.sub(tag, body)


def size(file: Path) -> tuple[float, float]:
    """Return width and height of a picture, in pixels.

    Raises:
        ValueError: an SVG that does not say them.
    """
    if file.suffix == ".svg":
        head = file.read_text(encoding="utf8").partition("<svg")[2].partition(">")[0]
        sides = {each["side"]: float(each["length"]) * PIXELS[each["unit"]] for each in SIZES.finditer(head)}
        if len(sides) < 2:
            raise ValueError(f"{file}: an SVG needs width and height, in pt or px, for its room on a page")
        return sides["width"], sides["height"]
    with Image.open(file) as picture:
        return picture.size


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the handler (called by Sphinx)."""
    app.connect("html-page-context", bring_when_near, priority=940)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
