"""How the book is cited, `CITATION.cff` as BibTeX, and how its repository is cloned."""

from __future__ import annotations

from pathlib import Path

import yaml

PLACEHOLDER = "your-name"
"""Stands in the repository's address until it is published."""


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


def cloning(url: str) -> list[str]:
    """Return the command that clones the repository as lines of MyST Markdown, and what to put for a placeholder.

    Args:
        url: the repository's, from `_config.yml`.

    Example:
        >>> cloning("https://github.com/somebody/in-bounds")
        ['```sh', 'git clone https://github.com/somebody/in-bounds', 'cd in-bounds', '```']
    """
    command = ["```sh", f"git clone {url}", f"cd {url.rpartition('/')[2]}", "```"]
    if PLACEHOLDER not in url.split("/"):
        return command
    remark = (
        f"`{PLACEHOLDER}` is a placeholder: this copy of the book names no public repository yet. Put the account "
        "there from which you have it; if you were given a folder or an archive, begin in that folder."
    )
    return [*command, "", remark]
