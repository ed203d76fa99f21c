r"""What a policy family is: a law for the latent, a map to the action, and what no map leaves in place.

PPO, TRPO and REINFORCE see nothing of a policy but its law: ratio, score, KL divergence and Fisher information
live there, in latent space. One file a family; `inbounds.learning.families.policy` binds one to a box.

Functions that also run while acting take the array namespace `xp`: torch in an update, NumPy in a rollout, where
a call on a handful of numbers costs a third as much.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Protocol, Self, TypeAlias, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.distributions import Distribution

Array: TypeAlias = Any  # a Tensor or an NDArray, as `xp` says
Sampler: TypeAlias = Callable[[Any, int], NDArray[Any]]
"""Maps the parameters of step t, `[S, A]` each, to the latents `[S, A]`."""


@dataclass(frozen=True, eq=False)
class Parameters:
    """The parameters of a law, `[..., A]` each, in the order of the network's outputs; each law has names of its own.

    Example:
        >>> import torch
        >>> from inbounds.learning.families import NormalParameters
        >>> loc, log_scale = NormalParameters(loc=torch.zeros(3), log_scale=torch.ones(3)).detach()
        >>> log_scale.tolist(), NormalParameters.names()
        ([1.0, 1.0, 1.0], ('loc', 'log_scale'))
    """

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return the names, in order."""
        return tuple(field.name for field in dataclasses.fields(cls))

    def __iter__(self) -> Iterator[Array]:
        return iter(vars(self).values())

    def each(self, function: Callable[[Array], Array]) -> Self:
        """Return the parameters after a function of each."""
        return type(self)(*map(function, self))

    def detach(self) -> Self:
        """Return the same numbers, cut off from the graph."""
        return self.each(Tensor.detach)


P = TypeVar("P", bound=Parameters)


@dataclass(frozen=True)
class Limits:
    """Hard limits of a law's parameters, the source thesis' (chapter 4).

    A clip has gradient zero outside its limits: a network that is pushed beyond them has no way back but through the
    other states it serves.

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
        for name in ("log_std_min", "log_std_max", "concentration_max"):
            # Beside a number of NumPy's, which has a precision, float32 actions would be computed in float64.
            try:
                object.__setattr__(self, name, float(value := getattr(self, name)))
            except (TypeError, ValueError):
                raise ValueError(f"{name} must be a number, got {value!r}") from None
        if not max(abs(self.log_std_min), abs(self.log_std_max)) < 88:
            raise ValueError(
                "log_std_min and log_std_max must lie within ±88, where single precision has a σ, got "
                f"{self.log_std_min} and {self.log_std_max}"
            )
        if not self.log_std_min < self.log_std_max:
            raise ValueError(
                f"log_std_min must be below log_std_max, got {self.log_std_min} and {self.log_std_max}: swap them"
            )
        if not 1 < self.concentration_max < math.inf:
            raise ValueError(
                f"concentration_max must exceed 1, where α and β start, and be finite, got {self.concentration_max}"
            )


class Law(Protocol[P]):
    """What an algorithm may ask of a law. Leading axes are free; the action axis A is summed over."""

    named: type[P]
    """Its parameters, by name."""

    def parameters(self, outputs: Array, limits: Limits, xp: ModuleType = torch) -> P:
        """Return the parameters for network outputs `[..., 2A]`."""

    def sampler(
        self, generators: Sequence[np.random.Generator], horizon: int, act_dim: int, dtype: Any
    ) -> Sampler:
        """Return what draws the latents of one rollout, seed s from generators[s] alone."""

    def log_prob(self, parameters: P, latent: Tensor) -> Tensor:
        """Return the joint log-density `[...]` of latents `[..., A]`, in nats."""

    def kl(self, old: P, new: P) -> Tensor:
        """Return KL(old‖new) `[...]` of the joint laws, in nats, exact and twice differentiable."""

    def describe(self, parameters: P, limits: Limits) -> dict[str, NDArray[Any]]:
        """Return what a study records of NumPy parameters `[S, T, A]`: quantiles, shares at the limits, `[S]`."""


@dataclass(frozen=True)
class Family:
    """One row of the table in `inbounds.learning.families.policy`.

    Args:
        name: under which `PolicyConfig` knows it.
        law: of the latent.
        to_unit: the map from latents `[..., A]` to unit actions; called with the latents and `xp`.
        entropy: of parameters `[..., A]`, summed over A: `[...]`, in nats.
        greedy: ways to act without noise, by name: parameters `[..., A]` to unit actions `[..., A]`.
        distribution: of the action, elementwise: parameters `[..., A]` and the box's low and high `[A]`.
        executed_std: standard deviation of the executed unit action, of a law centred in the box, by its scale.
        scales: the scales of the least and of the most noise within the limits.
        head_bias: the inverse of `executed_std`, as the two outputs of the network that give such a law.
        kernels: the module with `score` and `entropy_slope` for the engine `compiled`; None has no such engine.
    """

    name: str
    law: Law[Any]
    to_unit: Callable[[Array, ModuleType], Array]
    entropy: Callable[[Any], Tensor]
    greedy: Mapping[str, Callable[[Any], Tensor]]
    distribution: Callable[[Any, Tensor, Tensor], Distribution]
    executed_std: Callable[[float], float]
    scales: Callable[[Limits], tuple[float, float]]
    head_bias: Callable[[float, Limits], tuple[float, float]]
    kernels: str | None = None


def clip(x: Array, low: float, high: float) -> Array:
    """Return x clipped to [low, high]; for NumPy in two ufuncs, which take a third of the time of `np.clip`."""
    return x.clamp(low, high) if isinstance(x, Tensor) else np.minimum(np.maximum(x, low), high)


def halves(outputs: Array) -> tuple[Array, Array]:
    """Return outputs `[..., 2A]` as two `[..., A]`."""
    if isinstance(outputs, Tensor):
        one, other = outputs.chunk(
            2, -1
        )  # its derivative is one concatenation, that of two slices five operations
        return one, other
    act_dim = outputs.shape[-1] // 2
    return outputs[..., :act_dim], outputs[..., act_dim:]


def quantiles(name: str, values: NDArray[Any], percents: Sequence[int]) -> dict[str, NDArray[Any]]:
    """Return quantiles `[S]` of values `[S, T, A]`, by names like `scale_q50`."""
    found = np.quantile(values, np.array(percents) / 100, axis=(1, 2))  # [Q, S]
    return {f"{name}_q{percent:02}": found[i] for i, percent in enumerate(percents)}
