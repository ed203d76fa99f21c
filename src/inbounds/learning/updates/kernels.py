"""All minibatches of one seed's update in one compiled pass. Needs numba, the extra `fast`.

`ppo_passes` and `value_passes` are what `inbounds.learning.ppo.update` and `fit_values` do by autograd, minibatch for
minibatch: `inbounds.learning.updates.compiled` calls them for each seed.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inbounds.learning.networks.kernels import AdamNumbers, Net, backward, descend, forward, kernel


class Steps(NamedTuple):
    """One seed's rollout, T steps."""

    obs: NDArray[Any]
    """`[T, O]`."""
    latent: NDArray[Any]
    """`[T, A]`."""
    log_prob: NDArray[Any]
    """`[T]` under the policy that drew the latents."""
    advantage: NDArray[Any]
    """`[T]`."""
    return_: NDArray[Any]
    """`[T]`."""


class Batch(NamedTuple):
    """Room for a minibatch, features first."""

    obs: NDArray[Any]
    """`[O, B]`."""
    latent: NDArray[Any]
    """`[A, B]`."""
    old: NDArray[Any]
    """`[B]` log-densities under the policy that drew the latents."""
    advantage: NDArray[Any]
    """`[B]`."""
    return_: NDArray[Any]
    """`[B]`."""
    log_prob: NDArray[Any]
    """`[B]` log-densities now."""
    slope: NDArray[Any]
    """`[2A, B]` derivatives of the entropy by the policy's outputs."""


class PPONumbers(NamedTuple):
    """What a loss is made of, in the networks' precision."""

    clip_range: Any
    entropy_coef: Any
    value_coef: Any
    normalize: Any
    """Whether advantages are normalised in each minibatch."""
    free_scale: Any
    """Whether log σ is a free number: the head's weights for it then stay zero."""
    limits: Any
    """Of the law's parameters: of log σ the least and the largest, of concentrations the largest."""


# Names that `inbounds.learning.updates.compiled` fills, once for each family.
score: Any = None
entropy_slope: Any = None


@kernel
def gather(x: Any, rows: Any, columns: Any) -> None:
    """Fill columns `[F, B]` with some rows of x `[T, F]`."""
    for b in range(len(rows)):
        row = x[rows[b]]
        for i in range(len(row)):
            columns[i, b] = row[i]


@kernel
def normalize(advantage: Any) -> None:
    """Make mean 0 and standard deviation 1 of advantages `[B]`, as `normalize_advantage` does."""
    number, size = advantage.dtype.type, len(advantage)
    total = number(0)
    for b in range(size):
        total += advantage[b]
    mean = total / number(size)
    squares = number(0)
    for b in range(size):
        advantage[b] -= mean
        squares += advantage[b] * advantage[b]
    scale = np.sqrt(squares / number(size - 1)) + number(1e-8)
    for b in range(size):
        advantage[b] /= scale


@kernel
def surrogate_slope(batch: Batch, clip_range: Any) -> None:
    """Turn advantages `[B]` into derivatives of minus the clipped surrogate's mean by `log_prob`.

    −r Â/B, and zero where clipping makes the surrogate flat: beyond 1 + ε with Â > 0, below 1 − ε with Â < 0.
    """
    number, size = batch.advantage.dtype.type, len(batch.advantage)
    high, low = number(1) + clip_range, number(1) - clip_range
    for b in range(size):
        ratio, advantage = math.exp(batch.log_prob[b] - batch.old[b]), batch.advantage[b]
        flat = (advantage > number(0) and ratio > high) or (advantage < number(0) and ratio < low)
        batch.advantage[b] = number(0) if flat else -ratio * advantage / number(size)


def policy_slope(batch: Batch, outputs: Any, delta: Any, numbers: PPONumbers) -> None:
    """Fill delta `[2A, B]` with the loss' derivatives by the policy's outputs."""
    number, size = batch.advantage.dtype.type, len(batch.advantage)
    score(outputs, batch.latent, numbers.limits, batch.log_prob, delta)
    surrogate_slope(batch, numbers.clip_range)
    for i in range(len(delta)):
        for b in range(size):
            delta[i, b] *= batch.advantage[b]
    if numbers.entropy_coef != number(0):
        entropy_slope(outputs, numbers.limits, batch.slope)
        per_step = numbers.entropy_coef / number(size)
        for i in range(len(delta)):
            for b in range(size):
                delta[i, b] -= per_step * batch.slope[i, b]


@kernel
def value_slope(values: Any, return_: Any, delta: Any, coefficient: Any) -> None:
    """Fill delta `[1, B]` with the derivatives of coefficient · mean (V − R)² by the values `[1, B]`."""
    number, size = return_.dtype.type, len(return_)
    factor = number(2) * coefficient / number(size)
    for b in range(size):
        delta[0, b] = factor * (values[0, b] - return_[b])


@kernel
def hold_free_scale(net: Net) -> None:
    """Make zero the gradient of the head's weights for log σ."""
    n_in, n_out = net.sizes[len(net.sizes) - 2], net.sizes[len(net.sizes) - 1]
    at = 0
    for layer in range(len(net.sizes) - 2):
        at += net.sizes[layer + 1] * (net.sizes[layer] + 1)
    net.gradient[at + n_out // 2 * n_in : at + n_out * n_in] = net.theta.dtype.type(0)


def ppo_passes(
    steps: Steps,
    actor: Net,
    critic: Net,
    batch: Batch,
    order: Any,
    numbers: PPONumbers,
    adam: AdamNumbers,
    done: int,
) -> None:
    """Take a step of Adam on each minibatch of `order` `[N, B]`, after `done` steps before."""
    rows = len(actor.deltas) - actor.sizes[len(actor.sizes) - 1], len(critic.deltas) - 1
    for n in range(len(order)):
        chosen = order[n]
        gather(steps.obs, chosen, batch.obs)
        gather(steps.latent, chosen, batch.latent)
        for b in range(len(chosen)):
            batch.old[b] = steps.log_prob[chosen[b]]
            batch.advantage[b] = steps.advantage[chosen[b]]
            batch.return_[b] = steps.return_[chosen[b]]
        if numbers.normalize:
            normalize(batch.advantage)
        policy_slope(batch, forward(actor, batch.obs), actor.deltas[rows[0] :], numbers)
        backward(actor, batch.obs)
        if numbers.free_scale:
            hold_free_scale(actor)
        values = forward(critic, batch.obs)
        value_slope(values, batch.return_, critic.deltas[rows[1] :], numbers.value_coef)
        backward(critic, batch.obs)
        descend((actor, critic), adam, done + n + 1)


def value_passes(steps: Steps, critic: Net, batch: Batch, order: Any, adam: AdamNumbers, done: int) -> None:
    """Move the value network towards the returns: a step of Adam on each minibatch of `order` `[N, B]`."""
    last = len(critic.deltas) - 1
    for n in range(len(order)):
        gather(steps.obs, order[n], batch.obs)
        for b in range(order.shape[1]):
            batch.return_[b] = steps.return_[order[n, b]]
        values = forward(critic, batch.obs)
        value_slope(values, batch.return_, critic.deltas[last:], batch.return_.dtype.type(1))
        backward(critic, batch.obs)
        descend((critic,), adam, done + n + 1)
