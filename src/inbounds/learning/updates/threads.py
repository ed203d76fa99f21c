"""How many threads a run computes on: one."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator

import torch

_lock = threading.Lock()
_uses: dict[int, int] = {}  # of `one_thread` under way, by the Python thread that they are in
_usual = [1]  # torch's threads before the first of them


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Run torch on one thread: its matrices are small here, and results then do not depend on the machine's cores.

    Two processes of one thread each do more in a given time than one process of two. Python's threads may use it at
    the same time: torch has a number for each of them, and for a new one the number that was set last.
    """
    here = threading.get_ident()
    with _lock:
        now = torch.get_num_threads()  # before it is set: else a new thread takes what another sets later
        if not _uses:
            _usual[0] = now
        _uses[here] = _uses.get(here, 0) + 1
        torch.set_num_threads(1)
    try:
        yield
    finally:
        with _lock:
            _uses[here] -= 1
            if not _uses[here]:
                del _uses[here]
                torch.set_num_threads(_usual[0])
