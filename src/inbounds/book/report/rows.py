"""Rows of differences, as the studies' forests and tables have them: which of them are about something."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

Row = TypeVar("Row")


def of(rows: Sequence[Row], **which: Any) -> list[Row]:
    """Return the rows with certain values.

    Args:
        rows: of differences.
        **which: name of a field and its value, such as `algorithm="ppo"`.

    Example:
        >>> of([], algorithm="ppo")
        []
    """
    return [row for row in rows if all(getattr(row, name) == value for name, value in which.items())]
