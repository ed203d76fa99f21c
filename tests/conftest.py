"""What every test finds: a temporary folder that goes with the session, and distributions that check their arguments.

TorchRL switches these checks off while it is imported, for all distributions and for all that runs later in the
process. A module of tests that wants it so says `CHECKED_ARGUMENTS = False`.
"""

import sys

import pytest

from tests.temporary import pytest_configure  # noqa: F401


@pytest.fixture(autouse=True)
def _distributions_check_their_arguments(request: pytest.FixtureRequest) -> None:
    if "torch" in sys.modules:
        wanted = getattr(getattr(request, "module", None), "CHECKED_ARGUMENTS", True)
        sys.modules["torch"].distributions.Distribution.set_default_validate_args(wanted)
