r"""Trust region policy optimisation (Schulman et al. 2015), for S seeds in lockstep.

Each update maximises the surrogate E[r Â] under KL(π_old‖π_θ) ≤ δ. To first order in the objective and to second in the
KL divergence the step is along the natural gradient (Kakade 2001),

$$ θ' − θ = √(2δ / xᵀFx) · x,   F x = g, $$

where g is the surrogate's gradient and F the Fisher information, which *is* the Hessian of the KL divergence at θ_old.
The system is solved by conjugate gradients, which need products F v only (appendix C); a backtracking line search then
checks the two things that were approximated: the exact KL divergence and the surrogate itself.

Everything that could couple seeds is a vector over seeds: the α and β of the conjugate gradients, the length
of the step, the outcome of the search.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import torch
from torch import Tensor

from inbounds.learning.advantages import normalize_advantage
from inbounds.learning.families.family import Parameters
from inbounds.learning.networks.actor_critic import ActorCritic
from inbounds.learning.networks.adam import SeedAdam
from inbounds.learning.networks.perceptron import flatten
from inbounds.learning.rollout import Rollout
from inbounds.learning.updates.checks import check, check_minibatches
from inbounds.learning.updates.diagnostics import diagnose
from inbounds.learning.updates.minibatches import Minibatch
from inbounds.learning.updates.value import fit_values

if TYPE_CHECKING:  # numba is an extra
    from inbounds.learning.updates.compiled import CompiledAdam

Product = Callable[[Tensor], Tensor]
"""Maps vectors `[S, P]`, one per seed, to matrix-vector products `[S, P]`."""

_CACHED = 512
"""States in one piece of a Fisher-vector product, so that what it touches stays in the processor's cache."""


@dataclass(frozen=True)
class TRPOConfig:
    """Every number of TRPO. `TrainConfig` has an example."""

    horizon: int = 2048
    """T, env steps per seed and epoch."""
    learning_rate: float = 3e-4
    """Adam's step size for the value network, constant."""
    adam_eps: float = 1e-5
    """Adam's ε."""
    num_epochs: int = 10
    """Passes of the value regression over the rollout per epoch of training."""
    minibatch_size: int = 64
    """B of the value regression, env steps of each seed; a divisor of the horizon."""
    gamma: float = 0.99
    """Discount γ per env step."""
    gae_lambda: float = 0.95
    """λ of the advantage estimate."""
    entropy_coef: float = 1e-4
    """Weight of the family's entropy in the surrogate, per nat."""
    max_kl: float = 0.01
    """δ, in nats: the largest mean KL(old‖new) of a step."""
    cg_iters: int = 10
    """Iterations of the conjugate gradients."""
    damping: float = 0.1
    """Added to the diagonal of F."""
    backtrack_coef: float = 0.5
    """Factor by which the line search shortens a step."""
    max_backtracks: int = 10
    """Lengths that the line search tries before it gives the step up."""
    fisher: Literal["hessian", "sampled"] = "hessian"
    """F v from the Hessian of the closed-form KL divergence, or from the scores of the drawn latents."""
    normalize_advantage: bool = True
    """Normalise advantages per seed and rollout."""
    max_grad_norm: float | None = 0.5
    """Clip each seed's value gradient to this norm; None never does."""

    def __post_init__(self) -> None:
        check(self, positive=("horizon", "learning_rate", "adam_eps", "num_epochs", "minibatch_size"))
        check(self, positive=("max_kl", "cg_iters", "max_backtracks"), unit=("gamma", "gae_lambda"))
        check(self, not_negative=("entropy_coef", "damping"), positive_or_none=("max_grad_norm",))
        check(self, positive=("backtrack_coef",), unit=("backtrack_coef",))
        together = self.horizon if self.normalize_advantage else None
        check_minibatches(self.horizon, self.minibatch_size, together)
        if self.fisher not in ("hessian", "sampled"):
            raise ValueError(f"fisher must be hessian or sampled, got {self.fisher!r}")


def make_optimizer(networks: ActorCritic, config: TRPOConfig, adam: type[Any] = SeedAdam) -> Any:
    """Return the Adam of the value network; the policy's step is its own."""
    return adam([networks.critic], config.learning_rate, config.adam_eps, config.max_grad_norm)


def kl_hessian_product(networks: ActorCritic, obs: Tensor) -> Product:
    """Return v ↦ F v with F the Hessian of the mean KL(old‖new) at new = old, exact for the given states.

    By two backward passes: the gradient of (∇KL)ᵀv is (∇²KL) v.

    Args:
        networks: the policies.
        obs: `[S, B, O]` the states to average over.

    Returns:
        The product, for v `[S, P]` in the order of `actor.theta`.

    Example:
        >>> import torch
        >>> from inbounds.learning import Trainer, preset
        >>> networks = Trainer(preset("common", "Hopper-v5", seeds=2)).networks
        >>> product = kl_hessian_product(networks, obs=torch.ones(2, 64, 11))
        >>> v = torch.ones_like(networks.actor.theta)
        >>> bool(((v * product(v)).sum(1) > 0).all())  # [S] vᵀFv
        True
    """
    weights = networks.actor.parameters
    gradients = []
    for some in obs.split(_CACHED, 1):
        parameters = networks.parameters(some)
        kl = networks.policy.law.kl(parameters.detach(), parameters).sum(1) / obs.shape[1]
        gradients.append(flatten(torch.autograd.grad(kl.sum(), weights, create_graph=True)))

    def product(v: Tensor) -> Tensor:
        parts = [torch.autograd.grad((g * v).sum(), weights, retain_graph=True) for g in gradients]
        return sum(map(flatten, parts), start=torch.zeros_like(v))

    return product


def sampled_fisher_product(networks: ActorCritic, obs: Tensor, latent: Tensor) -> Product:
    """Return v ↦ F̂ v with F̂ the mean of score·scoreᵀ over the given latents: an unbiased estimate of F.

    sᵀv for each score s, without ever forming one: with weights w on the log-densities, ∇_w (Σ_b w_b s_b)ᵀ v.

    Args:
        networks: the policies that drew the latents.
        obs: `[S, B, O]`.
        latent: `[S, B, A]`, one per state: the noise of the estimate.

    Returns:
        The product, for v `[S, P]` in the order of `actor.theta`.

    (`kl_hessian_product`, whose product is used alike, has an example.)
    """
    weights = networks.actor.parameters
    log_prob = networks.policy.law.log_prob(networks.parameters(obs), latent)
    w = torch.ones_like(log_prob, requires_grad=True)
    weighted_score = flatten(torch.autograd.grad((w * log_prob).sum(), weights, create_graph=True))

    def product(v: Tensor) -> Tensor:
        (along,) = torch.autograd.grad((weighted_score * v).sum(), w, retain_graph=True)  # [S, B] sᵀv
        mean = (along * log_prob).sum() / log_prob.shape[1]
        return flatten(torch.autograd.grad(mean, weights, retain_graph=True))

    return product


def damped(product: Product, damping: float) -> Product:
    """Return v ↦ F v + damping · v, for `conjugate_gradient`, which has an example."""
    return lambda v: product(v) + damping * v


def conjugate_gradient(product: Product, b: Tensor, iterations: int, tolerance: float = 1e-10) -> Tensor:
    """Return x with F x ≈ b for each seed (Hestenes & Stiefel 1952), for symmetric positive definite F.

    Args:
        product: v ↦ F v.
        b: `[S, P]` right-hand sides.
        iterations: as many products are taken.
        tolerance: a seed whose squared residual is below it stands still. For |b|² < 1e-6 it shrinks with |b|².

    Returns:
        `[S, P]`.

    Example:
        >>> import torch
        >>> matrix = torch.tensor([[2.0, 1.0], [1.0, 3.0]])
        >>> x = conjugate_gradient(lambda v: v @ matrix, torch.tensor([[3.0, 4.0], [4.0, 7.0]]), iterations=2)
        >>> x.round(decimals=3).tolist()
        [[1.0, 1.0], [1.0, 2.0]]
    """
    x = torch.zeros_like(b)
    residual, direction = b.clone(), b.clone()
    square = dot(residual, residual)  # [S, 1]
    small = tolerance * (square / 1e-6).clamp(max=1)  # a short right-hand side is not a solved system
    for _ in range(iterations):
        image = product(direction)
        moving = square > small
        alpha = torch.where(moving, square / dot(direction, image), 0)
        x = x + alpha * direction
        residual = residual - alpha * image
        previous, square = square, dot(residual, residual)
        direction = residual + torch.where(moving, square / previous, 0) * direction
    return x


def dot(a: Tensor, b: Tensor) -> Tensor:
    """Return the inner product of each seed's rows, `[S, 1]`, for a and b `[S, P]`."""
    return (a * b).sum(1, keepdim=True)


def surrogate(
    networks: ActorCritic, steps: Rollout | Minibatch, advantage: Tensor, entropy_coef: float
) -> tuple[Tensor, Parameters]:
    """Return E[r Â] + c_H E[H] of each seed, `[S]`, and the law's parameters `[S, T, A]`.

    Args:
        networks: the policies whose surrogate it is.
        steps: `[S, T, ...]`, with the log-densities of the policies that drew them.
        advantage: `[S, T]`.
        entropy_coef: c_H, per nat.

    (`natural_step` has an example.)
    """
    policy = networks.policy
    parameters = networks.parameters(steps.obs)
    ratio = torch.exp(policy.law.log_prob(parameters, steps.latent) - steps.log_prob)
    objective = ratio * advantage
    if entropy_coef:
        objective = objective + entropy_coef * policy.family.entropy(parameters)
    return objective.mean(1), parameters


class LineSearch(NamedTuple):
    """What became of each seed's step, `[S]` each. `natural_step` has an example."""

    accepted: Tensor
    """Booleans: some length satisfied both conditions."""
    fraction: Tensor
    """Of the full step that was taken; 0 where none was."""


@torch.no_grad()
def line_search(
    networks: ActorCritic, steps: Rollout | Minibatch, advantage: Tensor, step: Tensor, config: TRPOConfig
) -> LineSearch:
    """Move each policy along its step, as far as the exact KL divergence and the surrogate allow.

    A length is accepted if KL(old‖new) ≤ δ and the surrogate improves. A seed that finds none stays where it was.

    Args:
        networks: the policies that drew the steps; changed in place.
        steps: `[S, T, ...]`.
        advantage: `[S, T]`.
        step: `[S, P]` full steps.
        config: δ, the factor, the number of tries.

    Returns:
        The outcome.

    (`natural_step` has an example.)
    """
    theta, law = networks.actor.theta, networks.policy.law
    start = theta.clone()
    before, old = surrogate(networks, steps, advantage, config.entropy_coef)
    fraction = torch.zeros(networks.num_seeds, 1, dtype=theta.dtype)
    searching = torch.isfinite(step).all(1, keepdim=True)  # [S, 1]
    for k in range(config.max_backtracks):
        if not searching.any():
            break
        length = config.backtrack_coef**k
        theta.copy_(torch.where(searching, start + length * step, start + fraction * step.nan_to_num()))
        objective, new = surrogate(networks, steps, advantage, config.entropy_coef)
        good = (law.kl(old, new).mean(1) <= config.max_kl) & (objective > before)
        fraction = torch.where(searching & good[:, None], length, fraction)
        searching = searching & ~good[:, None]
    theta.copy_(start + fraction * step.nan_to_num())
    return LineSearch(accepted=(fraction > 0)[:, 0], fraction=fraction[:, 0])


def natural_step(
    networks: ActorCritic, steps: Rollout | Minibatch, advantage: Tensor, config: TRPOConfig
) -> Tensor:
    """Return the full step √(2δ / xᵀFx) · x of each seed, `[S, P]`, with F damped as in the solve.

    Args:
        networks: the policies that drew the steps.
        steps: `[S, T, ...]`.
        advantage: `[S, T]`.
        config: δ, damping, iterations, which Fisher product.

    Returns:
        Steps in the order of `actor.theta`; zero where the gradient is zero.

    Example:
        >>> from inbounds.learning import Trainer, TRPOConfig, preset, trpo
        >>> trainer = Trainer(preset("common", "Hopper-v5", seeds=2))
        >>> networks, steps = trainer.networks, trainer.collector.collect(64)
        >>> advantage, _ = steps.advantages(gamma=0.99, gae_lambda=0.95)
        >>> objective, _ = trpo.surrogate(networks, steps, advantage, entropy_coef=0.0)
        >>> bool(objective.allclose(advantage.mean(1)))  # before the step ratios are 1
        True
        >>> step = natural_step(networks, steps, advantage, TRPOConfig(entropy_coef=0.0))
        >>> product = trpo.damped(trpo.kl_hessian_product(networks, steps.obs), damping=0.1)
        >>> ((step * product(step)).sum(1) / 2).numpy().round(4)  # as long as δ allows: ½ xᵀFx = 0.01
        array([0.01, 0.01], dtype=float32)
        >>> trpo.line_search(networks, steps, advantage, step, TRPOConfig()).accepted
        tensor([True, True])
    """
    objective, _ = surrogate(networks, steps, advantage, config.entropy_coef)
    gradient = flatten(torch.autograd.grad(objective.sum(), networks.actor.parameters))
    if config.fisher == "hessian":
        product = kl_hessian_product(networks, steps.obs)
    else:
        product = sampled_fisher_product(networks, steps.obs, steps.latent)
    product = damped(product, config.damping)
    x = conjugate_gradient(product, gradient, config.cg_iters)
    length = (2 * config.max_kl / dot(x, product(x))).sqrt()
    return torch.where(dot(gradient, gradient) > 0, length * x, 0)


def update(
    networks: ActorCritic,
    optimizer: SeedAdam | CompiledAdam,
    rollout: Rollout,
    generators: Sequence[np.random.Generator],
    config: TRPOConfig,
) -> dict[str, Tensor]:
    """Do one TRPO update: a natural gradient step of the policy, then regression of the values.

    Args:
        networks: changed in place.
        optimizer: of the value network, from `make_optimizer`.
        rollout: `[S, T, ...]`, drawn by these networks.
        generators: one per seed, for the order of the minibatches.
        config: the numbers.

    Returns:
        Diagnostics `[S]`: those of `diagnose`, `accepted` (1 or 0) and `step_fraction` of the line search.
        (`inbounds.learning.policy_gradient.update`, which is called alike, has an example.)

    Raises:
        ValueError: minibatches do not divide the rollout; nothing has changed then.
    """
    check_minibatches(rollout.horizon, config.minibatch_size)
    advantage, return_ = rollout.advantages(config.gamma, config.gae_lambda)
    weights = normalize_advantage(advantage) if config.normalize_advantage else advantage
    step = natural_step(networks, rollout, weights, config)
    search = line_search(networks, rollout, weights, step, config)
    fit_values(networks, optimizer, rollout, return_, generators, config.num_epochs, config.minibatch_size)
    diagnostics, _ = diagnose(networks, rollout, return_)
    return diagnostics | {
        "accepted": search.accepted.to(search.fraction.dtype),
        "step_fraction": search.fraction,
    }
