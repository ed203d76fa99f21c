r"""What a policy draws: the law of the latent, one row of a batch for every state.

PPO, TRPO and REINFORCE see nothing of a policy but its law: ratio, score, KL divergence and Fisher information
live here, in latent space. What becomes of the latent is the map's business (`inbounds.learning.families.policy`).
A law has two parameters per action dimension, which the network's last layer feeds:

| Law              | Parameters                          | Latent                                     |
|------------------|-------------------------------------|--------------------------------------------|
| `NORMAL`         | loc μ, log_scale clipped            | z ∈ ℝ                                      |
| `CLIPPED_NORMAL` | the same                            | z ∈ ℝ, scored by what is left after a clip |
| `BETA`           | α, β = 1 + softplus, capped         | x ∈ (0, 1)                                 |

The hard limits are the source thesis' (chapter 4). A clip has gradient zero outside its limits: a network that is
pushed beyond them has no way back but through the other states it serves.

Functions that also run while acting take the array namespace `xp`: torch in an update, NumPy in a rollout, where
a call on a handful of numbers costs a third as much.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.distributions import kl_divergence

from inbounds.distributions import ClippedNormal, ScaledBeta
from inbounds.distributions.scaled_beta import log_beta

Array: TypeAlias = Any  # a Tensor or an NDArray, as `xp` says
Sampler: TypeAlias = Callable[["Parameters", int], NDArray[Any]]
"""Maps the parameters of step t, `[S, A]` each, to the latents `[S, A]`."""

HALF_LOG_2PI = math.log(2 * math.pi) / 2


class Parameters(NamedTuple):
    """The parameters of a law, `[..., A]` each: (loc, log_scale) or (concentration1, concentration0).

    Example:
        >>> Parameters(torch.zeros(3), torch.ones(3)).detach().second.tolist()
        [1.0, 1.0, 1.0]
    """

    first: Array
    second: Array

    def detach(self) -> Parameters:
        """Return the same numbers, cut off from the graph."""
        return Parameters(self.first.detach(), self.second.detach())


@dataclass(frozen=True)
class Limits:
    """Hard limits of a law's parameters.

    Example:
        >>> Limits(log_std_max=0.0).concentration_max
        80.0
    """

    log_std_min: float = -10.0
    """Lower clip of log σ."""
    log_std_max: float = 1.0
    """Upper clip of log σ."""
    concentration_max: float = 80.0
    """Upper cap of a Beta's α and β; a floor under its variance."""

    def __post_init__(self) -> None:
        if not self.log_std_min < self.log_std_max:
            raise ValueError(
                f"log_std_min must be below log_std_max, got {self.log_std_min} and {self.log_std_max}: swap them"
            )
        if not self.concentration_max > 1:
            raise ValueError(
                f"concentration_max must exceed 1, where α and β start, got {self.concentration_max}"
            )


class Law(Protocol):
    """What an algorithm may ask of a law. Leading axes are free; the action axis A is summed over."""

    def parameters(self, outputs: Array, limits: Limits, xp: ModuleType = torch) -> Parameters:
        """Return the parameters for network outputs `[..., 2A]`."""

    def sampler(
        self, generators: Sequence[np.random.Generator], horizon: int, act_dim: int, dtype: Any
    ) -> Sampler:
        """Return what draws the latents of one rollout, seed s from generators[s] alone."""

    def log_prob(self, parameters: Parameters, latent: Tensor) -> Tensor:
        """Return the joint log-density `[...]` of latents `[..., A]`, in nats."""

    def kl(self, old: Parameters, new: Parameters) -> Tensor:
        """Return KL(old‖new) `[...]` of the joint laws, in nats, exact and twice differentiable."""


class NormalLaw:
    """The diagonal Normal: the law of `gaussian` and of `logit-normal`, which differ by their map alone.

    Example:
        >>> parameters = NORMAL.parameters(torch.tensor([0.0, 2.0, -20.0, 0.0]), Limits())
        >>> parameters.first.tolist(), parameters.second.tolist()
        ([0.0, 2.0], [-10.0, 0.0])
        >>> standard = Parameters(torch.zeros(2), torch.zeros(2))
        >>> round(NORMAL.log_prob(standard, torch.zeros(2)).item(), 4)  # −log 2π
        -1.8379
        >>> NORMAL.kl(standard, Parameters(torch.ones(2), torch.zeros(2))).item()
        1.0
    """

    def parameters(self, outputs: Array, limits: Limits, xp: ModuleType = torch) -> Parameters:
        """Return loc and the clipped log_scale, `[..., A]`, for outputs `[..., 2A]`."""
        loc, log_scale = _halves(outputs)
        return Parameters(loc, clip(log_scale, limits.log_std_min, limits.log_std_max))

    def sampler(
        self, generators: Sequence[np.random.Generator], horizon: int, act_dim: int, dtype: Any
    ) -> Sampler:
        """Return z = loc + σ ε; the noise ε of the whole rollout is drawn in one call per seed."""
        noise = np.stack([g.standard_normal((horizon, act_dim), dtype) for g in generators], axis=1)

        def draw(parameters: Parameters, t: int) -> NDArray[Any]:
            return parameters.first + np.exp(parameters.second) * noise[t]

        return draw

    def log_prob(self, parameters: Parameters, latent: Tensor) -> Tensor:
        """Return Σ_A −½u² − log σ − ½log 2π with u = (z − loc)/σ, `[...]`."""
        loc, log_scale = parameters
        u = (latent - loc) * torch.exp(-log_scale)
        return -torch.addcmul(log_scale, u, u, value=0.5).sum(-1) - HALF_LOG_2PI * latent.shape[-1]

    def kl(self, old: Parameters, new: Parameters) -> Tensor:
        """Return Σ_A log(σ'/σ) + (σ² + (μ − μ')²)/(2σ'²) − ½ for new primed, `[...]`."""
        shrink = torch.exp(old.second - new.second)  # σ/σ'
        shift = (old.first - new.first) * torch.exp(-new.second)
        return (new.second - old.second + (shrink.square() + shift.square() - 1) / 2).sum(-1)


class ClippedNormalLaw(NormalLaw):
    """The Normal as a robot that clips to [−1, 1] executes it (CAPG: Fujita & Maeda 2018, section 3).

    It draws the same latents as `NORMAL`, and scores only what the robot sees: beyond a bound, the probability of
    that bound.

    Example:
        >>> standard = Parameters(torch.zeros(1), torch.zeros(1))
        >>> [round(CLIPPED_NORMAL.log_prob(standard, torch.tensor([z])).exp().item(), 4) for z in (1.0, 5.0)]
        [0.1587, 0.1587]
    """

    def log_prob(self, parameters: Parameters, latent: Tensor) -> Tensor:
        """Return Σ_A of the log-probability of a bound, or of the Normal's log-density between them, `[...]`."""
        return clipped_normal(parameters).log_prob_latent(latent).sum(-1)

    def kl(self, old: Parameters, new: Parameters) -> Tensor:
        """Return the KL divergence of the mixed laws, `[...]`; never more than that of the Normals."""
        return kl_divergence(clipped_normal(old), clipped_normal(new)).sum(-1)


class BetaLaw:
    """Independent Betas on [0, 1] with α, β ≥ 1, hence unimodal (Chou, Maturana & Scherer 2017).

    Densities and divergences are evaluated in float64: log-gamma cancels.

    Example:
        >>> parameters = BETA.parameters(torch.tensor([0.0, 1000.0]), Limits())
        >>> [round(x.item(), 4) for x in parameters]  # 1 + log 2, and the cap
        [1.6931, 80.0]
    """

    def parameters(self, outputs: Array, limits: Limits, xp: ModuleType = torch) -> Parameters:
        """Return concentration1 α and concentration0 β, `[..., A]`, for outputs `[..., 2A]`."""
        softplus = torch.nn.functional.softplus(outputs) if xp is torch else np.logaddexp(outputs, 0)
        return Parameters(*_halves(clip(1 + softplus, 1.0, limits.concentration_max)))

    def sampler(
        self, generators: Sequence[np.random.Generator], horizon: int, act_dim: int, dtype: Any
    ) -> Sampler:
        """Return Betas drawn step by step, kept a rounding error away from 0 and 1; NaN for NaN parameters."""
        margin = float(np.finfo(dtype).epsneg)

        def draw(parameters: Parameters, t: int) -> NDArray[Any]:
            latent = np.full((len(generators), act_dim), np.nan)
            for s, generator in enumerate(generators):
                alpha, beta = parameters.first[s], parameters.second[s]
                if np.isfinite(alpha).all() and np.isfinite(beta).all():  # NumPy refuses NaN: a diverged seed
                    latent[s] = generator.beta(alpha, beta)
            return np.clip(latent, margin, 1 - margin).astype(dtype)

        return draw

    def log_prob(self, parameters: Parameters, latent: Tensor) -> Tensor:
        """Return Σ_A (α − 1) log x + (β − 1) log(1 − x) − log B(α, β), `[...]`: `ScaledBeta`'s, at half its cost."""
        alpha, beta = parameters.first.double(), parameters.second.double()
        x = latent.double()
        shape = (alpha - 1) * torch.log(x) + (beta - 1) * torch.log1p(-x)
        return (shape - log_beta(alpha, beta)).sum(-1).to(latent.dtype)

    def kl(self, old: Parameters, new: Parameters) -> Tensor:
        """Return KL(old‖new) in closed form, `[...]`."""
        return kl_divergence(scaled_beta(old), scaled_beta(new)).sum(-1)


NORMAL = NormalLaw()
CLIPPED_NORMAL = ClippedNormalLaw()
BETA = BetaLaw()


def clipped_normal(parameters: Parameters) -> ClippedNormal:
    """Return the law of the unit action min(max(z, −1), 1), elementwise `[..., A]`."""
    return ClippedNormal(parameters.first, parameters.second.exp(), -1.0, 1.0, validate_args=False)


def scaled_beta(parameters: Parameters, low: float = -1.0) -> ScaledBeta:
    """Return the Beta on [low, 1], elementwise `[..., A]`: of the unit action (low = −1) or the latent (low = 0)."""
    return ScaledBeta(parameters.first, parameters.second, low, 1.0, validate_args=False)


def clip(x: Array, low: float, high: float) -> Array:
    """Return x clipped to [low, high]; for NumPy in two ufuncs, which take a third of the time of `np.clip`."""
    return x.clamp(low, high) if isinstance(x, Tensor) else np.minimum(np.maximum(x, low), high)


def _halves(outputs: Array) -> tuple[Array, Array]:
    if isinstance(outputs, Tensor):
        first, second = outputs.chunk(
            2, -1
        )  # its derivative is one concatenation, that of two slices five operations
        return first, second
    act_dim = outputs.shape[-1] // 2
    return outputs[..., :act_dim], outputs[..., act_dim:]
