"""What the command lines share: a choice among commands, read off their classes, and a console of plain lines."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Union

import tyro
from rich.console import Console
from tyro.conf import subcommand

from inbounds.cli.errors import CommandError

read: Any = tyro.cli
"""Reads a command line; tyro's overloads do not know types that are chosen at run time."""


def read_one_of(commands: Mapping[str, type[Any]], args: Sequence[str], prog: str, description: str) -> Any:
    """Return the command that a command line names, with its values.

    Args:
        commands: by name; their fields are the options, their docstrings the help.
        args: the words after the program's name; without any, help is asked for.
        prog: the program's name.
        description: what help begins with.

    Raises:
        SystemExit: help was asked for and has been written (code 0), or what is wrong has been (code 2).
    """
    kinds: Any = tuple(Annotated[kind, subcommand(name)] for name, kind in commands.items())
    return read(Union[kinds], args=list(args) or ["--help"], prog=prog, description=description)  # noqa: UP007


@contextlib.contextmanager
def blaming_the_words() -> Iterator[None]:
    """Have a ValueError say what is wrong with the command line."""
    try:
        yield
    except ValueError as error:
        raise CommandError(str(error), 2) from error


class Lines(Console):
    """Standard output, a table or a line at a time; in a notebook, too, plain text."""

    def __init__(self) -> None:
        super().__init__(highlight=False, force_jupyter=False)

    def say(self, line: str) -> None:
        """Write a line as it is: no markup, and not broken."""
        self.print(line, markup=False, soft_wrap=True)
