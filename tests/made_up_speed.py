"""A benchmark's results that nobody measured, for the tests of what is made from them."""

from collections.abc import Mapping
from typing import Any

Turns = list[dict[str, float]]


def turn(steps: int, seconds: float) -> dict[str, float]:
    """One measurement of one contestant."""
    return {"steps": steps, "seconds": seconds, "cpu_seconds": seconds / 2, "peak_bytes": 1.5e9}


def made_up_results(measurements: Mapping[str, Mapping[str, Turns]]) -> dict[str, Any]:
    """Results as `benchmarks.run` writes them, three repeats of each contestant."""
    return {
        "date": "2026-01-01",
        "command": "python -m made_up",
        "machine": {"processor": "P & Q", "cores": 2, "load": [0, 0, 0]},
        "versions": {"torch": "2"},
        "work": {"horizon": 2048, "num_epochs": 10, "minibatch_size": 64, "hidden": [64, 64]},
        "repeats": 3,
        "unavailable": {"sbx-ppo": "No module named 'sbx'"},
        "measurements": measurements,
    }


def ppo_turns() -> dict[str, Turns]:
    """Turns of which the ratio of medians is right only by accident."""
    return {
        "floor": [turn(100, 0.5)] * 3,
        "inbounds-ppo-10": [turn(100, s) for s in (1.0, 2.0, 4.0)],
        "sb3-ppo": [turn(10, s) for s in (1.0, 2.0, 8.0)],
    }
