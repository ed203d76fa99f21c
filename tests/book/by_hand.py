"""A program of the book, run as a file would be."""

from typing import Any


def run(text: str) -> dict[str, Any]:
    """Run a program, and return the names that it leaves."""
    namespace: dict[str, Any] = {}
    exec(compile(text, "the chapter", "exec"), namespace)
    return namespace
