"""Whether the book is being built: then an output may count on what its page loads, and on the book's own files."""

from __future__ import annotations

import os


def builds_the_book() -> bool:
    """Whether `tools/build_book.py` executes this notebook for a page, and not a reader in a notebook of their own.

    Example:
        >>> builds_the_book()
        False
    """
    return os.environ.get("INBOUNDS_BOOK_BUILD") == "1"
