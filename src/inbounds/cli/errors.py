"""What a user can do something about: one line that names the fix, instead of a traceback."""

from __future__ import annotations

import errno


class CommandError(Exception):
    """Ends a command with a message and an exit code; the message says what to do."""

    def __init__(self, message: str, exit_code: int = 1) -> None:
        super().__init__(message)
        self.exit_code = exit_code


def is_disk_full(error: BaseException | None) -> bool:
    """Tell whether an error, or what led to it, is a disk (or a quota) without room.

    torch reports a write that failed half-way as a RuntimeError of its own, which has the cause as its context.

    Example:
        >>> is_disk_full(OSError(errno.ENOSPC, "No space left on device")), is_disk_full(OSError(errno.EACCES, "no"))
        (True, False)
    """
    while error is not None:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            return True
        error = error.__cause__ or error.__context__
    return False
