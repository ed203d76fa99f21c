"""Where the time of one epoch goes: robots, acting, and the parts of the update.

Functions of the engine are wrapped by clocks, each of which stops while one inside it runs: the parts add up to the
whole. They count this process's time on the processor, whatever else the machine does; each costs about a microsecond
a call, which the parts that are called every step carry.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.work import ENVS, Work
from benchmarks.worker import one_core, own_cores

EXAMPLES = """
examples:
  python -m benchmarks.anatomy
  python -m benchmarks.anatomy --env Humanoid-v5 --algo trpo --family logit-normal --seeds 1
"""


WHOLE = {"update: natural gradient", "update: line search"}
"""Parts that are not taken apart."""


class Clocks:
    """Clocks of which one runs at a time, in processor time."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._running: list[str] = []
        self._since = time.process_time()

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Count the time within for this part, and not for the one around it, unless that one is to be whole."""
        self._account()
        inside_whole = self._running and self._running[-1] in WHOLE
        self._running.append(self._running[-1] if inside_whole else name)
        try:
            yield
        finally:
            self._account()
            self._running.pop()

    def _account(self) -> None:
        now = time.process_time()
        if self._running:
            name = self._running[-1]
            self.seconds[name] = self.seconds.get(name, 0.0) + now - self._since
        self._since = now

    def around(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function with a clock around it; one that yields is timed while it works, not while it waits."""

        def clocked(*args: Any, **kwargs: Any) -> Any:
            with self.part(name):
                result = function(*args, **kwargs)
            return self._items(name, result) if isinstance(result, Iterator) else result

        return clocked

    def _items(self, name: str, iterator: Iterator[Any]) -> Iterator[Any]:
        while True:
            with self.part(name):
                try:
                    item = next(iterator)
                except StopIteration:
                    return
            yield item


def attach(clocks: Clocks, trainer: Any) -> list[tuple[Any, str, Any]]:
    """Put clocks around the parts of an epoch; return what to undo.

    Args:
        clocks: that will count.
        trainer: a run of the engine.

    Returns:
        Owner, attribute and original of each function that was wrapped.
    """
    import torch

    from inbounds.learning import ppo, trpo
    from inbounds.learning.networks import adam
    from inbounds.learning.updates import value

    collector, envs = trainer.collector, trainer.envs
    parts: list[tuple[Any, str, str]] = [
        (collector, "collect", "acting"),
        (collector, "_act", "acting: network"),
        (envs, "step", "robots: task, resets, infos"),
        (envs._batch, "step", "robots: physics"),
        (envs.task, "feel_contacts", "robots: contact forces"),
        (collector, "_see", "acting: normalisation"),
        (collector, "_rollout", "after the rollout: values, log-probabilities"),
        (ppo, "minibatches", "update: minibatches"),
        (value, "minibatches", "update: minibatches"),
        (ppo, "loss", "update: forward"),
        (trpo, "natural_step", "update: natural gradient"),
        (trpo, "line_search", "update: line search"),
        (trpo, "fit_values", "update: forward"),
        (torch.autograd, "grad", "update: backward"),
        (adam, "clip_gradients", "update: clipping"),
        (trainer.optimizer, "minimize", "update: storing gradients"),
        (trainer.optimizer._adam, "step", "update: Adam"),
        (ppo, "diagnose", "update: diagnostics"),
        (trpo, "diagnose", "update: diagnostics"),
    ]
    undo = []
    for owner, attribute, name in parts:
        original = getattr(owner, attribute)
        undo.append((owner, attribute, original))
        setattr(owner, attribute, clocks.around(name, original))
    return undo


def anatomy(
    work: Work, seeds: int, algo: str = "ppo", family: str = "gaussian", epochs: int = 3
) -> dict[str, float]:
    """Return microseconds per env step of each part, of all seeds together.

    Args:
        work: what to do.
        seeds: trained at once.
        algo: ppo or trpo.
        family: of the policy.
        epochs: that are averaged, after one that warms up.

    Returns:
        Microseconds per env step, by part.
    """
    from benchmarks.contestants import inbounds_config
    from inbounds.learning import Trainer

    trainer = Trainer(inbounds_config(work, algo, seeds, family))
    trainer.epoch()
    clocks = Clocks()
    undo = attach(clocks, trainer)
    try:
        for _ in range(epochs):
            with clocks.part("the rest"):
                trainer.epoch()
    finally:
        for owner, attribute, original in undo:
            setattr(owner, attribute, original)
    steps = epochs * seeds * work.horizon
    return {
        name: 1e6 * seconds / steps for name, seconds in sorted(clocks.seconds.items(), key=lambda x: -x[1])
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Pin this process to a core, measure, and print a table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.anatomy",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--env", default=ENVS[0], help="Gymnasium's id (Hopper-v5)")
    parser.add_argument("--algo", default="ppo", choices=("ppo", "trpo"))
    parser.add_argument("--family", default="gaussian", help="of the policy (gaussian)")
    parser.add_argument("--seeds", type=int, default=10, help="trained at once (10)")
    parser.add_argument("--epochs", type=int, default=3, help="that are averaged (3)")
    parser.add_argument("--horizon", type=int, default=Work.horizon, help="env steps of a rollout (2048)")
    chosen = parser.parse_args(arguments)
    one_core(max(own_cores(parser)))
    parts = anatomy(Work(chosen.env, chosen.horizon), chosen.seeds, chosen.algo, chosen.family, chosen.epochs)
    whole = sum(parts.values())
    table = Table(
        title=f"{chosen.env}, {chosen.algo}, {chosen.family}, {chosen.seeds} seeds: {1e6 / whole:,.0f} steps/s"
    )
    for heading in ("part", "µs per env step", "share"):
        table.add_column(heading, justify="left" if heading == "part" else "right")
    for name, microseconds in parts.items():
        table.add_row(name, f"{microseconds:.2f}", f"{microseconds / whole:.0%}")
    Console().print(table)


if __name__ == "__main__":
    main()
