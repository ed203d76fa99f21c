"""How the book is cited: `CITATION.cff` as BibTeX."""

from __future__ import annotations

from pathlib import Path

import yaml


def bibtex(cff: Path, url: str = "") -> str:
    r"""Return the entry that a citation file describes.

    Args:
        cff: a file `CITATION.cff`.
        url: the site's address, if it has one.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> with TemporaryDirectory() as folder:
        ...     cff = Path(folder, "CITATION.cff")
        ...     _ = cff.write_text("title: In Bounds\nversion: 1.2.0\nauthors: [{name: Its authors}]")
        ...     print(bibtex(cff))
        @software{inbounds,
          title = {{In Bounds}},
          author = {{Its authors}},
          version = {1.2.0},
        }
    """
    cited = yaml.safe_load(cff.read_text(encoding="utf8"))
    names = [
        each.get("name") or f"{each['family-names']}, {each['given-names']}" for each in cited["authors"]
    ]
    fields = {
        "title": f"{{{cited['title']}}}",  # keeps its capitals
        "author": " and ".join(f"{{{name}}}" for name in names),
        "version": str(cited["version"]),
        "year": str(cited["date-released"])[:4] if "date-released" in cited else "",
        "url": url,
    }
    lines = [f"  {name} = {{{value}}}," for name, value in fields.items() if value]
    return "\n".join(["@software{inbounds,", *lines, "}"])
