"""Golden runs: two epochs of every algorithm with every family, in float64, on the analytic point world.

``python -m tests.learning.golden`` writes them anew. Do so only when a change of results is meant, and say so in
CHANGELOG.md.
"""

import json
from pathlib import Path
from typing import Any

from tests.learning.small import ALGORITHMS, FAMILIES, small_config, small_run, weights

PATH = Path(__file__).with_name("golden.json")
METRICS = ("return_mean", "kl", "entropy", "explained_variance", "saturation", "action_std")


def golden_run(algo: str, family: str) -> dict[str, Any]:
    run = small_run(small_config(algo, family, dtype="float64", epochs=2))
    theta = weights(run)
    last = run.records[-1]
    return {
        "weights_norm": theta.norm(dim=1).tolist(),
        "weights_sample": theta[:, ::97].flatten().tolist(),
        **{name: last[name].tolist() for name in METRICS},
    }


def all_runs() -> dict[str, Any]:
    return {f"{algo}/{family}": golden_run(algo, family) for algo in ALGORITHMS for family in FAMILIES}


if __name__ == "__main__":
    PATH.write_text(json.dumps(all_runs(), indent=1) + "\n", encoding="utf8")
