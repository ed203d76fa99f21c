"""Build the wheel and the sdist, install one of them alone in a bare environment, and look at what a stranger gets.

    python tools/check_package.py [--extra NAME] [--sdist] [--dist FOLDER]

Bare is a virtual environment with the package, its dependencies, and those of one extra. Checked: the version, the
marker of types, imports without a warning whose own time is below half a second, the README's snippet.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ROOMS = (
    "inbounds",
    "inbounds.distributions",
    "inbounds.robots",
    "inbounds.learning",
    "inbounds.study",
    "inbounds.cli",
)
COMMANDS = ("", "train", "watch", "study", "doctor", "grade")
MOST = 0.5
"""Seconds of processor time that the package's own modules may take in an import, others' not counted."""
EXTRAS = {
    "cluster": "distributed",
    "fast": "numba",
    "integrations": "torchrl",
    "report": "jinja2",
    "tensorboard": "tensorboard",
    "video": "mediapy",
}
"""Extra → a module that it brings."""


def run(*command: str, folder: Path) -> str:
    """Run a command where the source tree is out of reach; return what it says, and stop where it fails."""
    environ = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(command, cwd=folder, env=environ, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")
    return done.stdout + done.stderr


def own_time(report: str) -> float:
    """Seconds that the package's modules take themselves, of what ``-X importtime`` reports."""
    lines = re.findall(r"import time:\s+(\d+) \|\s+\d+ \|\s+(\S+)", report)
    return (
        sum(int(microseconds) for microseconds, name in lines if name.partition(".")[0] == "inbounds") / 1e6
    )


def snippet() -> str:
    """The README's Python."""
    (found,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf8"), re.DOTALL)
    return str(found)


def check(python: Path, folder: Path, extra: str) -> None:
    """Look at an installed package."""
    (version,) = re.findall(
        r'^__version__ = "([^"]+)"', (ROOT / "src/inbounds/__init__.py").read_text(), re.M
    )
    assert run(str(python.with_name("inbounds")), "--version", folder=folder).strip() == f"inbounds {version}"
    where = "import inbounds, pathlib; print(pathlib.Path(inbounds.__file__).with_name('py.typed').exists())"
    assert run(str(python), "-c", where, folder=folder).strip() == "True"
    for room in ROOMS:
        took = own_time(
            run(str(python), "-W", "error", "-X", "importtime", "-c", f"import {room}", folder=folder)
        )
        print(f"import {room}: {took:.3f} s of its own")
        assert took < MOST
    for command in COMMANDS:
        run(str(python), "-W", "error", "-m", "inbounds", *command.split(), "--help", folder=folder)
    run(str(python), "-W", "error", "-c", snippet(), folder=folder)
    shown = run(
        str(python),
        "-c",
        "import importlib.metadata as m; print(m.metadata('inbounds')['Description'])",
        folder=folder,
    )
    assert "](" in shown
    assert re.findall(r"\]\((?!https:)[^)]*\)", shown) == [], "the README's links lead nowhere on PyPI"
    for name, module in EXTRAS.items():
        found = f"import importlib.util as u; print(u.find_spec({module!r}) is not None)"
        here = run(str(python), "-c", found, folder=folder).strip() == "True"
        assert here or name != extra, f"the extra {name} does not bring {module}"


def main() -> None:
    """Build, install, check."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--extra", default="", choices=["", *EXTRAS])
    parser.add_argument("--sdist", action="store_true", help="install from the sdist instead of the wheel")
    parser.add_argument("--dist", type=Path, help="keep what was built there")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run(sys.executable, "-m", "venv", "bare", folder=folder)
        python = folder / "bare" / "bin" / "python"
        run(sys.executable, "-m", "venv", "builder", folder=folder)
        builder = folder / "builder" / "bin" / "python"
        needs = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf8"))["build-system"][
            "requires"
        ]
        run(str(builder), "-m", "pip", "install", "-q", *needs, folder=folder)
        # from the source tree, but into this folder
        done = subprocess.run(
            [str(builder), "-m", "hatchling", "build", "-d", str(folder / "dist")], cwd=ROOT, check=False
        )
        assert done.returncode == 0
        (built,) = (folder / "dist").glob("*.tar.gz" if options.sdist else "*.whl")
        print(f"{built.name}: {built.stat().st_size / 1e6:.1f} MB")
        target = f"{built}[{options.extra}]" if options.extra else str(built)
        run(str(python), "-m", "pip", "install", "-q", target, folder=folder)
        check(python, folder, options.extra)
        if options.dist:
            shutil.copytree(folder / "dist", options.dist, dirs_exist_ok=True)
    print("a stranger gets what the README promises")


if __name__ == "__main__":
    main()
