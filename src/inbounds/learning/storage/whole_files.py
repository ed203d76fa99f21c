"""Files that are whole or absent, and errors that say what became of the others."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from filelock import BaseFileLock, FileLock, Timeout

LOCK_FILE = ".lock"  # in a directory that somebody writes a run into


class DamagedFileError(ValueError):
    """A file of a run is cut short, damaged, or of another origin; the message names file and remedy."""


def is_disk_full(error: BaseException | None) -> bool:
    """Tell whether an error, or what led to it, is a disk (or a quota) without room.

    torch reports a write that failed half-way as a RuntimeError of its own, which has the cause as its context.

    Example:
        >>> import errno
        >>> is_disk_full(OSError(errno.ENOSPC, "No space left on device")), is_disk_full(OSError(errno.EACCES, "no"))
        (True, False)
    """
    while error is not None:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            return True
        error = error.__cause__ or error.__context__
    return False


def says_nothing_of_the_file(error: BaseException) -> bool:
    """Tell whether reading failed before the contents were looked at: no file, no permission, no memory, no handle.

    What is there may be sound. An error of the system has a number; what a reader says of contents has none.

    Example:
        >>> [says_nothing_of_the_file(e) for e in (PermissionError(errno.EACCES, "no"), OSError("no footer"))]
        [True, False]
    """
    return isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno is not None)


def find(run: str | Path, name: str) -> Path:
    """Return the path of a file of a run.

    Args:
        run: run directory, or the file itself.
        name: of the file, if it is a directory.

    Raises:
        FileNotFoundError: there is no such file.

    Example:
        >>> find("no/run", "policies.safetensors")
        Traceback (most recent call last):
        FileNotFoundError: there is no no/run: train a run first (inbounds train --out no/run)
    """
    path = Path(run)
    if path.is_dir():
        path /= name
    if not path.is_file():
        out = shlex.quote(str(path.parent if path.name == name else path))
        if path.with_name("checkpoint.pt").is_file():
            raise FileNotFoundError(
                f"there is no {path}, but a checkpoint beside it: save_run(run_dir, train(config, run_dir=run_dir)) of "
                "inbounds.learning (with make_envs, where the run had one) goes on from that and writes it; so does "
                "the `inbounds train` command of the run"
            )
        raise FileNotFoundError(f"there is no {path}: train a run first (inbounds train --out {out})")
    return path


def damaged(path: Path, reason: object, remedy: str = "") -> DamagedFileError:
    """Return the error that says what is wrong with a file and what to do.

    Args:
        path: of the file.
        reason: why it cannot be read, an exception or words; its first line is quoted.
        remedy: what to do; by default, to have the file written anew from the checkpoint.

    Example:
        >>> from pathlib import Path
        >>> print(damaged(Path("curves.parquet"), "no footer.", remedy="train again"))
        curves.parquet is damaged, cut short or of another origin (no footer): train again
    """
    remedy = remedy or (
        "repeat the `inbounds train` command of this run, or save_run(run_dir, train(config, run_dir=run_dir)) of "
        "inbounds.learning, which write it anew from the checkpoint beside it, or put a copy in its place"
    )
    said = (str(reason) or type(reason).__name__).splitlines()[0].rstrip(".")
    return DamagedFileError(f"{path} is damaged, cut short or of another origin ({said[:120]}): {remedy}")


def write_whole(path: Path, data: Any) -> None:
    """Write a file that is, whenever the process or the machine dies, the old one or the new one.

    Args:
        path: of the file; its folder must exist.
        data: bytes, or a buffer.

    Raises:
        OSError: it could not be written, as on a full disk; the old file is untouched.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     write_whole(Path(folder) / "file", b"all of it")
        ...     (Path(folder) / "file").read_bytes()
        b'all of it'
    """
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.partial")  # each writer's own
    try:
        with open(temporary, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)  # on a full disk every byte counts
        raise


def remove_leftovers(path: Path) -> None:
    """Remove what `write_whole` left beside a file whenever it was killed; nobody else may be writing that file.

    Args:
        path: of the file; its folder must exist.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     leftover = Path(folder) / ".file.0123abcd.partial"
        ...     leftover.touch()
        ...     remove_leftovers(Path(folder) / "file")
        ...     leftover.exists()
        False
    """
    name = re.compile(rf"\.{re.escape(path.name)}\.[0-9a-f]{{8}}\.partial")
    for leftover in path.parent.iterdir():
        if name.fullmatch(leftover.name):
            with contextlib.suppress(OSError):  # it takes room, and does no other harm
                leftover.unlink()


@contextlib.contextmanager
def file_lock(path: Path, *, wait: bool = True) -> Iterator[BaseFileLock]:
    """Hold a lock on a file, against every other process and every other thread.

    A thread may hold again what it holds. The death of a process lets go of all that it held.

    Args:
        path: of the file, which is made and stays; its folder must exist.
        wait: for whoever has it.

    Raises:
        BlockingIOError: somebody else has it, and we do not wait.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder, file_lock(Path(folder) / ".lock") as lock:
        ...     lock.is_locked
        True
    """
    path.parent.stat()  # the library would make a folder that is missing
    lock = FileLock(path, is_singleton=True, fallback_to_soft=False)
    try:
        lock.acquire(blocking=wait)
    except Timeout as error:
        raise BlockingIOError(errno.EWOULDBLOCK, "somebody else holds it", str(path)) from error
    try:
        yield lock
    finally:
        lock.release()


@contextlib.contextmanager
def held(directory: Path) -> Iterator[None]:
    """Hold a directory, so that nobody else writes a run into it: no other process, no other thread.

    Args:
        directory: it must exist; while it is held, there is a file `.lock` in it.

    Raises:
        BlockingIOError: somebody else holds it.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder, held(Path(folder)):
        ...     write_whole(Path(folder) / "file", b"mine")
    """
    path = directory.resolve() / LOCK_FILE
    with file_lock(path, wait=False) as lock:
        try:
            yield
        finally:
            if lock.lock_counter == 1:
                # Before it is let go: whoever opened the file meanwhile finds that it has lost its name, and makes
                # another. On Windows a file in use cannot be removed; there the library does it afterwards.
                with contextlib.suppress(OSError):
                    path.unlink()


@contextlib.contextmanager
def claimed(run_dir: Path) -> Iterator[None]:
    """Make a run directory, unless it is there, and hold it.

    Args:
        run_dir: absolute; the folders above it are made, too.

    Raises:
        BlockingIOError: somebody else holds it.
        OSError: it cannot be made, or not be written.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder, claimed(Path(folder, "runs", "first")):
        ...     Path(folder, "runs", "first").is_dir()
        True
    """
    with contextlib.ExitStack() as stack:
        try:
            run_dir.mkdir(parents=True, exist_ok=True)
            stack.enter_context(held(run_dir))
        except BlockingIOError as error:
            raise BlockingIOError(
                f"another process or thread trains in {run_dir}: wait until it is done, or choose another run_dir"
            ) from error
        except OSError as error:
            said = f"{run_dir} cannot be a run directory ({error.strerror}): choose another run_dir"
            raise OSError(error.errno, said) from error
        yield
