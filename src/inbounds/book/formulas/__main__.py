"""Set the formulas of a built book: `python -m inbounds.book.formulas FOLDER`."""

import argparse
from pathlib import Path

from inbounds.book.formulas import write

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="the built book, such as _build/html")
    folder = parser.parse_args().folder
    if not (folder / "_static").is_dir():
        parser.error(f"{folder} is no built book: it has no _static")
    if why := write(folder):
        print(f"The formulas: MathJax sets them in the browser. {why}")
