"""What is wrong with a reader's ``update`` of TRPO: where it takes the weights, beside `inbounds.learning.trpo.update`.

Four updates tell more than one. In the first the full step is taken. In the second it is too long, so that the line
search has to shorten it. In the third no gradient of the critic's is clipped, and Adam does not forget its length: half
the squared error leads to the same weights in the first two, and to others there. In the fourth the step is so long
that KL(old‖new) allows it and KL(new‖old) does not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import torch
from torch import Tensor

from inbounds.book.exercises.checks.small_updates import EDGE, FAR, QUIET, SEED, TRPO, Small
from inbounds.learning import TRPOConfig

__all__ = ["MISTAKES", "complaint"]

NARROW = -2.0
"""Added to log σ where the line search is judged: the curvature is large, and the damping has no say."""


def complaint(function: Callable[..., Any]) -> str | None:
    """Say what is wrong with an update: nothing, "", or None where it has not moved a weight.

    Args:
        function: ``update(policy, critic, adam, batch, max_kl, passes, size)``, which changes the networks in place.

    Example:
        >>> complaint(lambda *arguments, **options: None) is None
        True
    """
    small, far, quiet, edge = Small(), Small(log_scale=NARROW), Small(unit=0.01), Small()
    before = small.weights()
    for scene, config in ((small, TRPO), (far, FAR), (quiet, QUIET), (edge, EDGE)):
        torch.manual_seed(SEED)
        networks, adam = (scene.policy, scene.critic), scene.adam(config)
        function(*networks, adam, scene.batch, max_kl=config.max_kl, passes=3, size=16)
    if torch.equal(before, small.weights()):
        return None
    critic = _of_a_critic(small, TRPO, before) or _of_a_critic(quiet, QUIET, Small(unit=0.01).weights())
    return _of_a_policy(small, before) or _of_a_search(far) or _of_a_direction(edge) or critic


def _same(a: Tensor, b: Tensor) -> bool:
    return torch.allclose(a, b, rtol=1e-6, atol=1e-8)


def _steps_as_the_package(scene: Small, config: TRPOConfig) -> bool:
    """Whether the policy is where the package's step takes it."""
    actor = slice(0, scene.actor_size)
    return _same(scene.weights()[actor], scene.after_the_packages(config)[actor])


def _of_a_policy(small: Small, before: Tensor) -> str:
    """What is wrong with the policy's step."""
    if _steps_as_the_package(small, TRPO):
        return ""
    actor = slice(0, small.actor_size)
    if torch.equal(small.weights()[actor], before[actor]):
        return "the policy has not moved: natural_step, then line_search"
    hints = (
        "are the advantages the *first* of the two that `advantages` returns, and normalised over the whole batch? "
        "is the old policy detached? does the value regression leave it alone?"
    )
    return f"the policy ends elsewhere than the package's: {hints}"


def _of_a_search(far: Small) -> str:
    """What is wrong where the full step is too long."""
    if _steps_as_the_package(far, FAR):
        return ""
    start = Small(log_scale=NARROW)
    with torch.no_grad():
        spent = far.policy.kl(start.policy.net(far.batch.obs), far.batch.obs).mean().item() / FAR.max_kl
    return (
        f"with max_kl = {FAR.max_kl} the full step is too long, and yours spends {spent:.1f} max_kl. Does line_search "
        "take the step, with max_kl? does mean_kl() compare the *old* outputs with the policy as it is then?"
    )


def _of_a_direction(edge: Small) -> str:
    """What is wrong where only KL(old‖new) allows the full step."""
    if _steps_as_the_package(edge, EDGE):
        return ""
    return (
        f"with max_kl = {EDGE.max_kl} its step is another one: mean_kl() is KL(old‖new), "
        "policy.kl(old_outputs, batch.obs).mean()"
    )


def _of_a_critic(scene: Small, config: TRPOConfig, before: Tensor) -> str:
    """What is wrong with the critic's regression."""
    critic = slice(scene.actor_size, None)
    found = scene.weights()[critic]
    if _same(found, scene.after_the_packages(config)[critic]):
        return ""
    if torch.equal(found, before[critic]):
        return "the critic has not learned: passes of `step` over shuffled minibatches"
    for mistake, flaw in MISTAKES.items():
        if _same(found, Small(scene.unit).critic_after_a_flawed(flaw, config)):
            return f"the policy is right; the critic is not: {mistake}"
    hints = (
        "does torch.randperm shuffle, once a pass, and nothing else? is the target the second of the two that "
        "`advantages` returns, the loss its mean squared error?"
    )
    return f"the policy is right; the critic ends elsewhere than the package's: {hints}"


MISTAKES: Mapping[str, str] = {
    "that is half the squared error; its loss is the mean of (critic(obs) − target)², without a factor": "half",
    "that is twice the squared error; its loss is the mean of (critic(obs) − target)², without a factor": "twice",
    "the squared errors are summed: take their mean": "sum",
    "those are absolute errors: square them": "absolute",
    "[B, 1] minus [B] is [B, B]: critic(obs) and the targets both have the shape [B]": "broadcast",
    "it learns the advantages: the targets are the second of the two that `advantages` returns": "advantages",
    "the targets are normalised too: only the advantages are": "targets",
    "the targets are computed anew in each pass: once, before the first step": "each pass",
    "ask it about batch.obs, not about next_obs": "next",
    "every step sees the whole batch: take the piece's rows of batch.obs and of the targets": "no pieces",
    "the rows are shuffled once; shuffle anew in each pass": "one order",
    "the rows are not shuffled: torch.randperm in each pass": "unshuffled",
    "only one pass is made over the data": "one pass",
    "the gradient is not clipped: take `step`, which PPO left you": "free",
}
"""What a grader says → the flaw of the regression that leads to these weights."""
