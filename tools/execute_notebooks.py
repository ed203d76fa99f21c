"""Execute notebooks from top to bottom and store their text outputs: python tools/execute_notebooks.py NOTEBOOK ..."""

import subprocess
import sys
import time
from pathlib import Path

import forked_kernels
import nbformat
from nbclient import NotebookClient

HOOK = Path(__file__).with_name("notebook_hook.py")


def main() -> int:
    if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
        print("no notebook named: make notebooks NB=notebooks/actions_have_bounds.ipynb")
        return 2
    forked_kernels.use()
    for name in sys.argv[1:]:
        path, start = Path(name), time.perf_counter()
        notebook = nbformat.read(path, as_version=4)
        NotebookClient(notebook, timeout=300, resources={"metadata": {"path": path.parent}}).execute()
        nbformat.write(notebook, path)
        print(f"{path.name}: executed in {time.perf_counter() - start:.1f} s", flush=True)
    return subprocess.run([sys.executable, HOOK, "--write", *sys.argv[1:]], check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
