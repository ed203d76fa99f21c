"""Where results go: what the book reads is not replaced by a run that measured less.

The files in `benchmarks/results` are tracked, and chapters read them. A run of fewer robots, contestants or seeds than
they hold, or of other settings, is written below `benchmarks/results/some`, which git ignores. A folder elsewhere, and
one called `quick`, is nobody's but the caller's: there everything is replaced. To replace stored results by fewer,
remove their JSON file first.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).resolve().parent / "results"
SCRATCH = ("some", "quick")
"""Folders of results that no chapter reads."""


@dataclass(frozen=True)
class Extent:
    """How much a run measures."""

    samples: Mapping[str, int]
    """How many of each: seeds by robot, or turns by contestant and robot. More will do."""
    settings: Mapping[str, Any]
    """What has to be the same for two runs to measure the same."""

    def lacks(self, held: Extent) -> list[str]:
        """Return in words what this run has less of, or does otherwise, than one whose results are stored.

        Example:
            >>> Extent({"Hopper-v5": 10}, {"margin": 0.1}).lacks(Extent({"Hopper-v5": 40}, {"margin": 0.15}))
            ['Hopper-v5: 10 instead of 40', 'margin: 0.1 instead of 0.15']
        """
        fewer = [(name, self.samples.get(name, 0), n) for name, n in held.samples.items()]
        other = [(name, self.settings.get(name), value) for name, value in held.settings.items()]
        found = [each for each in fewer if each[1] < each[2]] + [each for each in other if each[1] != each[2]]
        return [f"{name}: {ours} instead of {theirs}" for name, ours, theirs in found]


def read(path: Path) -> Mapping[str, Any] | None:
    """Return what a JSON file of results holds, or None where there is none."""
    if not path.is_file():
        return None
    found: Mapping[str, Any] = json.loads(path.read_text(encoding="utf8"))
    return found


def aside(folder: Path) -> Path:
    """Return where that goes which must not replace a folder's results; the folder itself if nobody reads it."""
    whole = folder.resolve()
    if not whole.is_relative_to(RESULTS) or set(SCRATCH) & set(whole.relative_to(RESULTS).parts):
        return folder
    return RESULTS / "some" / whole.relative_to(RESULTS)


def place(folder: Path, held: Extent | None, run: Extent) -> tuple[Path, str]:
    """Return where the results of a run go, and in one line why not to the folder that was meant.

    Args:
        folder: that was meant.
        held: what the results stored there measured; None where there are none.
        run: what this run measures.

    Returns:
        The folder, or the one of `aside`; and why, which is empty if it is the folder that was meant.
    """
    lacks = run.lacks(held) if held else []
    target = aside(folder)
    if not lacks or target == folder:
        return folder, ""
    more = f" and {len(lacks) - 3} more" if len(lacks) > 3 else ""
    return (
        target,
        f"Results go to {target}: those stored hold more, or other settings ({', '.join(lacks[:3])}{more}).",
    )


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all, whatever happens meanwhile; its folder is made."""
    from inbounds.learning.storage.whole_files import write_whole  # brings PyTorch: not for `--help`

    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, text.encode())
