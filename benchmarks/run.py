"""Measure steps per second over environment, inference and update: this engine, its peers, and the floor.

Each contestant is a process of its own; all are pinned to one core and take turns, one training epoch at a time, so
that whatever else the machine does meets all alike. One turn warms up, the others count. What is measured so far is
written after each robot. The stored table is replaced only by one that has all that it has: a run of some, or one in
which a contestant could not take part, goes to `benchmarks/results/some`.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import importlib.metadata
import json
import os
import platform
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markdown import Markdown
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from benchmarks.contestants import CONTESTANTS
from benchmarks.published import RESULTS, Extent, aside, place, read
from benchmarks.report import as_json, markdown, write
from benchmarks.work import ENVS, Work
from benchmarks.worker import own_cores

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = (
    "mujoco",
    "gymnasium",
    "torch",
    "numpy",
    "stable-baselines3",
    "sb3-contrib",
    "sbx-rl",
    "jax",
    "cleanrl",
    "rltools",
    "mkl",
    "numba",
)
HOW_TO_ADD = (
    "`python -m benchmarks.run --help` says how to install peers into an environment `peers`; pass its interpreter by "
    "--python NAME=peers/bin/python, as `make bench` does."
)
EVERYONE = ("floor", *CONTESTANTS)
EXAMPLES = """
examples:
  python -m benchmarks.run                                        everything; about twenty-five minutes
  python -m benchmarks.run --quick                                does it run? about a minute
  python -m benchmarks.run --envs Hopper-v5 --contestants inbounds-ppo-10 sb3-ppo floor
  python -m benchmarks.run $(for who in sbx cleanrl rltools; do echo --python $who-ppo=peers/bin/python; done)

peers of another stack:
  SBX needs JAX. RLtools compiles itself with g++ or clang++, a minute for each robot, and is several times as fast with
  MKL as without. CleanRL's wheel asks for an older Python than it needs, and for older libraries. Give them an
  environment of their own, with the versions of gymnasium, mujoco and torch that stand in constraints.txt:
    python -m venv peers
    peers/bin/pip install -c constraints.txt sbx-rl "gymnasium[mujoco]" torch rltools mkl mkl-include
    peers/bin/pip install --no-deps --ignore-requires-python cleanrl==1.2.0
"""


class Worker:
    """A contestant's process.

    Args:
        name: of the contestant, or "floor".
        work: what to do.
        core: to be pinned to.
        python: the interpreter.
    """

    def __init__(self, name: str, work: Work, core: int, python: str) -> None:
        self.name = name
        # No pipe, which would hold up a talkative one until somebody read it.
        self._errors = tempfile.TemporaryFile("w+", encoding="utf8", errors="replace")  # noqa: SIM115
        self._process = subprocess.Popen(
            [python, "-m", "benchmarks.worker", name, json.dumps(dataclasses.asdict(work)), f"--core={core}"],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
        )

    def ready(self) -> str | None:
        """Wait until it has warmed up; return why it cannot take part, or None."""
        return self._answer().get("unavailable")

    def turn(self) -> dict[str, Any]:
        """Let it train for one epoch; return what it measured, or that it is "unavailable", and why."""
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it has ended: the answer says why
            self._process.stdin.write("turn\n")
            self._process.stdin.flush()
        return self._answer()

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()
        self._errors.close()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line.endswith("\n"):  # it has ended, perhaps within a word
            self._process.communicate()
            self._errors.seek(0)
            said = self._errors.read().strip().splitlines()
            return {"unavailable": said[-1] if said else "it ended in silence"}
        answer: dict[str, Any] = json.loads(line)
        return answer


def measure(
    envs: Sequence[str],
    names: Sequence[str],
    work: Work,
    repeats: int,
    core: int,
    pythons: Mapping[str, str],
    progress: Progress,
    after_each: Callable[[dict[str, Any], dict[str, str]], None] = lambda *_: None,
) -> tuple[dict[str, Any], dict[str, str]]:
    """Let all contestants take turns on each environment.

    One that ends before its last turn has no measurements there, and does not take part any more: its turns would be
    fewer than those they are compared with.

    Args:
        envs: Gymnasium's ids.
        names: of the contestants, or "floor".
        work: what to do; its `env` is replaced.
        repeats: turns of each that count.
        core: that all are pinned to.
        pythons: interpreters by contestant; the others use this one.
        progress: shows how far it is.
        after_each: is told after each environment what will be returned, as far as it is there.

    Returns:
        Measurements by environment and contestant, and why some are absent, by contestant.
    """
    unavailable: dict[str, str] = {}
    measurements: dict[str, Any] = {}
    task = progress.add_task("", total=len(envs) * len(names) * (repeats + 1))

    def leave(name: str, why: str) -> None:
        unavailable[name] = why
        progress.console.print(f"{name} does not take part: {why}", markup=False, highlight=False)

    for env in envs:
        workers: list[Worker] = []
        measurements[env] = {}
        try:
            for name in names:
                progress.update(task, description=f"{env}: {name} warms up")
                if name not in unavailable:
                    python = pythons.get(name, sys.executable)
                    workers.append(worker := Worker(name, dataclasses.replace(work, env=env), core, python))
                    if (why := worker.ready()) is not None:
                        if not unavailable:
                            progress.console.print(HOW_TO_ADD, markup=False, highlight=False)
                        leave(name, why)
                progress.advance(task)
            for repeat in range(repeats):
                for worker in workers:
                    if worker.name not in unavailable:
                        progress.update(task, description=f"{env}: {worker.name}, repeat {repeat + 1}")
                        turn = worker.turn()
                        measurements[env].setdefault(worker.name, []).append(turn)
                        if "unavailable" in turn:
                            leave(worker.name, f"it ended on {env}: {turn['unavailable']}")
                            del measurements[env][worker.name]
                    progress.advance(task)
            progress.advance(task, (len(names) - len(workers)) * repeats)
        finally:
            for worker in workers:
                worker.close()
        after_each(measurements, unavailable)
    return measurements, unavailable


def extent(results: Mapping[str, Any]) -> Extent:
    """Return how much a table holds: the turns of each contestant that there still is, and the work."""
    turns = {
        f"{name} on {env}": len(each)
        for env, measured in results["measurements"].items()
        for name, each in measured.items()
        if name in EVERYONE and env in ENVS
    }
    return Extent(turns, json.loads(json.dumps(results["work"])))


def asked(envs: Sequence[str], names: Sequence[str], repeats: int, work: Work) -> Extent:
    """Return how much a run will measure if nobody is missing."""
    measurements = {env: {name: range(repeats) for name in names} for env in envs}
    return extent({"measurements": measurements, "work": dataclasses.asdict(work)})


def held(folder: Path) -> Extent | None:
    """Return how much the table in a folder holds, or None if there is none."""
    stored = read(folder / "speed.json")
    return None if stored is None else extent(stored)


def versions(pythons: Mapping[str, str]) -> dict[str, str]:
    """Return the versions of the packages that matter, from this interpreter or from a peer's."""
    code = (
        "import importlib.metadata as m, json, sys\n"
        "found = {}\n"
        "for name in sys.argv[1:]:\n"
        "    try: found[name] = m.version(name)\n"
        "    except m.PackageNotFoundError: pass\n"
        "print(json.dumps(found))"
    )
    found: dict[str, str] = {"python": platform.python_version()}
    for python in dict.fromkeys([sys.executable, *pythons.values()]):
        done = subprocess.run([python, "-c", code, *PACKAGES], capture_output=True, text=True, check=True)
        found = json.loads(done.stdout) | found
    return {name: found[name] for name in ("python", *PACKAGES) if name in found} | {
        "inbounds": importlib.metadata.version("inbounds")
    }


def machine() -> dict[str, Any]:
    """Return what the numbers depend on."""
    processor = platform.processor() or platform.machine()
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text(encoding="utf8").splitlines()
        processor = next((x.split(":", 1)[1].strip() for x in lines if x.startswith("model name")), processor)
    load = [round(x, 2) for x in os.getloadavg()]
    return {"processor": processor, "cores": os.cpu_count(), "system": platform.system(), "load": load}


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Return the command line's choices, checked."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.run",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--envs", nargs="+", default=list(ENVS), choices=ENVS, metavar="ENV", help=", ".join(ENVS)
    )
    parser.add_argument(
        "--contestants",
        nargs="+",
        default=list(EVERYONE),
        choices=EVERYONE,
        metavar="NAME",
        help=", ".join(EVERYONE),
    )
    parser.add_argument("--repeats", type=int, default=5, help="turns of each contestant that count (5)")
    parser.add_argument("--horizon", type=int, default=Work.horizon, help="env steps of a rollout (2048)")
    cores = own_cores(parser)
    parser.add_argument("--core", type=int, default=max(cores), help="to pin all to (the last)")
    parser.add_argument(
        "--python", action="append", default=[], metavar="NAME=PATH", help="interpreter of one contestant"
    )
    parser.add_argument(
        "--output",
        type=Path,
        default=RESULTS,
        help="folder to write to (less than the table that is there: …/some)",
    )
    parser.add_argument(
        "--quick", action="store_true", help="Hopper, 256 steps, one repeat; writes to …/quick"
    )
    chosen = parser.parse_args(arguments)
    if chosen.quick:
        chosen.envs, chosen.repeats, chosen.horizon = chosen.envs[:1], 1, 256
        chosen.output = chosen.output / "quick"
    everything = held(chosen.output) or asked(ENVS, EVERYONE, 1, Work(env=""))
    run = asked(chosen.envs, chosen.contestants, chosen.repeats, Work(env="", horizon=chosen.horizon))
    chosen.output, chosen.why = place(chosen.output, everything, run)
    if chosen.horizon % Work.minibatch_size:
        parser.error(
            f"--horizon must be a multiple of the minibatch, {Work.minibatch_size}; got {chosen.horizon}"
        )
    if chosen.core not in cores:
        parser.error(f"--core {chosen.core} is not ours; choose one of {sorted(cores)}")
    if chosen.repeats < 1:
        parser.error("--repeats must be at least 1")
    chosen.pythons = {}
    for pair in chosen.python:
        name, _, path = pair.partition("=")
        if name not in EVERYONE or not Path(path).exists():
            parser.error(
                f"--python takes NAME=PATH with a contestant and an interpreter that exists, got {pair!r}"
            )
        chosen.pythons[name] = str(Path(path).absolute())
    return chosen


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, write, and print the table."""
    chosen = parse(arguments)
    work = Work(env="", horizon=chosen.horizon)
    # Read before the children add to it.
    about = {"machine": machine(), "versions": versions(chosen.pythons)}
    words = ["python", "-m", "benchmarks.run", *(sys.argv[1:] if arguments is None else arguments)]
    console = Console()
    if chosen.why:
        console.print(chosen.why, soft_wrap=True)

    def found(measurements: dict[str, Any], unavailable: dict[str, str]) -> dict[str, Any]:
        return {
            "date": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()),
            "command": shlex.join(words),
            **about,
            "work": dataclasses.asdict(work),
            "repeats": chosen.repeats,
            "unavailable": unavailable,
            "measurements": measurements,
        }

    def keep(measurements: dict[str, Any], unavailable: dict[str, str]) -> None:
        if len(measurements) < len(chosen.envs):  # not all robots: it must not replace a table of all
            as_json(found(measurements, unavailable), aside(chosen.output))

    columns = (TextColumn("{task.description:44}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console) as progress:
        measured = measure(
            chosen.envs, chosen.contestants, work, chosen.repeats, chosen.core, chosen.pythons, progress, keep
        )
    results = found(*measured)
    folder, why = place(chosen.output, held(chosen.output), extent(results))
    paths = write(results, folder)
    console.print(Markdown(markdown(results)))
    console.print(*(str(path) for path in paths))
    if why:
        missing = ", ".join(results["unavailable"])
        console.print(f"{why} {missing} did not take part. {HOW_TO_ADD}", soft_wrap=True, highlight=False)


if __name__ == "__main__":
    main()
