"""What nbval compares in a notebook: text, exactly; pictures, HTML and videos, not at all.

Loaded with ``pytest -p tests.nbval_rules --nbval``. Stored notebooks carry text outputs only (tools/notebook_hook.py),
so the other forms have nothing to be compared with. A cell whose text may vary carries the tag
``nbval-ignore-output``, and no claim.
"""

from typing import Any

PICTURES = (
    "text/html",
    "image/png",
    "image/svg+xml",
    "application/javascript",
    "application/papermill.record/text/plain",
    "application/papermill.record/image/png",
    "application/papermill.record/text/html",
)


def pytest_collectstart(collector: Any) -> None:
    """Add the pictures to what nbval leaves out, for each notebook as it is collected."""
    if hasattr(collector, "skip_compare"):
        collector.skip_compare += PICTURES
