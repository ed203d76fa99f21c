"""Graders of the chapter *PPO* (`judging` tells how one works): one for each function of the program that it writes.

A loss is judged by the named checks of `inbounds.book.exercises.checks.ppo`; the verdict names the first that fails. A
whole update is judged by where it takes the weights, beside `inbounds.learning.ppo.update`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.distributions import Normal

from inbounds.book.exercises.checks.ppo import CHECKS, Loss, Scene, policy_loss
from inbounds.book.exercises.checks.small_updates import PPO, SEED, Small, explained
from inbounds.book.exercises.judging import (
    Case,
    Judgement,
    judge_by_checks,
    judge_cases,
    judge_diagnosis,
)

__all__ = ["diagnosis", "loss", "policy", "surrogate", "update"]


def policy(make: Callable[..., Any]) -> Judgement:
    """The policy's density, entropy and divergence: one number a step, whatever the number of motors.

    Args:
        make: the reader's class ``Policy(obs_dim, box, law, squeeze)``.

    Example:
        >>> policy(lambda *arguments: ...)
        … not answered: <lambda>: write it, and run this cell again
    """
    name = getattr(make, "__name__", "Policy")

    def law(outputs: Tensor) -> Normal:
        loc, log_scale = outputs.chunk(2, -1)
        return Normal(loc, log_scale.exp())

    box = SimpleNamespace(
        low=-np.ones(2), high=np.ones(2)
    )  # a map that is not the identity: latents are no actions
    obs, latent = torch.linspace(-1, 1, 15).reshape(5, 3), torch.linspace(-2, 2, 10).reshape(5, 2)
    try:
        made = make(3, box, law, lambda z, low, high: np.tanh(z))
        if not hasattr(made, "net"):
            return Judgement(name, None, "write it, and run this cell again")
        outputs = made.net(obs).detach()
        old = 0.5 * outputs - 0.3
        found = {
            "log_prob": made.log_prob(obs, latent),
            "entropy": made.entropy(obs),
            "kl": made.kl(old, obs),
        }
    except Exception as error:
        return Judgement(name, False, f"it raised {type(error).__name__}: {error}")
    (loc, log_scale), (old_loc, old_log_scale) = outputs.chunk(2, -1), old.chunk(2, -1)
    u = (latent - loc) / log_scale.exp()
    shift = ((loc - old_loc) ** 2 + torch.exp(2 * old_log_scale)) / (2 * torch.exp(2 * log_scale))
    right = {
        "log_prob": -(u**2) / 2 - log_scale - np.log(2 * np.pi) / 2,
        "entropy": log_scale + np.log(2 * np.pi * np.e) / 2,
        "kl": log_scale - old_log_scale + shift - 0.5,
    }
    for method, each in right.items():
        answer = found[method]
        if answer is None or answer is ...:
            return Judgement(name, None, f"write {method}, and run this cell again")
        executed = (
            -((latent.tanh() - loc) ** 2) / 2 / torch.exp(2 * log_scale) - log_scale - np.log(2 * np.pi) / 2
        )
        if complaint := _of_a_law(method, answer, each, executed):
            return Judgement(name, False, f"{method}: {complaint}")
        if not answer.requires_grad:
            return Judgement(name, False, f"{method}: no gradient reaches the policy: detach nothing here")
    return Judgement(name, True, "one number a step: the motors' sum")


def _of_a_law(method: str, answer: Any, each: Tensor, executed: Tensor) -> str:
    """What is wrong with a method's answer, given the right one of each motor `[B, A]`, and that of an action."""
    if not isinstance(answer, Tensor):
        return f"a tensor is wanted, got {type(answer).__name__}"
    total, mean = each.sum(-1), each.mean(-1)
    if answer.shape == each.shape:
        return "a step has one number, not one for each motor: sum over the last axis"
    if answer.shape != total.shape:
        return f"the shape must be [B] = {list(total.shape)}, got {list(answer.shape)}"
    if torch.allclose(answer, total, rtol=1e-4, atol=1e-5):
        return ""
    if torch.allclose(answer, mean, rtol=1e-4, atol=1e-5):
        return "that is the mean over the motors; independent motors *add*"
    if method == "log_prob" and torch.allclose(answer, total.exp(), rtol=1e-4):
        return "that is the density: leave out the exponential"
    if method == "log_prob" and torch.allclose(answer, executed.sum(-1), rtol=1e-4):
        return "score the latent as it was drawn, not the action that became of it"
    if method == "entropy" and torch.allclose(answer, -total, rtol=1e-4):
        return "the sign is wrong: a law's own entropy has no minus before it"
    if method == "kl":
        return "it must be KL(old‖new): the old law comes first, and the new one is that of self.net(obs)"
    return "the value is wrong: ask self.law(self.net(obs)), and about the latent as it is"


def surrogate(function: Callable[..., Any]) -> Judgement:
    """PPO's clipped surrogate: the mean of min(w Â, clip(w) Â).

    Args:
        function: the reader's ``surrogate(policy, batch, advantage, old_log_prob, clip_range)``.

    Example:
        >>> surrogate(lambda policy, batch, advantage, old_log_prob, clip_range: advantage.mean())
        ✗ not yet: <lambda>: there is no ratio in it: exp(new log-probability − old)
    """
    swapped: list[int] = []

    def case(ratio: list[float], advantage: list[float], clip_range: float) -> Case:
        w, a = np.array(ratio), np.array(advantage)
        clipped = np.clip(w, 1 - clip_range, 1 + clip_range)
        old = np.linspace(-1, 1, len(w))
        first, right = w * a, a + clip_range * np.abs(a)  # a capped gain, unlike the chapter's solution
        mistakes = {
            "there is no ratio in it: exp(new log-probability − old)": a,
            "the ratio is upside down: new over old": np.minimum(a / w, right),
            "that is the logarithm of the ratio: take its exponential": np.minimum(np.log(w) * a, right),
            "nothing is clipped: a good action is paid for every rise of its ratio": first,
            "without the minimum, a ratio that moved the wrong way gets no gradient back": clipped * a,
            "take the smaller of the two products, not of the two ratios: it matters where Â < 0": a
            * np.minimum(w, clipped),
            "that is the larger of the two: the surrogate is pessimistic": np.maximum(first, clipped * a),
            "a *quotient* of densities: subtract before you take the exponential, not after": _least(
                np.exp(old + np.log(w)) - np.exp(old), a, clip_range
            ),
            "the clip has two ends, 1 − ε and 1 + ε": np.minimum(first, np.minimum(w, 1 + clip_range) * a),
            "the ratio is clipped to 1 − ε … 1 + ε, about 1 and not about 0": np.minimum(
                first, np.clip(w, -clip_range, clip_range) * a
            ),
            "the ratio is clipped, not its logarithm": np.minimum(
                first, np.exp(np.clip(np.log(w), -clip_range, clip_range)) * a
            ),
            "the ratio is clipped, not its product with the advantage": np.minimum(
                first, np.clip(first, 1 - clip_range, 1 + clip_range)
            ),
            "ε is clip_range, and not always 0.2": _least(w, a, 0.2),
            "that is minus the surrogate: it is maximised; the loss takes the minus": -np.minimum(
                first, right
            ),
        }
        quotient = (old + np.log(w)) / old
        mistakes["a ratio of *densities*: subtract the log-densities, then take the exponential"] = _least(
            quotient, a, clip_range
        )
        expected = np.minimum(first, right)
        values = {words: wrong.mean() for words, wrong in mistakes.items()}
        if len(w) > 1:
            values |= {"that is a sum over the batch: take the mean": expected.sum()}
            centred = (a - a.mean()) / (a.std(ddof=1) + 1e-8)
            wrong = _least(w, centred, clip_range).mean()
            values |= {"the advantages come normalised, or not; leave them as they are here": wrong}
        values |= {"one number is wanted, the mean over the batch": expected}
        values["a number a step meets a number a step in another shape: [B, 1] and [B] make [B, B]"] = (
            np.mean([_least(w, each, clip_range) for each in a])
        )
        new, before = torch.tensor(old + np.log(w), requires_grad=True), torch.tensor(old)
        batch = SimpleNamespace(obs=torch.zeros(len(w), 3), latent=torch.zeros(len(w), 2))

        def log_prob(obs: Any, latent: Any) -> Tensor:
            swapped.extend([1] if obs is batch.latent or latent is batch.obs else [])
            return 1.0 * new

        policy = SimpleNamespace(log_prob=log_prob, new=new, slope=w * a * (first <= right) / len(w))
        return Case((policy, batch, torch.tensor(a), before, clip_range), expected.mean(), values)

    six = [0.5, 1.05, 1.7, 0.5, 1.05, 1.7], [2.0, 1.5, 3.0, -1.0, -0.5, -2.0]
    cases = [case([1.05, 0.9], [2.0, 1.0], 0.2), case(*six, 0.2), case(*six, 0.02)]
    verdict = judge_cases(function, cases, "right, in all six cases")
    complaint = "log_prob takes batch.obs first, then batch.latent" if swapped else ""
    if verdict.passed and not complaint:
        complaint = _of_a_slope(function, cases[1].arguments)
    return Judgement(verdict.exercise, False, complaint) if complaint else verdict


def _least(ratio: np.ndarray, advantage: np.ndarray, clip_range: float) -> np.ndarray:
    """The smaller of the two products, `[B]`, whatever the ratio is."""
    return np.minimum(ratio * advantage, np.clip(ratio, 1 - clip_range, 1 + clip_range) * advantage)


def _of_a_slope(function: Callable[..., Any], arguments: tuple[Any, ...]) -> str:
    """What is wrong with the gradient that a surrogate of the right value sends to the policy."""
    found, new = function(*arguments), arguments[0].new
    slope = None
    if isinstance(found, Tensor) and found.requires_grad:
        (slope,) = torch.autograd.grad(found, new, allow_unused=True)
    if slope is None or not slope.any():
        return "no gradient reaches the policy: nothing of the new log-probability may be detached"
    if not torch.allclose(slope, torch.from_numpy(arguments[0].slope)):
        return "its value is right, its gradient is not: nothing of the new log-probability may be detached"
    return ""


def loss(function: Loss) -> Judgement:
    """PPO's loss of one minibatch, by the named checks.

    Args:
        function: the reader's ``loss(policy, critic, batch, advantage, to_go, old_log_prob, clip_range,
            entropy_coef, value_coef)``.

    Example:
        >>> loss(lambda *arguments: ...)
        … not answered: <lambda>: write it, and run this cell again
    """

    def answered() -> bool:
        return isinstance(policy_loss(function, Scene.of(0)), Tensor)

    return judge_by_checks(function, CHECKS, answered)


def diagnosis(answers: Mapping[str, Any], losses: Mapping[str, Loss]) -> Judgement:
    """Which check stops which broken loss, as the reader predicts it.

    Args:
        answers: the reader's, by loss: the name of the first check that fails.
        losses: the broken losses, under the same names.

    Example:
        >>> diagnosis({"A": ...}, {"A": lambda *_: torch.zeros(3)})
        … not answered: diagnosis: name a check for every loss, and run this cell again
    """
    stopped_before, lets_pass = "an earlier check stops it", "it gets past that one"
    return judge_diagnosis(answers, losses, CHECKS, "loss", stopped_before, lets_pass)


def update(function: Callable[..., Any]) -> Judgement:
    """A whole update: where it takes the weights, beside the package.

    Args:
        function: the reader's ``update(policy, critic, adam, batch, passes, size, clip_range, entropy_coef,
            value_coef)``, which changes the networks in place; it shuffles with `torch.randperm`, once a pass.

    Example:
        >>> update(lambda *arguments, **options: None)
        … not answered: <lambda>: the weights have not moved: write it, and run this cell again
    """
    name = getattr(function, "__name__", "your function")
    small, quiet = (
        Small(),
        Small(unit=0.01),
    )  # the second's gradients are not all cut: the loss's own scale has a say
    before, adam, taken = small.weights(), small.adam(PPO), []
    adam.register_step_post_hook(lambda *_: taken.append(1))
    coefficients = {key: getattr(PPO, key) for key in ("clip_range", "entropy_coef", "value_coef")}
    try:
        for scene, each in ((small, adam), (quiet, quiet.adam(PPO))):
            torch.manual_seed(SEED)
            function(scene.policy, scene.critic, each, scene.batch, passes=3, size=16, **coefficients)
    except Exception as error:
        return Judgement(name, False, explained(error))
    after = small.weights()
    if torch.equal(before, after) and taken:
        order = "zero_grad, backward, clip_grad_norm_, adam.step(), in this order"
        return Judgement(name, False, f"Adam took steps without a gradient, and nothing moved: {order}")
    if torch.equal(before, after) and any(each.grad is not None for each in small.policy.net.parameters()):
        return Judgement(name, False, "there are gradients, and Adam took no step: adam.step() is missing")
    if torch.equal(before, after):
        return Judgement(name, None, "the weights have not moved: write it, and run this cell again")
    if _same(after, small.after_the_packages(PPO)):
        if not _same(quiet.weights(), quiet.after_the_packages(PPO)):
            factor = "right where every gradient is cut to 0.5, wrong where some are shorter: no factor before the loss"
            return Judgement(name, False, factor)
        return Judgement(name, True, "its weights are the package's, after every minibatch of three passes")
    if _same(after, Small().after_a_flawed("on and on")):
        return Judgement(name, True, "its weights are the package's, in another order of the same rows")
    for mistake, flaw in MISTAKES.items():
        if _same(after, Small().after_a_flawed(flaw)):
            return Judgement(name, False, mistake)
    hints = (
        "is torch.randperm called once a pass, and for nothing else? does each piece take its own rows of everything? "
        "are the advantages and the old log-probabilities computed once, before the first step? is the gradient's norm "
        "cut with clip_grad_norm_?"
    )
    return Judgement(
        name, False, f"the weights end elsewhere than the package's, in no way that is known: {hints}"
    )


def _same(a: Tensor, b: Tensor) -> bool:
    return torch.allclose(a, b, rtol=1e-6, atol=1e-8)


MISTAKES: Mapping[str, str] = {
    "the advantages are not normalised": "raw",
    "normalized subtracts the mean and does not divide: by x.std() + 1e-8": "centred",
    "normalized divides and does not subtract the mean": "scaled",
    "normalized divides by the variance: take the standard deviation, x.std()": "variance",
    "the standard deviation is x.std(), torch's own, which divides by n − 1": "population",
    "a bracket is missing in normalized: (x − mean) is divided, not the mean alone": "bracket",
    "the critic's targets are normalised too: only the advantages are": "targets",
    "every step sees the whole batch: give loss the piece, Batch(*(column[index] for column in batch))": "no pieces",
    "the advantages are computed anew in each pass: once, before the first step": "each pass",
    "the advantages are computed anew in each step: once, before the first step": "each step",
    "advantages(batch, critic) returns the advantages first, then the critic's targets": "swapped",
    "advantages are normalised over the whole batch; do it in each minibatch": "whole",
    "the steps are shuffled once; shuffle anew in each pass": "one order",
    "the rows are not shuffled: torch.randperm in each pass": "unshuffled",
    "only one pass is made over the data": "one pass",
    "the old log-probabilities move along, and every ratio is 1: take them once, before the passes": "own density",
    "the old log-probabilities are computed anew in each pass: once, before the first": "density of each pass",
    "it climbs the loss: Adam's step goes down, so nothing needs a minus here": "uphill",
    "gradients add up from step to step: zero_grad before backward": "accumulate",
    "the gradient is not clipped: one norm over both networks, at most 0.5": "free",
    "the gradient is clipped for each network alone: one norm over both": "apart",
    "the entropy bonus is missing, or entropy_coef is not passed on": "no bonus",
    "the coefficients are not passed on to loss": "no coefficients",
    "value_coef is not passed on": "value coef",
    "clip_range is not passed on": "clip range",
}
"""What a grader says → the flaw that leads to these weights."""
