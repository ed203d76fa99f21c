"""What benchmark, validation and anchor found, as the book shows it; what was not measured is called missing.

`make bench` writes `speed.json`; `python -m benchmarks.validate` and `python -m benchmarks.anchor` write their verdicts
and `curves.parquet`, all below `benchmarks/results`. Ratios, medians and plots are those of `benchmarks`; here they
become a page's tables. The benchmark is part of the source tree and not of the installed package::

    results = speed.read_speed()  # None: nobody has measured yet
    speed.ratio_table(results)

The text form of a table holds no number: the stored notebook stays the same when the benchmark is run again.
"""

from __future__ import annotations

import dataclasses
import importlib
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, TypeAlias

import numpy as np

from inbounds.book.drawing import alt_text
from inbounds.book.report.html import Shown, bullets, missing, table, with_code
from inbounds.study.words import number, p_value, percent

ROOT = Path(__file__).resolve().parents[4]  # src/inbounds/book/report/speed.py
RESULTS = ROOT / "benchmarks" / "results"

Results: TypeAlias = Mapping[str, Any]
"""What a JSON file of measurements holds."""

OURS = "inbounds-ppo-10"
COMPILED = "inbounds-compiled-10"
COMPARISONS = (
    (OURS, "sb3-ppo"),
    (OURS, "sb3-ppo-plain"),
    (OURS, "sbx-ppo"),
    (OURS, "cleanrl-ppo"),
    (OURS, "inbounds-ppo-1"),
    ("inbounds-trpo-10", "sb3-trpo"),
    (COMPILED, OURS),
    (COMPILED, "rltools-ppo"),
    ("inbounds-compiled-1", "rltools-ppo"),
    (OURS, "floor"),
    (COMPILED, "floor"),
)
"""Rows of the table of ratios: who, over whom."""
NO_SPEED = (
    "Not measured in this copy of the book. `make bench` measures it (twenty-five minutes on a quiet machine) and "
    "writes `benchmarks/results/speed.json`; then build the book again."
)
NO_VALIDATION = (
    "Not measured in this copy of the book. `python -m benchmarks.validate` trains both sides (about 45 minutes on two "
    "cores) and writes `benchmarks/results/validation`; then build the book again."
)
NO_ANCHOR = (
    "Not measured in this copy of the book. `python -m benchmarks.anchor` trains both sides (many hours) and writes "
    "`benchmarks/results/anchor`; then build the book again."
)
AS_ABOVE = "Missing, like the table."
SPEED_ALT = (
    "Environment steps per second on one core on a logarithmic axis, a panel per robot and a row per contestant: "
    "median as a marker, range over the repeats as a line, the floor as a dashed vertical line."
)
VALIDATION_ALT = (
    "Return in training, averaged over ten epochs, against env steps, a panel per robot: mean and 95 percent interval "
    "over seeds of this engine, a solid line, and of stable-baselines3, a dashed line."
)
ANCHOR_ALT = f"Over a million steps: {VALIDATION_ALT[0].lower()}{VALIDATION_ALT[1:]}"


def read_speed(folder: Path = RESULTS) -> Results | None:
    """Return what `make bench` measured, or None if there is no `speed.json` in the folder."""
    return _read(folder / "speed.json")


def read_validation(folder: Path = RESULTS / "validation") -> Results | None:
    """Return the validation's verdicts, or None; the curves' table is added as `curves`."""
    return _with_curves(folder / "validation.json")


def read_anchor(folder: Path = RESULTS / "anchor") -> Results | None:
    """Return the verdicts of the second study's anchor, or None; the curves' table is added as `curves`."""
    return _with_curves(folder / "anchor.json")


def ratio_table(results: Results | None) -> Shown:
    """Return the ratios of steps per second, a column per robot: median and range over the repeats.

    Args:
        results: from `read_speed`.

    Example:
        >>> ratio_table(None)
        <speed: ratios>
    """
    what = "speed: ratios"
    if results is None:
        return _missing(what, NO_SPEED)
    report, measured = _benchmarks("report"), results["measurements"]
    rows = []
    for ours, theirs in COMPARISONS:
        there = [{ours, theirs} <= measured[env].keys() for env in measured]
        if any(there):
            cells = [
                report.spread(report.ratio(results, env, ours, theirs)).replace(" (", "\n(") if has else "–"
                for env, has in zip(measured, there, strict=True)
            ]
            rows.append([f"{_label(ours)},\nover {_label(theirs)}", *cells])
    caption = (
        f"Steps per second, ratios: median (range) of {results['repeats']} interleaved repeats on one core."
    )
    robots = [env.partition("-")[0] for env in measured]
    return Shown(what, [table(caption, ["Who, over whom", *robots], rows)])


def median_ratio(results: Results, env: str, ours: str, theirs: str) -> float:
    """Return the median over the repeats of one contestant's steps per second over another's.

    Args:
        results: from `read_speed`.
        env: a robot.
        ours: name of a contestant of the benchmark.
        theirs: another.
    """
    return float(np.median(_benchmarks("report").ratio(results, env, ours, theirs)))


def how_measured(results: Results | None) -> Shown:
    """Return the circumstances of the benchmark: date, command, machine, versions, work, who could not take part."""
    what = "speed: how it was measured"
    if results is None:
        return _missing(what, AS_ABOVE)
    lines = [line.removeprefix("* ") for line in _benchmarks("report").how(results)]
    return Shown(what, [with_code(bullets(lines))])


def show_speed(results: Results | None) -> None:
    """Put the plot of steps per second, with the floor, on the page, or the word that it is missing.

    Args:
        results: from `read_speed`.
    """
    if results is None:
        return _show_missing(SPEED_ALT)
    fig, _ = _benchmarks("report").plot(results)
    return alt_text.show(fig, SPEED_ALT)


def verdict_table(validation: Results | None) -> Shown:
    """Return the verdicts of the two one-sided tests, a row per robot.

    Args:
        validation: from `read_validation`.
    """
    what = "validation: verdicts"
    if validation is None:
        return _missing(what, NO_VALIDATION)
    who = _benchmarks("validate")
    head = [
        "Robot",
        "In Bounds",
        who.PEER,
        "ratio (90 % interval)",
        "p",
        f"within ± {percent(validation['margin'])}",
    ]
    rows = [[env, *_verdict(found, who)] for env, found in validation["verdicts"].items()]
    seeds = ", ".join(f"{count} on {env}" for env, count in validation["seeds"].items())
    caption = (
        f"Mean area under the learning curve ± standard deviation over seeds a side ({seeds}), "
        f"{validation['env_steps']:,} env steps each."
    )
    return Shown(what, [table(caption, head, rows, words=(0, 5))])


def above_the_start(validation: Results, env: str) -> dict[str, Any]:
    """Return the areas between the learning curves and where they start, compared as the validation compares areas.

    A return's zero is a convention of the task. Areas above the start, the mean return of the first epoch over all
    seeds of both sides, do not depend on it.

    Args:
        validation: from `read_validation`.
        env: one of its robots.

    Returns:
        `start`, `margin` (the share of the peer's mean area, in returns), and the fields of
        `benchmarks.equivalence.Equivalence` for the areas above the start.
    """
    who, test = _benchmarks("validate"), _benchmarks("equivalence")
    returns = [who.curves(validation["curves"], env, side) for side in (who.OURS, who.PEER)]
    ours, theirs = (test.area(each) for each in returns)
    start = float(np.nanmean(np.concatenate([each[:, 0] for each in returns])))
    found = test.equivalence(ours - start, theirs - start, validation["margin"])
    return {
        "start": start,
        "margin": float(validation["margin"] * theirs.mean()),
        **dataclasses.asdict(found),
    }


def show_validation(validation: Results | None) -> None:
    """Put both sides' learning curves on the page, or the word that they are missing.

    Args:
        validation: from `read_validation`.
    """
    _show_curves(validation, VALIDATION_ALT)


def anchor_table(anchor: Results | None) -> Shown:
    """Return the verdicts on the anchor's two sides, a row per robot.

    Args:
        anchor: from `read_anchor`.

    Example:
        >>> anchor_table(None)
        <anchor: verdicts>
    """
    what = "anchor: verdicts"
    if anchor is None:
        return _missing(what, NO_ANCHOR)
    who = _benchmarks("validate")
    head = ["Robot", "In Bounds", who.PEER, "difference (90 % interval)", "margin", "p", "verdict"]
    rows = [[env, *_compared(found, who)] for env, found in anchor["verdicts"].items()]
    seeds = ", ".join(f"{count} on {env}" for env, count in anchor["seeds"].items())
    caption = (
        "Mean area under the learning curve, less where the curves start, ± standard deviation over seeds a side "
        f"({seeds}), {anchor['env_steps']:,} env steps each."
    )
    return Shown(what, [table(caption, head, rows, words=(0, 6))])


def show_anchor(anchor: Results | None) -> None:
    """Put the learning curves of the anchor's sides on the page, or the word that they are missing.

    Args:
        anchor: from `read_anchor`.
    """
    _show_curves(anchor, ANCHOR_ALT)


def _show_curves(results: Results | None, alt: str) -> None:
    if results is None:
        return _show_missing(alt)
    fig, _ = _benchmarks("validate").plot(results["curves"], results["verdicts"])
    return alt_text.show(fig, alt)


def _compared(found: Results, who: ModuleType) -> Sequence[str]:
    means = [f"{number(found[side]['mean'])} ± {number(found[side]['std'])}" for side in (who.OURS, who.PEER)]
    margin = f"± {number(found['margin'])}"
    if "reason" in found:
        return [*means, "–", margin, "–", f"undecided: {found['reason']}"]
    word, (low, high) = found["word"], found["interval_90"]
    if word == "undecided":
        word += f"; with equal means {found['seeds_needed']} seeds a side would show them equivalent in 8 of 10 cases"
    difference = f"{number(found['difference'])} [{number(low)}, {number(high)}]"
    return [*means, difference, margin, p_value(found["p_value"]), word]


def _verdict(found: Results, who: ModuleType) -> Sequence[str]:
    means = [f"{found[side]['mean']:,.0f} ± {found[side]['std']:,.0f}" for side in (who.OURS, who.PEER)]
    if "undecided" in found:
        return [*means, "–", "–", f"undecided: {found['undecided']}"]
    verdict = "equivalent"
    if not found["equivalent"]:
        verdict = (
            f"not shown; with equal means {found['seeds_needed']} seeds a side would show it in 8 of 10 cases"
        )
    ratio = f"{found['ratio']:.2f} [{found['low']:.2f}, {found['high']:.2f}]"
    return [*means, ratio, f"{found['p_value']:.3f}", verdict]


def _read(path: Path) -> Results | None:
    if not path.is_file():
        return None
    found: Results = json.loads(path.read_text(encoding="utf8"))
    return found


def _with_curves(verdicts: Path) -> Results | None:
    found, path = _read(verdicts), verdicts.with_name("curves.parquet")
    if found is None or not path.is_file():
        return None
    import pyarrow.parquet as pq

    return {**found, "curves": pq.read_table(path)}


def _missing(what: str, why: str) -> Shown:
    return Shown(what, [with_code(missing(why))])


def _show_missing(alt: str) -> None:
    """Say on the page that a figure is missing; in the stored notebook it reads like the figure itself."""
    from IPython.display import display

    display({"text/html": missing(AS_ABOVE), "text/plain": f"Figure: {alt}"}, raw=True)


def _label(name: str) -> str:
    """Return a contestant's name; "… and so on" gets its beginning, for no line above may have it."""
    label: str = _benchmarks("report").label(name)
    start = "In Bounds PPO, " if name.startswith("inbounds") else "stable-baselines3 PPO, "
    return label.replace("… ", start)


def _benchmarks(name: str) -> ModuleType:
    """Return a module of the source tree's folder of benchmarks, which no installed package holds.

    Raises:
        ModuleNotFoundError: this package was installed without its source tree.
    """
    if not (ROOT / "benchmarks" / f"{name}.py").is_file():
        raise ModuleNotFoundError(
            "the benchmarks are not part of the installed package: clone the project, and `pip install -e .` in it"
        )
    before = sys.path[:]
    sys.path.append(str(ROOT))
    try:
        return importlib.import_module(f"benchmarks.{name}")
    finally:
        sys.path[:] = before
