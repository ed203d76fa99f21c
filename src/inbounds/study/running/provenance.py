"""What a part of a cell ran on: kept with its numbers, because they depend on it."""

from __future__ import annotations

import functools
import hashlib
import platform
import re
import subprocess
from pathlib import Path
from typing import Any

import torch

import inbounds
from inbounds.learning.storage.run_metadata import versions

ENGINE = ("distributions", "robots", "learning")  # the rooms of the package that a cell's numbers come from


def provenance() -> dict[str, Any]:
    """Return commit, engine, versions and processor of this process, ready for JSON.

    Example:
        >>> sorted(provenance())
        ['commit', 'engine', 'processor', 'versions']
    """
    return {
        "commit": commit(),
        "engine": engine_digest(),
        "versions": dict(_versions()),
        "processor": processor(),
    }


@functools.cache
def engine_digest() -> str:
    """Return the SHA-256 of the engine's source."""
    package = Path(inbounds.__file__).parent
    digest = hashlib.sha256()
    for room in ENGINE:
        for path in sorted((package / room).rglob("*.py")):
            digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


@functools.cache
def commit() -> str:
    """Return the commit of the source tree, with + after it if the engine has changed since; else "unknown"."""
    package = Path(inbounds.__file__).parent
    try:
        # Fails in a repository in which the package merely lies, as one of an environment in somebody's project.
        _git(package, "ls-files", "--error-unmatch", "__init__.py")
        head = _git(package, "rev-parse", "HEAD")
        changed = _git(package, "status", "--porcelain", "--", *ENGINE)
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return head + ("+" if changed else "")


@functools.cache
def processor() -> str:
    """Return the processor's model, as exactly as the system tells, and the vector instructions torch uses on it."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        text = ""
    names = ("model name", "cpu family", "model", "stepping")
    found = [re.search(rf"^{name}\s*:\s*(.*)$", text, re.MULTILINE) for name in names]
    model = "/".join(match[1].strip() for match in found if match) or platform.processor()
    return f"{platform.machine()} {model} {torch.backends.cpu.get_cpu_capability()}"


_versions = functools.cache(versions)


def _git(folder: Path, *args: str) -> str:
    done = subprocess.run(["git", "-C", str(folder), *args], capture_output=True, text=True, check=True)
    return done.stdout.strip()
