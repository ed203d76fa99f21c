"""What nbval compares in a notebook, and with what.

Text is compared, exactly; pictures, HTML and videos are not. Stored notebooks carry text outputs only
(tools/notebook_hook.py), so the other forms have nothing to be compared with. A cell whose text may vary carries the
tag ``nbval-ignore-output``, and no claim.

Loaded with ``pytest -p tests.nbval_rules --nbval``. With ``--executed FOLDER`` a notebook that was executed for the
book is not executed again: its outputs are taken from the book's cache (tools/notebook_cache.py). One that the cache
does not know, because a cell failed or was changed, gets a kernel, and shows what is wrong.
"""

from collections import deque
from itertools import count
from typing import Any

import pytest

PICTURES = (
    "text/html",
    "image/png",
    "image/svg+xml",
    "application/javascript",
    "application/papermill.record/text/plain",
    "application/papermill.record/image/png",
    "application/papermill.record/text/html",
)


class Recorded:
    """What nbval asks of a kernel, answered from the outputs of a notebook that was executed before."""

    def __init__(self, cells: list[Any]) -> None:
        self.cells = iter(cells)
        self.numbers = map(str, count())
        self.messages: deque[dict[str, Any]] = deque()

    def execute_cell_input(self, source: str, allow_stdin: bool | None = None) -> str:
        cell = next(cell for cell in self.cells if cell.source == source)  # what is skipped is not asked for
        number = next(self.numbers)
        said = [(output.output_type, output) for output in cell.outputs]
        self.messages = deque(
            {"msg_type": kind, "content": content, "parent_header": {"msg_id": number}}
            for kind, content in [*said, ("status", {"execution_state": "idle"})]
        )
        return number

    def get_message(self, stream: str, timeout: float | None = None) -> dict[str, Any]:
        return self.messages.popleft()

    def await_reply(self, number: str, timeout: float | None = None) -> None:
        """It has been given."""

    def await_idle(self, number: str, timeout: float | None = None) -> None:
        self.messages.clear()

    def is_alive(self) -> bool:
        return True

    def stop(self) -> None:
        """Nothing runs."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--executed", metavar="FOLDER", help="cache of executed notebooks, for nbval")


def pytest_collectstart(collector: Any) -> None:
    """Add the pictures to what nbval leaves out, for each notebook as it is collected, and see who has executed it."""
    if not hasattr(collector, "skip_compare"):
        return
    collector.skip_compare += PICTURES
    if folder := collector.config.option.executed:
        start_a_kernel = collector.setup
        collector.setup = lambda: _replay(collector, folder) or start_a_kernel()


def _replay(notebook: Any, folder: str) -> bool:
    """Give a notebook the outputs that a cache has of it; return whether the cache has any."""
    from jupyter_cache import get_cache

    cache = get_cache(folder)
    try:
        key = cache.match_cache_notebook(notebook.nb).pk
    except KeyError:
        return False
    notebook.kernel = Recorded(cache.get_cache_bundle(key).nb.cells)
    notebook.setup_sanitize_files()
    return True
