"""Set the formulas of a built book: `python -m inbounds.book.formulas FOLDER`."""

import sys
from pathlib import Path

from inbounds.book.formulas import write

if __name__ == "__main__" and (why := write(Path(sys.argv[1]))):
    print(f"The formulas: MathJax sets them in the browser. {why}")
