"""MuJoCo's WebAssembly build and three.js, from npm, as classic scripts.

`js/package-lock.json` pins the packages and their checksums; `inbounds.book.npm` brings them and keeps what is made of
them in `.cache/live`.

The module of 10 MB is more than half debug sections: without its custom sections it is 4.5 MB, compressed 1.3 MB.
"""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Iterator
from pathlib import Path

from inbounds.book.npm import CACHE, esbuild, made_once

JS = Path(__file__).parent / "js"
_PACKAGES = ("@mujoco/mujoco", "three")
_INPUTS = ("package.json", "package-lock.json", "engine.entry.js", "three.entry.js")
_AS_CLASSIC_SCRIPT = (
    "--format=iife",
    "--platform=browser",
    "--target=es2022",
    # What MuJoCo's loader would import of node, and the address of a module, which a classic script has not.
    "--external:module",
    "--external:node:*",
    '--define:import.meta.url="file:///mujoco.js"',
)


def bundle(cache: Path = CACHE / "live") -> Path:
    """Return the folder with the packages' scripts, made now where it is missing.

    Args:
        cache: where such folders are kept.

    Raises:
        NpmError: there is no node, or npm cannot be reached.

    Example:
        >>> sorted(path.name for path in bundle().iterdir())  # doctest: +SKIP
        ['engine.js', 'licences.txt', 'three.js', 'wasm.js']
    """
    return made_once(cache, [*(JS / name for name in _INPUTS), Path(__file__)], _make)


def _make(folder: Path, made: Path) -> None:
    modules = folder / "node_modules"
    for entry in ("engine", "three"):
        esbuild(
            folder,
            f"{entry}.entry.js",
            made / f"{entry}.js",
            *_AS_CLASSIC_SCRIPT,
            f"--global-name=inbounds.live.{entry}",
        )
    (made / "wasm.js").write_text(_wasm(modules / "@mujoco" / "mujoco" / "mujoco.wasm"), encoding="ascii")
    (made / "licences.txt").write_text("\n".join(_licences(modules)), encoding="utf8")


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
