"""What a user can do something about: one line that names the fix, instead of a traceback."""

from __future__ import annotations


class CommandError(Exception):
    """Ends a command with a message and an exit code; the message says what to do."""

    def __init__(self, message: str, exit_code: int = 1) -> None:
        super().__init__(message)
        self.exit_code = exit_code
