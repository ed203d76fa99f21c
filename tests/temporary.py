"""A session of tests has a temporary folder of its own, and takes it away at its end.

Peers write logs into the temporary folder, Sphinx its tracebacks, PyTorch its caches. Loaded by ``tests/conftest.py``,
and with ``pytest -p tests.temporary`` where that file is not read: for doctests and for notebooks.
What pytest keeps of a test that failed (``tmp_path``) lies elsewhere, and stays.
"""

import os
import shutil
import tempfile
from multiprocessing import util
from unittest import mock

import pytest


@pytest.hookimpl(trylast=True)  # after pytest has decided where its own folder is
def pytest_configure(config: pytest.Config) -> None:
    """Make the folder, and send this process and those that it starts there."""
    if hasattr(config, "workerinput"):
        return  # a worker of pytest-xdist inherits the folder
    config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]
    folder = tempfile.mkdtemp(prefix="inbounds-tests-")
    # At exit, and after multiprocessing (-100), which has a folder of its own in this one.
    util.Finalize(None, shutil.rmtree, args=(folder,), kwargs={"ignore_errors": True}, exitpriority=-1000)
    for patch in (
        mock.patch.dict(os.environ, TMPDIR=folder),
        mock.patch.object(tempfile, "tempdir", folder),
    ):
        patch.start()
        config.add_cleanup(patch.stop)
