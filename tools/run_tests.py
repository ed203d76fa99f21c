"""`make test`: pytest on the package and the book, then nbval on the notebooks; one summary, non-zero on any failure.

    python tools/run_tests.py [NOTEBOOK ...]    with notebooks named, only nbval on those
    python tools/run_tests.py --cell-timeout 30 NOTEBOOK ...    and no cell may take longer than that [s]

A test that was skipped or expected to fail did not pass: nbval marks the cells after a dead kernel as expected
failures, and would otherwise end in green.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PARALLEL = ["-n", "2", "--dist", "loadscope"]
PACKAGE = ["-m", "not pages", *PARALLEL, "tests"]
# `-p tests.nbval_rules` says which outputs are compared; warnings inside a notebook reach it through stderr.
NOTEBOOKS = ["-p", "tests.nbval_rules", "--nbval", *PARALLEL]


def run(label: str, arguments: list[str]) -> tuple[str, int]:
    """Run pytest, read its own record of the outcome, and return one line and the number of tests not passed."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / "record.xml"
        command = [sys.executable, "-m", "pytest", "-q", "-o", "xfail_strict=true", f"--junitxml={record}"]
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        status = subprocess.run([*command, *arguments], cwd=ROOT, env=environment, check=False).returncode
        suites = ElementTree.parse(record).getroot().iter("testsuite") if record.exists() else []
        counts = [
            {key: int(suite.get(key, 0)) for key in ("tests", "failures", "errors", "skipped")}
            for suite in suites
        ]
    total = {key: sum(count[key] for count in counts) for key in ("tests", "failures", "errors", "skipped")}
    bad = total["failures"] + total["errors"] + total["skipped"]
    if total["tests"] == 0 or (status and not bad):
        bad += 1  # nothing collected, or pytest itself failed
    line = f"{label}: {total['tests'] - bad if bad <= total['tests'] else 0} passed, {bad} failed"
    return f"{line}  ({time.perf_counter() - start:.0f} s)", bad


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("notebooks", nargs="*", metavar="NOTEBOOK")
    parser.add_argument(
        "--cell-timeout",
        type=int,
        default=240,
        metavar="SECONDS",
        help="after which a cell of a notebook fails",
    )
    options = parser.parse_args()
    named = options.notebooks
    notebooks = named or sorted(str(path) for path in (ROOT / "notebooks").glob("*.ipynb"))
    outcomes = [] if named else [run("package and book", PACKAGE)]
    outcomes.append(
        run("notebooks", [*NOTEBOOKS, f"--nbval-cell-timeout={options.cell_timeout}", *notebooks])
    )
    print("\n── summary", *(line for line, _ in outcomes), sep="\n")
    return 1 if any(bad for _, bad in outcomes) else 0


if __name__ == "__main__":
    sys.exit(main())
