"""Returns of untrained policies: played once and kept, so that a page says the same on every processor.

`results/untrained.json` holds the returns that a claim or a page reads. Simulated robots are chaotic: played on another
processor, single returns differ, means over seeds agree within their noise (a test plays one again). To make it anew:

    python -c 'from inbounds.study.ledger.untrained_returns import main; main()'
"""

from __future__ import annotations

import dataclasses
import functools
import json
from itertools import product
from pathlib import Path
from typing import Literal

import numpy as np

from inbounds.learning import Trainer, preset
from inbounds.learning.updates.threads import one_thread
from inbounds.study.cell import LOUD_NOISE
from inbounds.study.outcomes import Floats
from inbounds.study.store import ROOT, UNTRAINED, StudyFolder

LOUD = LOUD_NOISE
"""Executed standard deviation, in half ranges: near a Gaussian's default, and near the most a logit-normal can have."""
FILE = ROOT / "results" / UNTRAINED
Mode = Literal["clip", "raw"]
Which = tuple[str, str, float | None, Mode]
KEPT: tuple[Which, ...] = (
    *(
        (family, robot, std, "clip")
        for robot, family, std in product(
            ("HalfCheetah", "Hopper", "Walker2d"), ("gaussian", "beta", "logit-normal"), (0.4, None, LOUD)
        )
        if (family, std) != ("beta", LOUD)  # out of its reach
    ),
    ("gaussian", "HalfCheetah", None, "raw"),
)
"""Family, robot, executed noise and mode of what is kept."""


def untrained(family: str, robot: str, std: float | None = None, mode: Mode = "clip") -> Floats:
    """Return the mean return of each of ten untrained policies in a thousand steps, preset `common`, `[S]`.

    Args:
        family: of the policies.
        robot: its name, as in `inbounds.study.grid.ROBOTS`.
        std: executed noise, in half ranges; None is the family's default.
        mode: whether the action is clipped before the robot and its reward see it.

    Returns:
        As they are kept; played on the spot where they are not among `KEPT`.

    Example:
        >>> untrained("beta", "Hopper").shape
        (10,)
    """
    kept = _kept(FILE)
    name = _name(family, robot, std, mode)
    return np.array(kept[name]) if name in kept else play(family, robot, std, mode)


@functools.cache
def play(family: str, robot: str, std: float | None = None, mode: Mode = "clip") -> Floats:
    """Play what `untrained` returns; it has the arguments.

    Example:
        >>> play("beta", "Swimmer").shape
        (10,)
    """
    config = preset("common", f"{robot}-v5", policy=family, epochs=1)
    policy = dataclasses.replace(config.policy, initial_std=std)
    config = dataclasses.replace(config, policy=policy, action_mode=mode)
    with one_thread():
        return np.array([np.mean(ended) for ended in Trainer(config).collector.collect(1000).episode_returns])


def _name(family: str, robot: str, std: float | None, mode: str) -> str:
    return f"{robot}, {family}, {'default' if std is None else f'{std:g}'}, {mode}"


@functools.cache
def _kept(file: Path) -> dict[str, list[float]]:
    return json.loads(file.read_text(encoding="utf8")) if file.is_file() else {}


def main() -> None:
    """Play all of `KEPT` and write the file, its checksum first."""
    found = {_name(*which): [round(float(x), 4) for x in play(*which)] for which in KEPT}
    StudyFolder(FILE.parent).publish({FILE: (json.dumps(found, indent=1) + "\n").encode()})
