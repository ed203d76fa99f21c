"""What a user can do something about: one line that names the fix, instead of a traceback."""

from __future__ import annotations

import errno
import sys
import traceback


class CommandError(Exception):
    """Ends a command with a message and an exit code; the message says what to do."""

    def __init__(self, message: str, exit_code: int = 1) -> None:
        super().__init__(message)
        self.exit_code = exit_code


def complain(message: object, exit_code: int = 1, prog: str = "inbounds") -> int:
    """Write a line to standard error, and return the exit code."""
    print(f"{prog}: {message}", file=sys.stderr)
    return exit_code


def complain_of_files(error: OSError, prog: str) -> int:
    """Write what the system says of the study's files, and what to do about it; return the exit code.

    Raises:
        OSError: the output is not read any more, or a name of the command line is too long: `main` speaks of these.
    """
    if isinstance(error, PermissionError):
        return complain(
            f"{error}: change its permissions, or choose other folders (--results, --work)", prog=prog
        )
    if isinstance(error, BlockingIOError):  # of a lock: it says itself what to do
        return complain(error, prog=prog)
    if isinstance(error, BrokenPipeError) or error.errno == errno.ENAMETOOLONG:
        raise error
    room = "make room, or " if error.errno in (errno.ENOSPC, errno.EDQUOT) else ""
    kept = f"What was finished is kept: {room}choose other folders (--results, --work)"
    return complain(f"{error}. {kept}", prog=prog)


NO_MEMORY = (
    "there is no memory for such a run: choose fewer --seeds, a smaller --algorithm.horizon, or smaller "
    "--network.hidden-sizes"
)


_TOO_LARGE = "can't allocate memory", "Maximum allowed dimension exceeded", "array is too big"


def lacks_memory(error: BaseException) -> bool:
    """Return whether an error means that there is no memory; torch makes a RuntimeError of it, NumPy a ValueError.

    Example:
        >>> lacks_memory(MemoryError()), lacks_memory(RuntimeError("shapes differ"))
        (True, False)
    """
    return isinstance(error, MemoryError) or any(words in str(error) for words in _TOO_LARGE)


def is_ours(error: BaseException) -> bool:
    """Return whether this package raised an error, and not what it called: an environment's author needs the traceback.

    Example:
        >>> from inbounds.cli.options import parse_seeds
        >>> try:
        ...     parse_seeds("ten")
        ... except ValueError as error:
        ...     is_ours(error)
        True
    """
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    return bool(frames) and frames[-1].f_globals.get("__name__", "").split(".")[0] == "inbounds"


def is_unread(error: BaseException) -> bool:
    """Return whether an error means that nobody reads the output any more (`| head`); Rich makes a SystemExit of it."""
    return isinstance(error, BrokenPipeError) or (
        isinstance(error, SystemExit) and isinstance(error.__context__, BrokenPipeError)
    )
