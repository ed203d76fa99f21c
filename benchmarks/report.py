"""From raw measurements to ratios, a table and a plot.

A ratio compares what was measured in the same repeat, minutes at most apart; its median over the repeats is the
result and the range over the repeats its spread.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.contestants import CONTESTANTS
from benchmarks.published import write_text


@dataclass(frozen=True)
class Bar:
    """A ratio of steps per second that is asked for."""

    env: str
    ours: str
    theirs: str
    at_least: float


BARS = (
    Bar("Hopper-v5", "inbounds-ppo-10", "sb3-ppo", 6.0),
    Bar("HalfCheetah-v5", "inbounds-ppo-10", "sb3-ppo", 10.0),
    Bar("Ant-v5", "inbounds-ppo-10", "sb3-ppo", 3.0),
    Bar("Humanoid-v5", "inbounds-ppo-10", "sb3-ppo", 2.8),
    Bar("Hopper-v5", "inbounds-trpo-10", "sb3-trpo", 5.0),
    Bar("Hopper-v5", "inbounds-compiled-10", "rltools-ppo", 1.35),
    Bar("HalfCheetah-v5", "inbounds-compiled-10", "rltools-ppo", 1.2),
    Bar("Ant-v5", "inbounds-compiled-10", "rltools-ppo", 1.07),
    Bar("Humanoid-v5", "inbounds-compiled-10", "rltools-ppo", 1.07),
)
FLOOR_AIMS = {"HalfCheetah-v5": 0.6}
"""Of the floor's steps per second, for ten compiled seeds; 0.75 where nothing is said."""
MEMORY_BAR = 2e9  # bytes, of ten seeds on Humanoid

Measurements = Mapping[str, Mapping[str, Sequence[Mapping[str, float]]]]
"""By environment, then by contestant (or "floor"): one measurement per repeat."""


def steps_per_second(
    results: Mapping[str, Any], env: str, name: str, clock: str = "seconds"
) -> NDArray[np.float64]:
    """Return the rate of each repeat `[R]`, by the clock on the wall ("seconds") or the process's ("cpu_seconds")."""
    return np.array([turn["steps"] / turn[clock] for turn in results["measurements"][env][name]])


def ratio(
    results: Mapping[str, Any], env: str, ours: str, theirs: str, clock: str = "seconds"
) -> NDArray[np.float64]:
    """Return ours over theirs of each repeat, `[R]`."""
    return steps_per_second(results, env, ours, clock) / steps_per_second(results, env, theirs, clock)


def spread(values: NDArray[np.float64], digits: int = 2) -> str:
    """Return "median (lowest to highest)".

    Example:
        >>> spread(np.array([3.0, 1.0, 2.0]), digits=1)
        '2.0 (1.0 to 3.0)'
    """
    median, low, high = (f"{x:,.{digits}f}" for x in (np.median(values), values.min(), values.max()))
    return f"{median} ({low} to {high})"


def bars(results: Mapping[str, Any]) -> list[tuple[Bar, NDArray[np.float64]]]:
    """Return each bar that was measured, with its ratios `[R]`."""
    return [
        (bar, ratio(results, bar.env, bar.ours, bar.theirs))
        for bar in BARS
        if {bar.ours, bar.theirs} <= results["measurements"].get(bar.env, {}).keys()
    ]


def label(name: str) -> str:
    """Return a contestant's name in tables."""
    return "the floor" if name == "floor" else CONTESTANTS[name].label


def markdown(results: Mapping[str, Any]) -> str:
    """Return the report: ratios first, then rates, then how it was measured."""
    lines = [
        "# Speed",
        "",
        "Median (range) over the repeats. All rates are env steps per second on one core.",
        "",
    ]
    lines += [
        "## Ratios",
        "",
        "| Environment | Ours | Over | Ratio | By processor time | At least |",
        "|---" * 6 + "|",
    ]
    for bar, values in bars(results):
        verdict = "met" if np.median(values) >= bar.at_least else "**missed**"
        lines.append(_ratio_row(results, bar.env, bar.ours, bar.theirs, f"{bar.at_least:g}: {verdict}"))
    for env, measured in results["measurements"].items():
        if {"inbounds-compiled-1", "rltools-ppo"} <= measured.keys():
            lines.append(_ratio_row(results, env, "inbounds-compiled-1", "rltools-ppo", "–: one seed each"))
    for env, measured in results["measurements"].items():
        for name, aim in (
            ("inbounds-ppo-10", "–"),
            ("inbounds-compiled-10", f"{FLOOR_AIMS.get(env, 0.75):g}"),
        ):
            if {name, "floor"} <= measured.keys():
                lines.append(
                    _ratio_row(results, env, name, "floor", f"{aim}: the aim" if aim != "–" else aim)
                )
    for env, measured in results["measurements"].items():
        lines += ["", f"## {env}", "", "| Who | Steps/s | Over stable-baselines3 |", "|---|---|---|"]
        for name in measured:
            peer = "sb3-trpo" if "trpo" in name else "sb3-ppo"
            relative = spread(ratio(results, env, name, peer)) if peer in measured else "–"
            lines.append(
                f"| {label(name)} | {spread(steps_per_second(results, env, name), 0)} | {relative} |"
            )
    lines += ["", "## How", "", *how(results), ""]
    return "\n".join(lines)


def _ratio_row(results: Mapping[str, Any], env: str, ours: str, theirs: str, verdict: str) -> str:
    clocks = (spread(ratio(results, env, ours, theirs, clock)) for clock in ("seconds", "cpu_seconds"))
    return f"| {env} | {label(ours)} | {label(theirs)} | {' | '.join(clocks)} | {verdict} |"


def how(results: Mapping[str, Any]) -> list[str]:
    """Return what the numbers depend on, a Markdown bullet each: date, machine, versions, work, who is absent."""
    machine, work = results["machine"], results["work"]
    lines = [
        f"* {results['date']}, `{results['command']}`, {results['repeats']} interleaved repeats.",
        f"* {machine['processor']}, {machine['cores']} cores, one used; load average before {machine['load']}.",
        "* " + ", ".join(f"{name} {version}" for name, version in results["versions"].items()) + ".",
        f"* Horizon {work['horizon']}, {work['num_epochs']} passes, minibatches of {work['minibatch_size']}, two "
        f"networks of {' × '.join(map(str, work['hidden']))} tanh units, one thread each.",
    ]
    peak = max((t["peak_bytes"] for t in _memory_turns(results)), default=None)
    if peak is not None:
        lines.append(
            f"* Peak memory of ten seeds on Humanoid: {peak / 1e9:.2f} GB (bar {MEMORY_BAR / 1e9:g} GB)."
        )
    lines.append(
        "* What a turn holds beside training: ours a checkpoint, episode statistics and diagnostics; "
        "stable-baselines3's and SBX's episode statistics and a logger; CleanRL's the numbers of its summary; RLtools' "
        "none of these. RLtools trains one seed, and multiplies by MKL."
    )
    lines += [f"* Not measured: {name} ({why})." for name, why in results["unavailable"].items()]
    return lines


def _memory_turns(results: Mapping[str, Any]) -> Sequence[Mapping[str, float]]:
    return results["measurements"].get("Humanoid-v5", {}).get("inbounds-ppo-10", ())


def plot(results: Mapping[str, Any]) -> tuple[Any, str]:
    """Return a figure, a panel per environment, and its alt text."""
    import matplotlib.pyplot as plt
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    from inbounds.book.drawing import figures

    figures.use_style()
    envs = list(results["measurements"])
    names = [n for n in CONTESTANTS if any(n in results["measurements"][env] for env in envs)]
    height = 0.7 + len(envs) * (0.6 + 0.28 * len(names))
    fig, axes = plt.subplots(len(envs), 1, figsize=(figures.WIDTH, height), sharex=True, squeeze=False)
    for env, ax in zip(envs, axes[:, 0], strict=True):
        for row, name in enumerate(names):
            if name in results["measurements"][env]:
                rate = steps_per_second(results, env, name)
                ours = name.startswith("inbounds")
                color, marker = (figures.SHADES[0], "o") if ours else (figures.SHADES[3], "s")
                ax.plot([rate.min(), rate.max()], [row, row], color=color, linestyle="-")
                ax.plot(np.median(rate), row, color=color, marker=marker, markersize=8)
        if "floor" in results["measurements"][env]:
            floor = np.median(steps_per_second(results, env, "floor"))
            ax.axvline(floor, color=figures.SHADES[2], linestyle="--")
            ax.text(floor, -0.9, "the floor ", color=figures.SHADES[2], ha="right", va="center")
        ax.set(
            yticks=range(len(names)),
            yticklabels=[CONTESTANTS[n].label for n in names],
            ylim=(len(names) - 0.5, -1.4),
        )
        ax.set_title(env, loc="left")
        ax.set(xscale="log")
        ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        ax.xaxis.set_major_formatter(FuncFormatter(lambda rate, _: f"{rate:,.0f}"))
        ax.xaxis.set_minor_formatter(NullFormatter())
    axes[-1, 0].set_xlabel("env steps per second", loc="right")
    facts = [
        f"on {bar.env} {CONTESTANTS[bar.ours].label} is {np.median(values):.1f} times as fast as "
        f"{CONTESTANTS[bar.theirs].label}"
        for bar, values in bars(results)
    ]
    alt = (
        "Bars of environment steps per second by contestant, a panel per environment: "
        + "; ".join(facts)
        + "."
    )
    return fig, alt


def as_json(results: Mapping[str, Any], folder: Path) -> Path:
    """Write `speed.json` alone, whole; return its path."""
    path = folder / "speed.json"
    write_text(path, json.dumps(results, indent=1) + "\n")
    return path


def write(results: Mapping[str, Any], folder: Path) -> list[Path]:
    """Write `speed.json`, `speed.md` and `speed.svg`; return their paths."""
    import matplotlib.pyplot as plt

    paths = [as_json(results, folder), *(folder / f"speed.{suffix}" for suffix in ("md", "svg"))]
    write_text(paths[1], markdown(results))
    fig, alt = plot(results)
    fig.savefig(paths[2], metadata={"Title": alt, "Date": None})
    plt.close(fig)
    return paths
