"""One process per cell: a claim is a file that says who runs it, and how far it is.

Several `inbounds study run` on one folder, on one machine or on many that share it, divide the cells among
themselves by claims alone. A claim whose process is dead (on the same host: no such process, or another one of that
number) or which has not been renewed for `SILENCE` seconds (on another host) is taken over. Every look followed by a
write happens under a file lock, so that two cannot take over the same claim.
"""

from __future__ import annotations

import contextlib
import json
import os
import platform
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from inbounds.learning.storage.whole_files import file_lock

FILE_NAME = "claim.json"
SILENCE = 900.0  # seconds; an epoch takes tens of seconds at most, a final evaluation minutes


class ClaimedError(RuntimeError):
    """Somebody else runs the cell, or has taken it over."""


class CellLock:
    """The right to run a cell, from `CellLock.take` until `release`.

    Args:
        folder: the cell's work folder.
        owner: who holds it, as in the file.
    """

    def __init__(self, folder: Path, owner: Mapping[str, Any]) -> None:
        self.folder, self.owner = folder, dict(owner)

    @classmethod
    def take(cls, folder: Path) -> CellLock:
        """Claim a cell.

        Args:
            folder: the cell's work folder; made if missing.

        Raises:
            ClaimedError: a living process has it.

        Example:
            >>> import tempfile
            >>> with tempfile.TemporaryDirectory() as name, CellLock.take(Path(name)) as claim:
            ...     claim.renew(epoch=3)
            ...     read_claim(Path(name))["epoch"]
            3
        """
        folder.mkdir(parents=True, exist_ok=True)
        claim = cls(folder, whoami())
        with _guard(folder):
            holder = read_claim(folder)
            if holder is not None and is_alive(holder):
                raise ClaimedError(f"process {holder['pid']} on {holder['host']} runs {folder.name}")
            claim._write({})
        return claim

    def renew(self, **progress: Any) -> None:
        """Say that we live, and how far we are.

        Raises:
            ClaimedError: the claim was taken over while this process stood still.
        """
        with _guard(self.folder):
            self._check()
            self._write(progress)

    def check(self) -> None:
        """Raise `ClaimedError` unless the claim is still ours."""
        with _guard(self.folder):
            self._check()

    def release(self) -> None:
        """Give the cell back, if it is still ours."""
        with contextlib.suppress(ClaimedError, OSError), _guard(self.folder):
            self._check()
            (self.folder / FILE_NAME).unlink()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def _check(self) -> None:
        holder = read_claim(self.folder)
        if holder is None or any(holder.get(key) != value for key, value in self.owner.items()):
            raise ClaimedError(
                f"{self.folder.name} was taken over by another process while this one stood still: "
                "nothing of it is lost, and this process leaves it alone"
            )

    def _write(self, progress: Mapping[str, Any]) -> None:
        # Not forced to the disk: a claim need not outlive the machine.
        temporary = self.folder / f".{FILE_NAME}.partial"
        temporary.write_text(json.dumps(self.owner | {"renewed": time.time()} | dict(progress)))
        os.replace(temporary, self.folder / FILE_NAME)


def whoami() -> dict[str, Any]:
    """Return what tells this process from every other: host, process number and when it started."""
    return {"host": _host(), "pid": os.getpid(), "started": _started(os.getpid())}


def read_claim(folder: Path) -> dict[str, Any] | None:
    """Return a cell's claim, None if there is none; a file that cannot be understood counts as none."""
    try:
        claim = json.loads((folder / FILE_NAME).read_text())
        int(claim["pid"]), float(claim["renewed"])
        return claim if {"host", "started"} <= claim.keys() else None
    except (FileNotFoundError, ValueError, TypeError, KeyError, AttributeError, OverflowError):
        return None


def is_alive(claim: Mapping[str, Any]) -> bool:
    """Tell whether the process that holds a claim still runs, as far as can be known from here."""
    if claim["host"] != _host():
        return time.time() - float(claim["renewed"]) < SILENCE
    try:
        os.kill(int(claim["pid"]), 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # it lives, and is another user's
        pass
    return _started(int(claim["pid"])) == claim["started"]


def _host() -> str:
    """Return the host and, where it can be told, the process namespace: numbers mean nothing in another container."""
    try:
        return f"{platform.node()} {os.readlink('/proc/self/ns/pid')}"
    except OSError:
        return platform.node()


def _started(pid: int) -> str:
    """When a process started, in the kernel's ticks; empty where the system does not say, dead if it is."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return ""
    return "dead" if fields[0] in "ZX" else fields[19]


def _guard(folder: Path) -> contextlib.AbstractContextManager[object]:
    """Hold the folder's file lock; it falls when the process dies."""
    return file_lock(folder / ".guard")
