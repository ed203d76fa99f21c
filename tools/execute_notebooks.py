"""Execute notebooks from top to bottom and store their text outputs: python tools/execute_notebooks.py NOTEBOOK ...

One after another. Each is stored when it has been executed, without pictures; the first that fails ends the command,
and stays as it was.
"""

import sys
import time
from pathlib import Path

import forked_kernels
import nbformat
import notebook_hook
from nbclient import NotebookClient


def main() -> int:
    if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
        print("no notebook named: make notebooks NB=notebooks/actions_have_bounds.ipynb")
        return 2
    forked_kernels.use()
    for name in sys.argv[1:]:
        path, start = Path(name), time.perf_counter()
        notebook = nbformat.read(path, as_version=4)
        NotebookClient(notebook, timeout=300, resources={"metadata": {"path": path.parent}}).execute()
        notebook_hook.store(path, notebook_hook.text_of(notebook_hook.strip(notebook)))
        print(f"{path.name}: executed in {time.perf_counter() - start:.1f} s", flush=True)
    return notebook_hook.main(["--check", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
