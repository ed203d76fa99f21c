"""Where npm cannot be reached and its packages are in no cache, what needs MuJoCo in JavaScript is skipped."""

import pytest

from inbounds.book.live.packages import bundle
from inbounds.book.npm import NpmError


@pytest.fixture(scope="session")
def engine() -> None:
    """MuJoCo's WebAssembly build."""
    try:
        bundle()
    except NpmError as error:
        pytest.skip(f"the live robot is not tested here: {error}")
