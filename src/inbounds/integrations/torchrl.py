r"""The laws of the book as policies of TorchRL: `bounded_actor` makes the two modules that a loss and a rollout need.

TorchRL's losses score what lies under a key of the batch. An actor that writes the action there, as one with TorchRL's
own `TanhNormal` does, has the loss invert the map from an action that may have been rounded onto its bound. Here the
actor writes the *latent* and its score, the loss reads the latent, and one more module makes the action of it for the
environment:

    actor, acting = bounded_actor(network, LogitNormal, low, high)
    loss = ClipPPOLoss(actor, critic)       # finds "latent" and "latent_log_prob" by itself
    with torch.no_grad():
        batch = env.rollout(1000, acting)   # draws, writes both, and "action"

`quiet_actor` makes the two with a quiet start: centred in the box, with as much executed noise as is asked for.

The first is for on-policy losses, such as `ClipPPOLoss` and `A2CLoss`; the second for rollouts and collectors.
`ReinforceLoss` does not ask the actor for its keys, and would score actions as latents: call
`loss.set_keys(action="latent")` first. A loss that draws actions itself, such as `SACLoss`, can use neither.

Importing TorchRL switches off the checks of arguments of *every* torch distribution, those of this package included: an
action beyond its bounds then raises nothing. `torch.distributions.Distribution.set_default_validate_args` switches them
on again. What the network of an actor gives is checked here all the same, but not inside `torch.compile`.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, ClassVar

import torch
from torch import Tensor, nn
from torch.distributions import Distribution, constraints, kl_divergence, register_kl

from inbounds.distributions import LogitNormal, ScaledBeta
from inbounds.distributions.bounds import TensorLike, require_bounds
from inbounds.distributions.scaled_beta import before_softplus
from inbounds.integrations.quiet import quiet_concentration, quiet_scale

try:
    from tensordict.nn import TensorDictModule, TensorDictSequential
    from torchrl.envs.utils import ExplorationType
    from torchrl.modules import NormalParamExtractor, ProbabilisticActor
except ImportError as error:
    raise ImportError('TorchRL is not installed: pip install ".[integrations]" in the source tree') from error

__all__ = ["PARAMETERS", "Latents", "bounded_actor", "quiet_actor"]

PARAMETERS: Mapping[type[LogitNormal | ScaledBeta], tuple[str, str]] = MappingProxyType(
    {LogitNormal: ("loc", "scale"), ScaledBeta: ("concentration1", "concentration0")}
)
"""The two parameters `[..., A]` that a network must give for each law, in order."""


LEAST_SCALE = 0.0101
"""A little above 0.01, the smallest σ that the `biased_softplus` maps of TorchRL's `NormalParamExtractor` give."""


class Latents(Distribution):
    """The latents `[..., A]` of a law's independent components, scored as the actions that they stand for.

    Args:
        law: of the action, batch shape `[..., A]`.

    Example:
        >>> import torch
        >>> from inbounds.distributions import LogitNormal
        >>> law = LogitNormal(torch.zeros(2), 1.0, torch.tensor([0.0, -2.0]), torch.tensor([8.0, 1.0]))
        >>> latents = Latents(law)
        >>> latents.event_shape, latents.deterministic_sample.tolist()
        (torch.Size([2]), [0.0, 0.0])
        >>> action = law.latent_to_value(torch.ones(2))
        >>> bool(torch.isclose(latents.log_prob(torch.ones(2)), law.log_prob(action).sum()))
        True
    """

    arg_constraints: ClassVar[dict[str, constraints.Constraint]] = {}

    def __init__(self, law: LogitNormal | ScaledBeta) -> None:
        self.law = law
        self.has_rsample = law.has_rsample
        super().__init__(law.batch_shape[:-1], law.batch_shape[-1:], validate_args=False)

    def rsample(self, sample_shape: Any = ()) -> Tensor:
        """Return reparametrised latents `[*sample_shape, ..., A]`."""
        return self.law.rsample_latent(sample_shape)

    def log_prob(self, value: Tensor) -> Tensor:
        """Return the log-density `[...]` of the *actions* that latents `[..., A]` stand for, in nats."""
        return self.law.log_prob_latent(value).sum(-1)

    def entropy(self) -> Tensor:
        """Return the differential entropy `[...]` of the action in its box, in nats."""
        return self.law.entropy().sum(-1)

    @property
    def mean(self) -> Tensor:
        """What `ExplorationType.MEAN` would ask for, in vain: TorchRL would map a mean of latents, which is no mean.

        Raises:
            ValueError: always.
        """
        raise ValueError("a mean of latents is no mean of actions: use ExplorationType.MEDIAN")

    @property
    def median(self) -> Tensor:
        """`[..., A]` the latents of the medians: `ExplorationType.MEDIAN`. A Beta's are SciPy's."""
        law = self.law
        return law.loc if isinstance(law, LogitNormal) else law.value_to_latent(law.median)

    @property
    def mode(self) -> Tensor:
        """What `ExplorationType.MODE` would ask for, in vain: the mode of latents is not that of actions.

        Raises:
            ValueError: always.
        """
        raise ValueError("a mode of latents is no mode of actions: use ExplorationType.MEDIAN")

    @property
    def deterministic_sample(self) -> Tensor:
        """`[..., A]` the latents of a logit-normal's median, or of a Beta's mean: TorchRL's deterministic action."""
        law = self.law
        return (
            law.loc if isinstance(law, LogitNormal) else law.concentration1.log() - law.concentration0.log()
        )


@register_kl(Latents, Latents)
def _kl_latents_latents(p: Latents, q: Latents) -> Tensor:
    """KL(p‖q) of the laws of the action, `[...]`, in nats: exact, where TorchRL would estimate it from a sample."""
    return kl_divergence(p.law, q.law).sum(-1)


def bounded_actor(
    network: nn.Module,
    law: type[LogitNormal | ScaledBeta],
    low: TensorLike,
    high: TensorLike,
    in_keys: Sequence[str] | str = ("observation",),
) -> tuple[ProbabilisticActor, TensorDictSequential]:
    """Return a policy with bounded actions, once for the loss and once for the environment; they share the network.

    Args:
        network: from what is under `in_keys` to the two parameters of `PARAMETERS[law]`, `[..., A]` each, all but
            `loc` positive: TorchRL's `NormalParamExtractor` sees to that for a `LogitNormal`, not for a `ScaledBeta`.
            (`quiet_actor` brings the heads of both.)
        law: `LogitNormal` or `ScaledBeta`.
        low: `[A]` lower bounds of the action, in its own units.
        high: `[A]` upper bounds.
        in_keys: what the network reads.

    Returns:
        First the actor for a loss, which writes the parameters, `latent` `[..., A]` and `latent_log_prob` `[...]`.
        Second the same followed by the module that writes `action` `[..., A]`, to act with. Both draw, unless
        `set_exploration_type` says otherwise (TorchRL's own actors act without noise then).

    Raises:
        ValueError: another law, or bounds that are not finite, not in order, too close for a number of the network's
            type between them, or of several axes; when it acts, a network that gives another number of outputs, NaN,
            ∞, or a parameter that is not positive.

    Example:
        >>> import torch
        >>> from tensordict import TensorDict
        >>> from torch import nn
        >>> from torchrl.modules import NormalParamExtractor
        >>> from inbounds.distributions import LogitNormal
        >>> network = nn.Sequential(nn.Linear(3, 4), NormalParamExtractor())
        >>> actor, acting = bounded_actor(network, LogitNormal, [0.0, -2.0], [8.0, 1.0])
        >>> batch = acting(TensorDict(observation=torch.randn(1000, 3), batch_size=[1000]))
        >>> batch["action"].shape, bool((batch["action"] > torch.tensor([0.0, -2.0])).all())
        (torch.Size([1000, 2]), True)
    """
    if law not in PARAMETERS:
        raise ValueError(f"bounded_actor knows the laws LogitNormal and ScaledBeta, not {law}")
    first = next(network.parameters(), torch.empty(0))
    low, high = require_bounds(low, high, first.dtype)  # once: TorchRL switches off every later check
    if low.dim() > 1:
        raise ValueError(
            f"the bounds have the shape {list(low.shape)}, and an action is a vector: of a batch of environments give "
            "those of env.action_spec_unbatched.space; else flatten the box with gymnasium.wrappers.TransformAction, "
            "and give bounds of the shape [A]"
        )
    names, in_keys = PARAMETERS[law], [in_keys] if isinstance(in_keys, str) else list(in_keys)

    actor = ProbabilisticActor(
        TensorDictModule(network, in_keys=in_keys, out_keys=list(names)),
        in_keys=list(names),
        out_keys=["latent"],
        distribution_class=_latents,
        distribution_kwargs={"law": law, "low": low, "high": high},
        return_log_prob=True,
        log_prob_key="latent_log_prob",
        default_interaction_type=ExplorationType.RANDOM,
    )
    execute = functools.partial(_action, law=law, low=low, high=high)
    return actor, TensorDictSequential(
        actor, TensorDictModule(execute, in_keys=["latent"], out_keys=["action"])
    )


def _latents(law: type[LogitNormal | ScaledBeta], low: Tensor, high: Tensor, **parameters: Tensor) -> Latents:
    first = next(iter(parameters.values()))
    if low.dim() and first.shape[-1:] != low.shape[-1:]:  # would be broadcast: one law for all components
        raise ValueError(
            f"the network gives parameters of {first.shape[-1]} components, and the box has {low.shape[-1]}: "
            f"it needs {2 * low.shape[-1]} outputs"
        )
    if not torch.compiler.is_compiling():  # where nothing can branch on numbers
        _require(parameters)
    low, high = low.to(first), high.to(first)
    return Latents(law(**parameters, low=low, high=high, validate_args=False))


def _require(parameters: Mapping[str, Tensor]) -> None:
    for name, value in parameters.items():
        if not torch._is_all_true(value.isfinite()):  # as torch checks, also under vmap
            raise ValueError(
                f"the network gives NaN or ∞ for {name}: look for an observation or a reward that is not finite, or "
                "take a smaller learning rate"
            )
        if name != "loc" and not torch._is_all_true(value > 0):
            raise ValueError(
                f"the network gives a {name} that is not positive: let it end in softplus, or take quiet_actor"
            )


def _action(latent: Tensor, law: type[LogitNormal | ScaledBeta], low: Tensor, high: Tensor) -> Tensor:
    """Any law with these bounds has the same map."""
    ones = torch.ones_like(latent)
    return law(ones, ones, low.to(latent), high.to(latent), validate_args=False).latent_to_value(latent)


class _BetaHead(nn.Module):
    """Outputs `[..., 2A]` to α and β `[..., A]` above one: no mode on a bound; both are `start` where outputs are 0."""

    def __init__(self, start: float) -> None:
        super().__init__()
        self.shift = before_softplus(start)

    def forward(self, outputs: Tensor) -> tuple[Tensor, ...]:
        return tuple((1 + nn.functional.softplus(outputs + self.shift)).chunk(2, dim=-1))


class _Headed(nn.Module):
    """A body of any number of inputs, a last layer, and a head."""

    def __init__(self, body: nn.Module, last: nn.Module, head: nn.Module) -> None:
        super().__init__()
        self.body, self.last, self.head = body, last, head

    def forward(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        return self.head(self.last(self.body(*inputs)))


def quiet_actor(
    body: nn.Module,
    features: int,
    law: type[LogitNormal | ScaledBeta],
    low: TensorLike,
    high: TensorLike,
    std: float = 0.4,
    in_keys: Sequence[str] | str = ("observation",),
) -> tuple[ProbabilisticActor, TensorDictSequential]:
    """Return `bounded_actor` on a body, with a last layer that starts quietly, as *Which policy?* recommends.

    Untrained, the policy is centred in its box and executes the standard deviation std. To act by the median, call it
    below `set_exploration_type(ExplorationType.MEDIAN)`. (`DETERMINISTIC` is the mean of a Beta.)

    Args:
        body: from what is under `in_keys` to features `[..., F]`; the last layer gets its device and dtype.
        features: that the body puts out, F.
        law: `LogitNormal` or `ScaledBeta`.
        low: `[A]` lower bounds of the action, in its own units.
        high: `[A]` upper bounds.
        std: of the executed action, in units of half the action range.
        in_keys: what the body reads.

    Returns:
        The actor for the loss and the one that acts; see `bounded_actor`.

    Raises:
        ValueError: another law, bounds that `bounded_actor` refuses, or a std out of reach. A Beta with both parameters
            above one executes less than 0.577.

    Example:
        >>> import torch
        >>> from tensordict import TensorDict
        >>> from torch import nn
        >>> from inbounds.distributions import ScaledBeta
        >>> body = nn.Sequential(nn.Linear(3, 64), nn.Tanh())
        >>> actor, acting = quiet_actor(body, 64, ScaledBeta, [0.0, -2.0], [8.0, 1.0])
        >>> batch = acting(TensorDict(observation=torch.zeros(1, 3), batch_size=[1]))
        >>> round(batch["concentration1"].mean().item(), 1)
        2.6
    """
    if law not in PARAMETERS:
        raise ValueError(f"quiet_actor knows the laws LogitNormal and ScaledBeta, not {law}")
    if law is ScaledBeta:
        head: nn.Module = _BetaHead(quiet_concentration(std))
    else:
        scale = quiet_scale(LogitNormal, std)
        if scale < LEAST_SCALE:
            raise ValueError(
                f"std={std} is out of reach: TorchRL's biased_softplus keeps σ above {LEAST_SCALE}"
            )
        head = NormalParamExtractor(scale_mapping=f"biased_softplus_{scale}")
    like = next(body.parameters(), torch.empty(0))
    box = require_bounds(low, high, like.dtype)[0]
    if box.dim() == 0:
        raise ValueError(
            "the bounds are numbers, which do not say how many components an action has: give the [A] of each"
        )
    last = nn.Linear(features, 2 * box.numel(), device=like.device, dtype=like.dtype)
    nn.init.orthogonal_(last.weight, gain=0.01)
    nn.init.zeros_(last.bias)
    return bounded_actor(_Headed(body, last, head), law, low, high, in_keys)
