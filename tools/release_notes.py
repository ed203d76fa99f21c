"""Print a version's section of the change log, or say what a release still lacks.

    python tools/release_notes.py v1.0.0    as the release workflow calls it: refuses what is not ready

Ready is: the tag is the package's version, CHANGELOG.md has that version with a date, and the address of the
repository is no longer the placeholder.
"""

import argparse
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PLACEHOLDER = "your-name"
"""Of the repository's address in _config.yml and pyproject.toml, until somebody publishes it."""


def section(notes: str, version: str) -> str:
    """Return what the change log says of a version, without its heading.

    Raises:
        ValueError: it says nothing.
    """
    found = re.search(rf"^## \[{re.escape(version)}\][^\n]*\n(.*?)(?=^## |\Z)", notes, re.M | re.S)
    if found is None or not found[1].strip():
        raise ValueError(f"CHANGELOG.md has no section [{version}]")
    return found[1].strip()


def missing(tag: str, version: str, url: str, notes: str) -> list[str]:
    """Return what a release lacks, a sentence each."""
    lacks = []
    if tag != f"v{version}":
        lacks.append(f"the tag is {tag}, the version {version}")
    if f"/{PLACEHOLDER}/" in url:
        lacks.append(f"{url} is a placeholder: give your repository in _config.yml and pyproject.toml")
    try:
        section(notes, version)
    except ValueError as error:
        lacks.append(str(error))
    else:
        if not re.search(rf"^## \[{re.escape(version)}\] - \d{{4}}-\d\d-\d\d$", notes, re.M):
            lacks.append(f"CHANGELOG.md gives no date to [{version}]")
    return lacks


def read(name: str, pattern: str) -> str:
    """Return what a pattern finds in a file: this runs before anything is installed."""
    (found,) = re.findall(pattern, (ROOT / name).read_text(encoding="utf8"), re.M)
    return str(found)


def main(arguments: list[str]) -> int:
    """Print the notes of a tag; say on stderr why it cannot be released."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("tag")
    tag = parser.parse_args(arguments).tag
    version = read("src/inbounds/__init__.py", r'^__version__ = "([^"]+)"')
    url = read("pyproject.toml", r'^Repository = "([^"]+)"')
    notes = (ROOT / "CHANGELOG.md").read_text(encoding="utf8")
    if lacks := missing(tag, version, url, notes):
        print("Not to be released:", *lacks, sep="\n- ", file=sys.stderr)
        return 1
    print(section(notes, version))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
