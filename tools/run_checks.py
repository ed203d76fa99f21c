"""`make check`: format, lint, types, doctests, stored notebooks, budgets. Runs them all, then says which failed.

python tools/run_checks.py                   all six, two at a time
python tools/run_checks.py format lint       some
"""

import argparse
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CHECKS = {
    "format": ["ruff", "format", "--check", "."],
    "lint": ["ruff", "check", "."],
    "types": ["mypy"],
    "doctests": ["pytest", "-q", "-p", "tests.temporary", "--doctest-modules", "src/inbounds", "benchmarks"],
    "notebooks": ["tools/notebook_hook.py", "--check"],
    "budgets": ["tools/count_pages.py"],
}


def run(name: str) -> subprocess.CompletedProcess:
    """Run one check, and keep what it says."""
    tool, *arguments = CHECKS[name]
    command = [sys.executable, tool] if tool.endswith(".py") else [sys.executable, "-m", tool]
    return subprocess.run(
        [*command, *arguments],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="CHECK", help=f"some of: {', '.join(CHECKS)}")
    names = parser.parse_args().names or list(CHECKS)
    if unknown := set(names) - set(CHECKS):
        parser.error(f"no such check: {', '.join(sorted(unknown))} (there are {', '.join(CHECKS)})")
    failed = []
    with ThreadPoolExecutor(2) as pool:
        for name, done in zip(names, pool.map(run, names), strict=True):
            print(f"── {name}", done.stdout.strip(), sep="\n", flush=True)
            if done.returncode:
                failed.append(name)
    print(f"checks: {len(names) - len(failed)} passed, {len(failed)} failed", *failed)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
