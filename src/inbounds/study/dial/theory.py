r"""What the laws' closed forms predict for the map, before it is run.

Two deterministic paths, each from the closed forms of `laws` and rates that were fixed on pilot seeds.

* *Geometry alone*: PPO keeps the policy within a distance of the last one, measured by KL divergence, which sees
  the law and no parametrisation. Each epoch is the natural-gradient step with KL divergence κ over all A dimensions.
* *Steps of Adam within the geometry*: Adam moves each output of the network by about the same length, whatever the
  scale of the law; the clip shortens a step whose KL divergence exceeds κ. An output that depends on the state moves
  by v/A per epoch (A as found on pilot seeds), a free log σ by the learning rate times the number of steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Literal, TypeAlias

import numpy as np

from inbounds.learning import Limits, PPOConfig
from inbounds.study.dial.cells import INITIAL_STD, POLICIES, DialCell
from inbounds.study.dial.laws import Pair, expected_return, information, start
from inbounds.study.dial.task import DialTask

Model: TypeAlias = Literal["geometry", "steps"]
MODELS: tuple[Model, ...] = ("geometry", "steps")
_PARTS = 10  # small steps an epoch is made of
_SLOPE = 1e-5  # for central differences
LIMITS = (Limits().log_std_min, Limits().log_std_max)  # of log σ


@dataclass(frozen=True)
class Rates:
    """How far an epoch goes.

    Example:
        >>> Rates().output_step > 0
        True
    """

    divergence: float = 0.03
    """κ, KL divergence of an epoch's step over all dimensions, in nats."""
    output_step: float = 0.3
    """v, distance of an output that depends on the state, per epoch, in one dimension."""


def _gradient(task: DialTask, family: str, outputs: Pair) -> Pair:
    shifts = _SLOPE * np.eye(2)
    return np.array(
        [
            (expected_return(task, family, outputs + h) - expected_return(task, family, outputs - h))
            / (2 * _SLOPE)
            for h in shifts
        ]
    )


def _within(family: str, outputs: Pair) -> Pair:
    return outputs if family == "beta" else np.array([outputs[0], np.clip(outputs[1], *LIMITS)])


def _ascended(task: DialTask, family: str, outputs: Pair, step: Pair) -> Pair:
    """Take a step, or the largest of its halves that earns more; none, if none of ten does."""
    before = expected_return(task, family, outputs)
    for _ in range(10):
        moved = _within(family, outputs + step)
        if expected_return(task, family, moved) > before:
            return moved
        step = step / 2
    return outputs


def _geometry(task: DialTask, family: str, outputs: Pair, rates: Rates) -> Pair:
    """Return the outputs after one part of an epoch along the natural gradient."""
    gradient = _gradient(task, family, outputs)
    natural = np.linalg.lstsq(information(family, outputs), gradient, rcond=1e-12)[0]
    length = math.sqrt(max(float(gradient @ natural), 0.0))
    if length < 1e-9:
        return outputs
    return _ascended(
        task, family, outputs, natural * math.sqrt(2 * rates.divergence / task.dims) / _PARTS / length
    )


def _steps(task: DialTask, family: str, outputs: Pair, rates: Rates, free_step: float | None) -> Pair:
    """Return the outputs after one part of an epoch, each moved by Adam's step, or less where the clip allows less."""
    own = rates.output_step / task.dims
    reach = np.array([own, own if free_step is None else min(free_step, own)])
    reach = reach * np.sign(_gradient(task, family, outputs))
    divergence = task.dims * float(reach @ information(family, outputs) @ reach) / 2
    reach = reach * min(1.0, math.sqrt(rates.divergence / max(divergence, 1e-12))) / _PARTS
    for k in (0, 1):  # each output by itself, as Adam moves it
        outputs = _ascended(task, family, outputs, np.where(np.arange(2) == k, reach, 0.0))
    return outputs


@cache
def predicted_curve(cell: DialCell, model: Model = "steps", rates: Rates | None = None) -> Pair:
    """Return the predicted scores `[E]` of a cell's epochs, before each update.

    Args:
        cell: which; its policy, knobs, epochs and numbers of PPO count, its seeds do not.
        model: "geometry", or "steps" of Adam within it.
        rates: how far an epoch goes; None takes those that were fixed on pilot seeds.

    Example:
        >>> curve = predicted_curve(DialCell("logit-normal", 0.5))
        >>> bool(curve[0] < 0 < 0.9 < curve[-1] <= 1)  # its first noise costs more than doing nothing
        True
    """
    rates = rates or Rates()
    family, state_dependent = POLICIES[cell.policy]
    ppo = cell.config.algorithm
    assert isinstance(ppo, PPOConfig)
    updates = ppo.num_epochs * ppo.horizon // ppo.minibatch_size
    free_step = None if state_dependent else ppo.learning_rate * updates
    outputs, scores = start(family, INITIAL_STD), []
    for _ in range(cell.epochs):
        scores.append(float(cell.task.score(expected_return(cell.task, family, outputs))))
        for _ in range(_PARTS):
            if model == "geometry":
                outputs = _geometry(cell.task, family, outputs, rates)
            else:
                outputs = _steps(cell.task, family, outputs, rates, free_step)
    return np.array(scores)
