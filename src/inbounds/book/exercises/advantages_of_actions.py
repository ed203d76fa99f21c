"""Graders of the chapter *Advantages of actions* (`judging` tells how one works)."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import torch

from inbounds.book.exercises.judging import Case, Judgement, judge_cases

__all__ = ["advantages", "half_life", "lambda_returns"]


def half_life(function: Callable[..., Any]) -> Judgement:
    """The number of steps after which a discount has fallen to one half."""

    def case(gamma: float) -> Case:
        right = float(np.log(0.5) / np.log(gamma))
        return Case(
            (gamma,),
            right,
            {
                "the sign is wrong: both logarithms are negative": -right,
                "that is a factor, not a number of steps: take logarithms": gamma / 2,
                "that is 1/(1 − γ), a time too, but not the half-life": 1 / (1 - gamma),
                "numerator and denominator are swapped": 1 / right,
            },
        )

    return judge_cases(function, [case(0.99), case(0.9), case(0.9999)], "right: log ½ / log γ")


def advantages(function: Callable[..., Any]) -> Judgement:
    """The growing program's `advantages`: GAE and its targets, for a batch that ends, is cut, and goes on."""
    rng = np.random.default_rng(0)

    def case(steps: int, ended: tuple[int, ...], cut: tuple[int, ...], gamma: float, lam: float) -> Case:
        value, after, reward = rng.normal(size=(3, steps)) + 1.0
        terminated, truncated = np.zeros((2, steps))
        terminated[list(ended)], truncated[list(cut)] = 1.0, 1.0
        columns = {
            "obs": value[:, None], "latent": value[:, None], "reward": reward, "terminated": terminated,
            "truncated": truncated, "next_obs": after[:, None],
        }  # fmt: skip
        batch = SimpleNamespace(**{name: torch.from_numpy(x.copy()) for name, x in columns.items()})

        def wrong(shown: int = 2, **flaws: bool) -> np.ndarray:
            found = _estimates(value, after, reward, terminated, truncated, gamma, lam, **flaws)
            return np.stack([found, found + value]) if shown == 2 else found

        right = wrong()
        added = _flags_added(value, after, reward, terminated, truncated, gamma, lam)
        mistakes = {
            "a truncated step counts as an end: its residual needs the value of next_obs": wrong(
                cut_ends=True
            ),
            "after a *terminated* step nothing follows: multiply the next value by 1 − terminated": wrong(
                end_goes_on=True
            ),
            "the sum leaks over cuts: it must stop at truncated steps as well": wrong(leaks_at_cuts=True),
            "the sum leaks into the episode before: it must stop at terminated and at truncated steps": wrong(
                leaks=True
            ),
            "residuals further away count (γλ)^l, not λ^l": wrong(no_gamma=True),
            "those are the residuals alone: add what follows, times γλ": wrong(alone=True),
            "return two things: the advantages, and the advantages plus the values": wrong(shown=1),
            "the second result is what the critic learns: the advantage *plus* the value": np.stack(
                [right[0], right[0] - value]
            ),
            "the second result is what the critic learns: the advantage *plus* the value, not the advantage": np.stack(
                [right[0], right[0]]
            ),
            "the order is the other way round: the advantages first, then what the critic learns": right[
                ::-1
            ],
            "what the critic learns is the advantage plus the value of batch.obs, not of next_obs": np.stack(
                [right[0], right[0] + after]
            ),
            "λ is missing: what follows counts γλ, not γ": wrong(no_lam=True),
            "a step can have both flags, and 1 − (terminated + truncated) is −1 there: multiply by (1 − terminated) "
            "and by (1 − truncated)": np.stack([added, added + value]),
            "γ is missing in the residual: it multiplies the value of next_obs": wrong(undiscounted=True),
            "the residual *subtracts* the value of batch.obs": wrong(worth_added=True),
            "the sign of the residual is wrong: r + γ V(next) − V": np.stack([-right[0], value - right[0]]),
            "the loop must run from the last row to the first: an advantage needs the next one": wrong(
                forwards=True
            ),
            "γλ and the masks multiply what follows, not the residual too": wrong(faded=True),
            "the flags of a step decide about what follows *that* step: row t, not row t + 1": wrong(
                late=True
            ),
            "what the critic learns is the advantage plus the value, not the reward plus the next value": np.stack(
                [right[0], reward + gamma * (1 - terminated) * after]
            ),
            "the advantages are normalised later, in the update: leave them as they are here": np.stack(
                [(right[0] - right[0].mean()) / (right[0].std(ddof=1) + 1e-8), right[1]]
            ),
            "the value of next_obs is not that of the next row: behind an end the next row is a new episode": wrong(
                rows=True
            ),
            "the loop runs backwards, so the list is the wrong way round: turn it": np.stack(
                [right[0][::-1], right[0][::-1] + value]
            ),
        }
        return Case((batch, lambda obs: obs[:, 0], gamma, lam), right, mistakes)

    cases = [
        case(5, (), (), 0.9, 0.8),
        case(6, (2,), (), 0.9, 0.8),  # before a cut, because it tells two leaks apart
        case(6, (), (2,), 0.9, 0.8),
        case(12, (1, 8), (4,), 0.97, 0.95),
        case(5, (4,), (), 0.9, 1.0),
        case(6, (2,), (2,), 0.9, 0.8),  # the last step of the clock may also be a fall
    ]
    verdict = judge_cases(function, cases, "right: residuals, summed up to the end of each episode")
    if verdict.passed and _moves_a_critic(function, cases[0].arguments):
        constants = (
            "advantages and targets are constants; yours carry the critic's graph: .detach() both values"
        )
        return Judgement(verdict.exercise, False, constants)
    return verdict


def _moves_a_critic(function: Callable[..., Any], arguments: tuple[Any, ...]) -> bool:
    """Whether a gradient reaches the critic through what `advantages` returns."""
    batch, critic, *numbers = arguments
    weight = torch.ones((), dtype=torch.float64, requires_grad=True)
    try:
        found = function(batch, lambda obs: weight * critic(obs), *numbers)
    except RuntimeError:  # NumPy and in-place writes refuse a graph
        return True
    with_graph = [each for each in found if isinstance(each, torch.Tensor) and each.requires_grad]
    slopes = [torch.autograd.grad(x.sum(), weight, allow_unused=True, retain_graph=True) for x in with_graph]
    return any(slope is not None for (slope,) in slopes)


def _flags_added(
    value: Any, after: Any, reward: Any, terminated: Any, truncated: Any, gamma: float, lam: float
) -> np.ndarray:
    """GAE by its recursion, with 1 − (terminated + truncated) as the mask."""
    residual = reward + gamma * (1 - terminated) * after - value
    keep, total, later = gamma * lam * (1 - (terminated + truncated)), np.zeros(len(reward)), 0.0
    for t in reversed(range(len(reward))):
        total[t] = later = residual[t] + keep[t] * later
    return total


def _by_recursion(
    residual: Any, terminated: Any, truncated: Any, rate: float, forwards: bool, faded: bool, late: bool
) -> np.ndarray:
    """GAE by its recursion, in the wrong direction, with a factor too many, or with the next row's flags."""
    keep = rate * (1 - terminated) * (1 - truncated)
    keep = np.append(keep[1:], 0.0) if late else keep
    total, later, rows = np.zeros(len(residual)), 0.0, range(len(residual))
    for t in rows if forwards else reversed(rows):
        later = keep[t] * (residual[t] + later) if faded else residual[t] + keep[t] * later
        total[t] = later
    return total


def _estimates(
    value: Any,
    after: Any,
    reward: Any,
    terminated: Any,
    truncated: Any,
    gamma: float,
    lam: float,
    *,
    cut_ends: bool = False,
    end_goes_on: bool = False,
    leaks: bool = False,
    leaks_at_cuts: bool = False,
    no_gamma: bool = False,
    no_lam: bool = False,
    alone: bool = False,
    undiscounted: bool = False,
    worth_added: bool = False,
    forwards: bool = False,
    faded: bool = False,
    late: bool = False,
    rows: bool = False,
) -> np.ndarray:
    """GAE by its definition, a sum for each step; flaws on demand."""
    blind = (terminated if not end_goes_on else 0 * terminated) + (truncated if cut_ends else 0.0)
    after = np.append(value[1:], after[-1]) if rows else after
    residual = reward + (1.0 if undiscounted else gamma) * (1 - blind) * after
    residual = residual + value if worth_added else residual - value
    if forwards or faded or late:
        return _by_recursion(residual, terminated, truncated, gamma * lam, forwards, faded, late)
    stops = (0 if leaks else 1) * (terminated + (0 if leaks_at_cuts else 1) * truncated) > 0
    weight = (1.0 if no_gamma else gamma) * (1.0 if no_lam else lam)
    total = np.zeros(len(reward))
    for t in range(len(reward)):
        last = t if alone else next((k for k in range(t, len(reward)) if stops[k]), len(reward) - 1)
        total[t] = sum(weight ** (k - t) * residual[k] for k in range(t, last + 1))
    return total


def lambda_returns(function: Callable[..., Any]) -> Judgement:
    """The λ-returns of a rollout in which episodes end, are cut off, and go on."""
    rng = np.random.default_rng(0)

    def case(ends: dict[int, str], steps: int, gamma: float, lam: float) -> Case:
        reward, next_value = rng.normal(size=(2, steps)) + 1.0
        terminated, truncated = (
            np.array([kind in ends.get(t, "") for t in range(steps)]) for kind in ("terminated", "truncated")
        )
        arguments = (reward, next_value, terminated, truncated, gamma, lam)

        def wrong(**flaws: bool) -> np.ndarray:
            return _forward(*arguments, **flaws)

        mistakes = {
            "both errors are still there: a cut is no end, and neither is the rollout's last step": wrong(
                cut_ends=True, last_ends=True
            ),
            "a truncated step still counts as the end of the world: bootstrap there": wrong(cut_ends=True),
            "the rollout's last step is cut off too: begin with its next value, not with 0": wrong(
                last_ends=True
            ),
            "a *terminated* step has nothing after it: no bootstrap there": wrong(end_bootstraps=True),
            "returns leak from one episode into the one before: start afresh at a truncated step": wrong(
                leaks=True
            ),
        }
        return Case(arguments, wrong(), mistakes)

    cases = [
        case({2: "truncated"}, 6, 0.9, 0.8),  # first, because it tells one error from two
        case({2: "terminated"}, 6, 0.9, 0.8),
        case({}, 5, 0.9, 0.8),
        case({1: "truncated", 4: "terminated", 8: "truncated"}, 12, 0.97, 0.95),
        case({3: "truncated"}, 8, 0.9, 1.0),
        case({2: "terminated, truncated"}, 6, 0.9, 0.8),  # the last step of the clock may also be a fall
    ]
    return judge_cases(function, cases, "right: ends end, cuts do not")


def _forward(
    reward: Any,
    next_value: Any,
    terminated: Any,
    truncated: Any,
    gamma: float,
    lam: float,
    *,
    cut_ends: bool = False,
    last_ends: bool = False,
    end_bootstraps: bool = False,
    leaks: bool = False,
) -> np.ndarray:
    """The λ-return by its definition, a weighted mean of k-step returns; flaws on demand."""
    steps = len(reward)
    ahead = np.where(terminated & (not end_bootstraps), 0.0, next_value)
    if cut_ends:
        ahead = np.where(truncated, 0.0, ahead)
    if last_ends and not terminated[-1] and not truncated[-1]:
        ahead[-1] *= 1 - lam  # (1 − λ) V + λ·0, as a recursion that starts with zero has it
    stops = terminated | (truncated & (not leaks))
    returns = np.zeros(steps)
    for t in range(steps):
        last = next((k for k in range(t, steps) if stops[k]), steps - 1)
        sums = [
            sum(gamma ** (k - t) * reward[k] for k in range(t, j + 1)) + gamma ** (j - t + 1) * ahead[j]
            for j in range(t, last + 1)
        ]
        weights = [(1 - lam) * lam ** (j - t) for j in range(t, last)] + [lam ** (last - t)]
        returns[t] = np.dot(weights, sums)
    return returns
