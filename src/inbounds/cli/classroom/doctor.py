"""`inbounds doctor`: does this machine have what the book needs? What is missing is named with its remedy."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Literal

from packaging.requirements import Requirement
from rich.console import Console

SUPPORTED = (3, 11), (3, 13)
"""The first and the last minor version of Python that the project's tests run on."""
GIGABYTES = 4.0
"""Free on the disk, as `tools/setup.sh` asks: the environment alone takes three."""
DRAW_SECONDS = 120.0
"""To draw one frame in another process, with imports."""
_DRAW = """
import inbounds
from inbounds import headless
import gymnasium
headless.require_backend()
env = gymnasium.make("InvertedPendulum-v5", render_mode="rgb_array")
env.reset(seed=0)
frame = env.render()
assert frame.max() > frame.min(), "the frame is of one colour"
"""


@dataclass(frozen=True)
class Diagnosis:
    """One thing that was looked at."""

    name: str
    state: Literal["fine", "optional", "missing"]
    """`optional`: missing, but only some of the book needs it."""
    found: str
    remedy: str = ""
    """A command or a sentence; empty where all is well."""


def look_at_python() -> Diagnosis:
    """Compare Python's version with those that the project is tested on."""
    version = platform.python_version()
    first, last = (".".join(map(str, minor)) for minor in SUPPORTED)
    if sys.version_info[:2] < SUPPORTED[0]:
        return Diagnosis("Python", "missing", version, f"install Python {first} to {last}")
    if sys.version_info[:2] > SUPPORTED[1]:
        return Diagnosis("Python", "optional", version, f"tested with {first} to {last} only")
    return Diagnosis("Python", "fine", version)


def look_at_packages(extra: str | None = None) -> Diagnosis:
    """Compare installed packages with the versions that the package, or one extra of it, asks for."""
    name = f"packages ({extra})" if extra else "packages"
    wrong, count = [], 0
    for text in metadata.requires("inbounds") or []:
        wanted = Requirement(text)
        everybody = wanted.marker is None or wanted.marker.evaluate({"extra": ""})
        ours = everybody if extra is None else not everybody and _belongs(wanted, extra)
        if not ours:
            continue
        count += 1
        try:
            version = metadata.version(wanted.name)
        except metadata.PackageNotFoundError:
            wrong.append(wanted.name)
            continue
        if not wanted.specifier.contains(version, prereleases=True):
            wrong.append(f"{wanted.name} {version} (wanted {wanted.specifier})")
    if not count:
        return Diagnosis(name, "optional", "unknown to this installation", "install it again: pip install .")
    if not wrong:
        return Diagnosis(name, "fine", f"{count} of {count}")
    target = f'".[{extra}]"' if extra else "."
    return Diagnosis(
        name,
        "optional" if extra else "missing",
        f"missing or of another version: {', '.join(wrong)}",
        f"pip install {target} in the source tree" + (f", {_needed_by(extra)}" if extra else ""),
    )


def _belongs(wanted: Requirement, extra: str) -> bool:
    return wanted.marker is not None and wanted.marker.evaluate({"extra": extra})


def _needed_by(extra: str) -> str:
    uses = {"book": "for the book's notebooks", "lab": "for JupyterLab", "fast": "for the compiled engine"}
    return uses.get(extra, f"for what {extra} needs")


def look_at_drawing() -> Diagnosis:
    """Draw one frame off screen, in another process: where OpenGL is broken it takes its process with it."""
    backend = os.environ.get("MUJOCO_GL") or "MuJoCo's own choice"
    try:
        done = subprocess.run(
            [sys.executable, "-c", _DRAW], capture_output=True, text=True, timeout=DRAW_SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        wrong = f"no frame within {DRAW_SECONDS:.0f} s, by {backend}"
    else:
        if done.returncode == 0:
            return Diagnosis("drawing", "fine", f"off screen, by {backend}")
        said = done.stderr.strip().splitlines() or [f"the process ended with code {done.returncode}"]
        wrong = said[-1]
    from inbounds.headless import PACKAGES_HINT

    remedy = f"{PACKAGES_HINT} (on Debian and Ubuntu)"
    if "MUJOCO_GL" in wrong:  # MuJoCo knows no such backend
        remedy = "unset MUJOCO_GL, or set it to egl or osmesa"
    return Diagnosis("drawing", "missing", wrong, f"{remedy}: the book's films need it")


def look_at_films() -> Diagnosis:
    """Look for the encoder, which the book needs, and the package alone for `inbounds watch`."""
    from inbounds.book.drawing.videos import require_encoder

    try:
        require_encoder()
    except RuntimeError as error:
        needed: Literal["optional", "missing"] = (
            "missing" if look_at_packages("book").state == "fine" else "optional"
        )
        return Diagnosis("films", needed, "no encoder", str(error))
    return Diagnosis("films", "fine", "an ffmpeg is there")


def look_at_disk() -> Diagnosis:
    """Look at the room below the working folder."""
    free = shutil.disk_usage(Path.cwd()).free / 1e9
    found = f"{free:.1f} GB free here"
    if free >= GIGABYTES:
        return Diagnosis("disk", "fine", found)
    return Diagnosis("disk", "missing", found, f"free {GIGABYTES - free:.1f} GB, or work in another folder")


def look_at_training() -> Diagnosis:
    """Train two small policies for about two seconds."""
    from dataclasses import replace

    from inbounds.learning import preset, train

    config = preset("common", "InvertedPendulum-v5", seeds=(0, 1), epochs=1)
    config = replace(config, algorithm=replace(config.algorithm, horizon=512))
    train(config)  # imports, and what is done once
    started, steps = time.perf_counter(), 0
    while time.perf_counter() - started < 2.0:
        if train(config).diverged.any():
            return Diagnosis("training", "missing", "a seed diverged", "report it: this must not happen")
        steps += len(config.seeds) * 512
    rate = steps / (time.perf_counter() - started)
    return Diagnosis("training", "fine", f"{rate:,.0f} steps a second, of a small robot")


LOOKS: tuple[Callable[[], Diagnosis], ...] = (
    look_at_python,
    look_at_packages,
    *(partial(look_at_packages, extra) for extra in ("book", "fast", "lab")),
    look_at_disk,
    look_at_drawing,
    look_at_films,
    look_at_training,
)


def diagnoses() -> Iterator[Diagnosis]:
    """Look at one thing after the other; what cannot even be looked at counts as missing."""
    for look in LOOKS:
        try:
            yield look()
        except Exception as error:  # whatever is wrong with a machine, the others are still looked at
            name = getattr(look, "__name__", "packages").removeprefix("look_at_")
            yield Diagnosis(name, "missing", f"{type(error).__name__}: {error}", "mend what is above first")


def run() -> int:
    """Print every diagnosis as it comes.

    Returns:
        0, or 1 where something is missing that every reader needs.
    """
    console = Console(highlight=False)
    marks = {"fine": "[green]✓[/]", "optional": "[yellow]–[/]", "missing": "[red]✗[/]"}
    missing = 0
    for found in diagnoses():
        missing += found.state == "missing"
        console.print(f"{marks[found.state]} {found.name}: ", end="")
        console.print(found.found, markup=False)
        if found.remedy:
            console.print(f"    {found.remedy}", markup=False, style="bold")
    verdict = "This machine has what the book needs."
    if missing:
        things = "one thing is" if missing == 1 else f"{missing} things are"
        verdict = f"{things.capitalize()} missing; the lines under ✗ say what to do."
    console.print(verdict)
    return int(missing > 0)
