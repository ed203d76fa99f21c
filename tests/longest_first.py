"""The order in which workers take up files: what others wait for, notebooks, files with slow tests, the rest.

Of two alike the one with more tests comes first.

Loaded with ``pytest -p tests.longest_first --no-loadscope-reorder``. A worker takes a whole file; what is long must not
come last, when the other workers have nothing left to do.
"""

from collections import Counter

import pytest

FIRST = ("test_compiled.py",)
"""What leaves compiled functions on disk, where others find them: copies of the package, too, with planted errors."""


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort the files; the order within a file stays."""
    count = Counter(item.path for item in items)
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(
        key=lambda item: (
            item.path.name not in FIRST,
            item.path.suffix != ".ipynb",
            item.path not in slow,
            -count[item.path],
            item.path,
        )
    )
