"""Run a student's notebook cell by cell, and write down what each grader says: `python -m … NOTEBOOK OUTPUT GIGABYTES`.

A process of its own, with a limit to its memory; `grading` ends it when its time is over. What the graders have said by
then is in the output, one JSON line each. This protects the lecturer's patience, not the machine: it is no sandbox.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path


def limit_memory(gigabytes: float) -> None:
    """Let this process allocate so much and no more, where the system can (not on Windows)."""
    try:
        import resource
    except ImportError:
        return
    size = int(gigabytes * 1e9)
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    if hard != resource.RLIM_INFINITY:  # as under `ulimit -d`: nobody may raise it
        size = min(size, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (size, size))


def main(notebook: str, output: str, gigabytes: str) -> int:
    """Run the cells in order; a cell that raises does not stop the ones after it."""
    limit_memory(float(gigabytes))
    os.environ["MPLBACKEND"] = "Agg"
    from IPython.core.interactiveshell import InteractiveShell

    from inbounds.book.exercises.judging import Judgement

    cells = json.loads(Path(notebook).read_text(encoding="utf8"))["cells"]
    os.chdir(Path(notebook).parent)
    shell = InteractiveShell.instance()
    with open(output, "a", encoding="utf8") as report:
        for number, cell in enumerate(cells):
            if cell["cell_type"] != "code":
                continue
            result = shell.run_cell("".join(cell["source"])).result
            if isinstance(result, Judgement):
                said = {"cell": number, "passed": result.passed, "message": result.message}
                print(json.dumps(said), file=report, flush=True)  # in ASCII: a line is a line
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
