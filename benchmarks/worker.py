"""One contestant in a process of its own, pinned to one core, which trains for one epoch whenever it is told to.

All contestants of a comparison are alive at once, and take turns: a change of the machine's mood in
mid-benchmark meets all of them. Protocol: JSON lines on standard output, one per line on standard input. What
a peer prints goes to standard error.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import sys
from collections.abc import Callable
from typing import Any

THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def one_core(core: int) -> None:
    """Pin this process to a core, and tell every library that there is but one. Before anything is imported."""
    os.sched_setaffinity(0, {core})
    os.environ.update(dict.fromkeys(THREADS, "1"))
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    os.environ["JAX_PLATFORMS"] = "cpu"
    os.environ.setdefault("MUJOCO_GL", "disable")


def own_cores(parser: argparse.ArgumentParser) -> set[int]:
    """Return the cores that this process may use; where a process cannot be pinned to one, end the program."""
    if not hasattr(os, "sched_getaffinity"):
        parser.exit(
            2, f"{parser.prog} pins everything to one core, which takes Linux (a container will do)\n"
        )
    return os.sched_getaffinity(0)


def measurer(name: str, work: Any) -> Callable[[], dict[str, Any]]:
    """Return what measures one turn of a contestant, or of the floor."""
    if name == "floor":
        from benchmarks.floor import Floor

        return Floor(work).turn
    from benchmarks.contestants import CONTESTANTS
    from benchmarks.work import stopwatch

    turn = CONTESTANTS[name].start(work)

    def measure() -> dict[str, Any]:
        stop = stopwatch()
        steps = turn()
        return {"steps": steps, **stop()}

    return measure


def main() -> None:
    """Get ready, warm up by one turn, then measure a turn per line of input."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name")
    parser.add_argument("work", help="the fields of work.Work as JSON")
    parser.add_argument("--core", type=int, required=True)
    arguments = parser.parse_args()
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    one_core(arguments.core)

    def answer(message: dict[str, Any]) -> None:
        print(json.dumps(message), file=answers, flush=True)

    from benchmarks.work import Work

    fields = json.loads(arguments.work)
    fields["hidden"] = tuple(fields["hidden"])
    try:
        measure = measurer(arguments.name, Work(**fields))
        if "torch" in sys.modules:
            sys.modules["torch"].set_num_threads(1)
        measure()
    except ImportError as error:
        answer({"unavailable": str(error)})
        return
    answer({"ready": True})
    for _ in sys.stdin:
        answer({**measure(), "peak_bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss})


if __name__ == "__main__":
    main()
