"""`make test`: pytest on the package and the book, nbval on the notebooks; one summary, non-zero on any failure.

    python tools/run_tests.py                   everything but the browser and the mutants
    python tools/run_tests.py --quick           neither notebooks nor slow tests
    python tools/run_tests.py --mutants         is each planted error noticed by the test that claims to notice it
    python tools/run_tests.py NOTEBOOK ...      nbval on these notebooks only
    python tools/run_tests.py --cell-timeout 30 NOTEBOOK ...    and no cell may take longer than that [s]
    python tools/run_tests.py --other-processor NOTEBOOK ...    does it hold where numbers are rounded otherwise?

A notebook that the book has executed (`make book`), or will, is executed once: nbval compares what the book's cache
has of it (`notebook_cache.py`). NOTEBOOKs that are named are executed here and now.

The rest is one session, so that no worker is without work as long as another has a file to spare. A test that was
skipped or expected to fail did not pass: nbval marks the cells after a dead kernel as expected failures, and would
otherwise end in green. Only two kinds may be left out: the live robot's tests, where npm cannot be reached (the book
is built without it there, too), and those of a GPU, where there is none.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections import Counter
from pathlib import Path

import notebook_cache

ROOT = notebook_cache.ROOT
# Each takes up to 1.5 GB. Three also where there are two cores: tests wait for processes that they start.
WORKERS = max(3, min(4, os.cpu_count() or 1))
PARALLEL = ["-n", str(WORKERS), "--dist", "loadscope", "--no-loadscope-reorder", "-p", "tests.longest_first"]
HERE = "not pages and not mutants"
"""The other tests have a target of their own: `make pages`, `make mutants`."""
# Part of a test's reason to be skipped, as `tests/book/live/conftest.py` and `test_on_a_gpu.py` give it → what the
# summary says of all such tests.
MAY_SKIP = {
    "the live robot is not tested here": "npm cannot be reached: {} tests of the live robot were left out",
    "needs a GPU that torch can use": "torch finds no GPU: {} tests of one were left out",
}
# `-p tests.nbval_rules` says which outputs are compared; warnings inside a notebook reach it through stderr.
NBVAL = ["-p", "tests.nbval_rules", "--nbval"]
# Runs of a robot part where one number is rounded otherwise, as PyTorch, MKL and OpenBLAS do it without vector units.
OLD_PROCESSOR = {"ATEN_CPU_CAPABILITY": "default", "MKL_CBWR": "COMPATIBLE", "OPENBLAS_CORETYPE": "Nehalem"}


def run(arguments: list[str], expected: set[str]) -> int:
    """Run pytest, print its own record of the outcome by kind of test, and return the number of tests not passed."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / "record.xml"
        command = [sys.executable, "-m", "pytest", "-q", "-o", "xfail_strict=true", f"--junitxml={record}"]
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        status = subprocess.run(
            [*command, "-p", "tests.temporary", *arguments], cwd=ROOT, env=environment, check=False
        ).returncode
        cases = list(ElementTree.parse(record).getroot().iter("testcase")) if record.exists() else []
    passed: Counter[str] = Counter()
    failed: Counter[str] = Counter()
    left_out: Counter[str] = Counter()
    for case in cases:
        skipped = case.find("skipped")
        why = "" if skipped is None else skipped.get("message", "")
        if allowed := [reason for reason in MAY_SKIP if reason in why]:
            left_out[allowed[0]] += 1
            continue
        outcomes = (
            failed if any(case.find(how) is not None for how in ("failure", "error", "skipped")) else passed
        )
        outcomes[kind(case)] += 1
    print("\n── summary")
    for reason, count in left_out.items():
        print(MAY_SKIP[reason].format(count))
    for each in sorted(expected):
        print(f"{each}: {passed[each]} passed, {failed[each]} failed")
    print(f"longest: {', '.join(f'{name} {seconds:.0f} s' for name, seconds in longest(cases))}")
    print(f"in {time.perf_counter() - start:.0f} s", flush=True)
    missing = sum(not passed[each] for each in expected)
    return sum(failed.values()) + missing + (status != 0)  # nothing collected, or pytest itself failed


def longest(cases: list[ElementTree.Element], count: int = 5) -> list[tuple[str, float]]:
    """Return the files whose tests took the most time together, all workers counted, the longest first."""
    seconds: Counter[str] = Counter()
    for case in cases:
        seconds[case.get("classname", "")] += float(case.get("time", 0))
    return seconds.most_common(count)


def kind(case: ElementTree.Element) -> str:
    """Return whether a test case is a cell of a notebook."""
    return "notebooks" if case.get("classname", "").endswith(".ipynb") else "package and book"


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("notebooks", nargs="*", metavar="NOTEBOOK")
    parser.add_argument(
        "--other-processor",
        action="store_true",
        help="compute as a processor of 2009 does: a claim of a small run should hold there, too",
    )
    parser.add_argument("--quick", action="store_true", help="neither notebooks nor slow tests")
    parser.add_argument(
        "--mutants", action="store_true", help="only: is each planted error noticed by its test"
    )
    parser.add_argument(
        "--cell-timeout",
        type=int,
        default=240,
        metavar="SECONDS",
        help="after which a cell of a notebook fails",
    )
    options = parser.parse_args()
    if options.other_processor:
        os.environ.update(OLD_PROCESSOR)
    nbval = [*NBVAL, f"--nbval-cell-timeout={options.cell_timeout}"]
    if options.quick:
        bad = run(["-m", f"{HERE} and not slow", *PARALLEL, "tests"], {"package and book"})
    elif options.mutants:
        workers = ["-n", str(WORKERS), "--dist", "load"]  # one file, which every worker has a part of
        bad = run(["-m", "mutants", *workers, "tests/test_mutants.py"], {"package and book"})
    elif options.notebooks:
        several = PARALLEL if len(options.notebooks) > 1 else []
        bad = run([*nbval, *several, *options.notebooks], {"notebooks"})
    else:
        notebooks = [str(path) for path in sorted((ROOT / "notebooks").glob("*.ipynb"))]
        notebooks.append("tools/chapter_template.ipynb")
        executed = notebook_cache.fill(notebook_cache.digest(*notebook_cache.CODE))
        everything = ["-m", HERE, *nbval, f"--executed={executed}", *PARALLEL, *notebooks, "tests"]
        bad = run(everything, {"notebooks", "package and book"})
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
