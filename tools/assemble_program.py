"""Assemble the programs of the chapters, each one file that runs without the package.

    python tools/assemble_program.py FOLDER            every chapter that has one
    python tools/assemble_program.py FOLDER NAME ...   some chapters

The book's extension does the same when the book is built: the files lie in `_static/programs`.
"""

import argparse
import sys
from pathlib import Path

from inbounds.book.pages.programs import assemble, has_program

NOTEBOOKS = Path(__file__).resolve().parents[1] / "notebooks"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME", help="of chapters, without their ending")
    options = parser.parse_args(arguments)
    options.folder.mkdir(parents=True, exist_ok=True)
    names = options.names or sorted(path.stem for path in NOTEBOOKS.glob("*.ipynb") if has_program(path))
    for name in names:
        target = options.folder / f"{name}.py"
        target.write_text(assemble(NOTEBOOKS / f"{name}.ipynb"), encoding="utf8")
        print(target)
    return 0


if __name__ == "__main__":
    sys.exit(main())
