"""`make check`: format, lint, types, doctests, stored notebooks. Runs them all, then says which failed."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CHECKS = {
    "format": ["ruff", "format", "--check", "."],
    "lint": ["ruff", "check", "."],
    "types": ["mypy"],
    "doctests": ["pytest", "-q", "--doctest-modules", "src/inbounds", "benchmarks"],
    "notebooks": ["tools/notebook_hook.py", "--check"],
}


def main() -> int:
    failed = []
    for name, (tool, *arguments) in CHECKS.items():
        print(f"── {name}", flush=True)
        command = [sys.executable, tool] if tool.endswith(".py") else [sys.executable, "-m", tool]
        if subprocess.run([*command, *arguments], cwd=ROOT, check=False).returncode:
            failed.append(name)
    print(f"checks: {len(CHECKS) - len(failed)} passed, {len(failed)} failed", *failed)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
