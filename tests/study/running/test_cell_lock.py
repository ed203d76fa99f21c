import contextlib
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from inbounds.study.running import cell_lock
from inbounds.study.running.cell_lock import (
    FILE_NAME,
    SILENCE,
    CellLock,
    ClaimedError,
    is_alive,
    read_claim,
    whoami,
)

HOLD = """
import os, sys
from pathlib import Path
from inbounds.study.running.cell_lock import CellLock
CellLock.take(Path(sys.argv[1]))
print("taken", flush=True)
sys.stdin.read()
os._exit(9)
"""

LOCK = """
import sys
from pathlib import Path
from inbounds.learning.storage.whole_files import file_lock
with file_lock(Path(sys.argv[1], ".guard")):
    print("locked", flush=True)
    sys.stdin.read()
"""


def write(folder: Path, **changes: object) -> None:
    (folder / FILE_NAME).write_text(json.dumps(whoami() | {"renewed": time.time()} | changes))


def test_the_claim_of_a_living_process_stands_and_that_of_a_dead_one_falls(tmp_path: Path) -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "taken\n"
        with pytest.raises(ClaimedError, match=f"process {holder.pid} on "):
            CellLock.take(tmp_path)
        holder.kill()
    with CellLock.take(tmp_path):
        assert read_claim(tmp_path)["pid"] == os.getpid()  # type: ignore[index]
    assert read_claim(tmp_path) is None


def test_another_process_of_the_same_number_is_not_the_holder(tmp_path: Path) -> None:
    write(tmp_path, started="12345")
    CellLock.take(tmp_path).release()


def test_another_host_is_believed_for_a_while(tmp_path: Path) -> None:
    write(tmp_path, host="elsewhere", pid=1)
    with pytest.raises(ClaimedError, match="on elsewhere"):
        CellLock.take(tmp_path)
    write(tmp_path, host="elsewhere", pid=1, renewed=time.time() - SILENCE - 1)
    CellLock.take(tmp_path).release()


def test_who_was_taken_over_notices_and_leaves_the_new_holder_alone(tmp_path: Path) -> None:
    ours = CellLock.take(tmp_path)
    write(tmp_path, host="elsewhere", pid=1)
    for act in (ours.check, ours.renew):
        with pytest.raises(ClaimedError, match="taken over by another process"):
            act()
    ours.release()
    assert read_claim(tmp_path)["host"] == "elsewhere"  # type: ignore[index]


NO_NUMBERS = '{"host": "x", "pid": "q", "started": 1, "renewed": "z"}'


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"pid": 1}', NO_NUMBERS])
def test_a_file_that_cannot_be_understood_claims_nothing(tmp_path: Path, text: str) -> None:
    (tmp_path / FILE_NAME).write_text(text)
    assert read_claim(tmp_path) is None
    CellLock.take(tmp_path).release()


def test_of_many_exactly_one_takes_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path, pid=2**22 + 1)  # above the kernel's largest
    both, taken, real = threading.Barrier(2), [], is_alive

    def look(holder: Mapping[str, Any]) -> bool:
        """Look, and wait for another who sees the same dead holder; in vain where that one has to wait, too."""
        alive = real(holder)
        with contextlib.suppress(threading.BrokenBarrierError):
            both.wait(0.5)
        return alive

    monkeypatch.setattr(cell_lock, "is_alive", look)

    def take() -> None:
        with contextlib.suppress(ClaimedError):
            taken.append(CellLock.take(tmp_path))

    threads = [threading.Thread(target=take) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(taken) == 1


def test_a_claim_waits_for_whoever_holds_the_lock(tmp_path: Path) -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", LOCK, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "locked\n"
        taker = threading.Thread(target=CellLock.take, args=(tmp_path,))
        taker.start()
        taker.join(0.3)
        assert taker.is_alive()
        assert read_claim(tmp_path) is None
        holder.kill()  # the kernel drops the lock of the dead
        taker.join(30)
        assert not taker.is_alive()
    assert read_claim(tmp_path) is not None


def test_we_are_alive() -> None:
    assert is_alive(whoami() | {"renewed": 0})
