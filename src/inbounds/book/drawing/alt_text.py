"""Figures on a page, each with the text that a reader hears who cannot see it.

`show` displays a figure and puts its alt text into the output's metadata, where nbconvert looks for it. MyST-NB,
which builds the book, learns to look there from `AltTextRenderer`; the package registers that under the entry
point `myst_nb.mime_renderers`.
"""

from __future__ import annotations

import base64
import io
import re
import urllib.parse
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from inbounds.book.building import builds_the_book
from inbounds.book.drawing.narrow import rearrange, titles_and_labels, visible, within

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PIXELS_PER_INCH = 100
"""CSS pixels that one inch of a figure takes up on the page; the image itself is twice as fine."""

LONGEST_DRAWING = 200_000
"""Characters of SVG up to which a figure is a drawing on a page of the book; one of very many points is a picture."""


def png_bytes(fig: Figure, *, pixel_ratio: float = 2.0) -> bytes:
    """Return a figure as PNG, the same bytes for the same figure (no date, no version in the file)."""
    buffer = io.BytesIO()
    fig.savefig(buffer, format="png", dpi=PIXELS_PER_INCH * pixel_ratio, metadata={"Software": None})
    return buffer.getvalue()


def svg_bytes(fig: Figure) -> bytes:
    """Return a figure as SVG, its text as outlines, the same bytes for the same figure."""
    import matplotlib as mpl

    buffer = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "inbounds", "svg.fonttype": "path"}):
        fig.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return buffer.getvalue()


def short_svg(fig: Figure) -> str:
    """Return a figure as SVG with places to a hundredth of a point, which no eye can tell apart."""
    svg = svg_bytes(fig).decode("utf-8")
    svg = re.sub(r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    places = re.compile(r'\b(?:d|x|y)="[^"]*"|translate\([^)]*\)')
    svg = places.sub(lambda where: re.sub(r"-?\d+\.\d{3,}", _in_hundredths, where[0]), svg)
    svg = re.sub(r"\s+", " ", svg)
    svg = re.sub(r'\bd="[^"]*"', lambda path: re.sub(r" ?([A-Zz]) ?", r"\1", path[0]), svg).replace('"', "'")
    return svg.strip()


def svg_uri(fig: Figure) -> str:
    """Return a figure as the address of an SVG.

    Written out, not in base64: that is a quarter less, and a server's compression makes less than half of it.
    """
    address = urllib.parse.quote(short_svg(fig), safe=_SAFE)
    address = address.replace("://", ":%2F%2F")  # no page seems to ask elsewhere
    return f"data:image/svg+xml,{address}"


_SAFE = " '()*+,-./:;=?@_"
"""What an address may have as it is, inside double quotes."""


def _in_hundredths(number: re.Match[str]) -> str:
    return f"{float(number[0]):.2f}".rstrip("0").rstrip(".")


def _with_few_colors(png: bytes, colors: int) -> bytes:
    from PIL import Image

    buffer = io.BytesIO()
    image = Image.open(io.BytesIO(png)).convert("RGB")
    image.quantize(colors, dither=Image.Dither.NONE).save(buffer, format="png", optimize=True)
    return buffer.getvalue()


def last_picture(fig: Figure, alt: str, *, colors: int = 0) -> tuple[str, int]:
    """Close a figure, and return its PNG in base64 and its width in CSS pixels.

    Args:
        fig: the figure.
        alt: what it shows.
        colors: at most so many in the picture; 0 is as many as it has.

    Raises:
        ValueError: the alt text says less than a sentence would, or, in the book's build, a label is cut off at the
            figure's edge.
    """
    import matplotlib.pyplot as plt

    _require_a_page(fig, alt)
    drawn = png_bytes(fig)
    png = base64.b64encode(_with_few_colors(drawn, colors) if colors else drawn).decode("ascii")
    plt.close(fig)
    return png, _pixels(fig)


def _pixels(fig: Figure) -> int:
    """Return a figure's width in CSS pixels."""
    return round(fig.get_size_inches()[0] * PIXELS_PER_INCH)


def _require_a_page(fig: Figure, alt: str) -> None:
    """Raise ValueError where a figure's alt text says too little, or, in the book's build, a label is cut off."""
    if len(alt.split()) < 4:
        raise ValueError(
            f"alt text {alt!r} is too short: say in a sentence what is plotted and what it shows"
        )
    if builds_the_book() and (cut := _cut_off(fig)):
        raise ValueError(
            f"cut off at the figure's edge: {'; '.join(cut)}. Shorten the text, or break its line"
        )


def _cut_off(fig: Figure) -> list[str]:
    """Return which titles and labels of a figure reach beyond its edge."""
    fig.draw_without_rendering()
    return [repr(text.get_text()) for text in visible(titles_and_labels(fig)) if not within(fig, text)]


def show(fig: Figure, alt: str) -> None:
    """Put a figure on the page with its alt text, and close it: in the book a drawing, which stays sharp at any size.

    The stored notebook keeps the alt text as the output's plain text, so a reader without pictures, and the
    test that compares outputs, see what the figure claims.

    Args:
        fig: The figure.
        alt: What a reader who cannot see the figure needs to know: what is plotted and what it shows.
            Numbers that vary from machine to machine have no place in it.

    Raises:
        ValueError: If the alt text says less than a sentence would, or, in the book's build, a label is cut off at
            the figure's edge.

    Example:
        >>> import matplotlib.pyplot as plt
        >>> show(plt.figure(), alt="A figure.")
        Traceback (most recent call last):
        ValueError: alt text 'A figure.' is too short: say in a sentence what is plotted and what it shows
    """
    from IPython.display import display

    alt = " ".join(alt.split())
    kind, picture, more = "image/png", "", {}
    if builds_the_book():
        _require_a_page(fig, alt)
        picture, width = short_svg(fig), _pixels(fig)
    if 0 < len(picture) <= LONGEST_DRAWING:
        kind, more = "image/svg+xml", {"narrow": last_narrow(fig)}
    else:
        picture, width = last_picture(fig, alt)
    display(
        {kind: picture, "text/plain": f"Figure: {alt}"},
        metadata={kind: {"alt": alt, "width": width, **more}},
        raw=True,
    )


def last_narrow(fig: Figure) -> str:
    """Close a figure, and return it in the shape of a phone, as the address of an SVG; "" where that has none."""
    import matplotlib.pyplot as plt

    address = svg_uri(fig) if rearrange(fig) else ""
    plt.close(fig)
    return address


class AltTextRenderer:
    """MyST-NB plugin: an image output's `alt` metadata becomes the `alt` of the page's `<img>`, which is marked.

    MyST-NB 1.4 takes width and height from an output's metadata, but not the alt text (``NbElementRenderer.
    render_image``). It asks plugins first, so this one lets it render the image and adds what is missing.
    """

    mime_priority_overrides: ClassVar[Sequence[tuple[str, str, int | None]]] = ()

    @staticmethod
    def handle_mime(renderer: Any, data: Any, inline: bool) -> list[Any] | None:
        """Render an image that carries alt text; leave every other output to MyST-NB (None)."""
        alt = data.output_metadata.get(data.mime_type, {}).get("alt")
        if alt is None or not data.mime_type.startswith("image/"):
            return None
        rendered: list[Any] = renderer.render_image_inline(data) if inline else renderer.render_image(data)
        for node in rendered:
            node["alt"] = alt
            node["narrow"] = data.output_metadata[data.mime_type].get("narrow", "")
            node["classes"].append("inbounds-figure")  # book/_ext/layers.py numbers these
        return rendered
