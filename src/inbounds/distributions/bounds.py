"""What the bounded distributions share: the interval [low, high], its checks, and arithmetic close to its ends.

A bounded action lives between two numbers that the robot gives (`space.low`, `space.high`). Each law of this
package is a `BoundedDistribution`: elementwise over broadcast parameters, with `low` and `high` among them.
Floating point is the enemy near a bound, and three rules answer it:

* a distance to a bound is computed from *that* bound: `value - low` near low, `high - value` near high;
* where the support is open, no sample is on a bound (`SigmoidMapped`), so that a law can score its own samples;
* what must be exact is computed from the latent, never from the value (a float32 value next to its bound has
  forgotten its latent).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Self, TypeAlias

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor
from torch.distributions import Distribution, Normal, constraints

from inbounds.distributions.open_interval import OpenInterval, from_line, open_ends, to_line

__all__ = [
    "BoundedDistribution",
    "NormalLatent",
    "SigmoidMapped",
    "TensorLike",
    "as_parameters",
    "require_bounds",
    "require_equal_bounds",
]

TensorLike: TypeAlias = Tensor | float | npt.NDArray[Any] | Sequence[float]


class BoundedDistribution(Distribution):
    """Base of the laws on an interval: parameters broadcast against the bounds, `expand`, checked samples.

    A subclass names its parameters in `arg_constraints` (bounds included) and passes all of them here.

    Args:
        validate_args: check parameters and values (None: as `torch.distributions` is set, on by default). Inside
            `torch.vmap` over the *bounds*, pass False: a check cannot branch on a batched tensor. `torch.compile`
            switches off the default for all laws of the process, compiled or not: pass True there.
        **parameters: `[...]` each; numbers, tensors or arrays that broadcast together, `low` and `high` among them.

    Raises:
        ValueError: shapes that do not broadcast; under validation also a parameter outside its constraint or infinite,
            bounds that are infinite, NaN or out of order, or that leave no floating-point number between them.

    Example:
        >>> from inbounds.distributions import LogitNormal, ScaledBeta
        >>> all(issubclass(law, BoundedDistribution) for law in (LogitNormal, ScaledBeta))
        True
    """

    low: Tensor
    high: Tensor

    def __init__(self, *, validate_args: bool | None = None, **parameters: TensorLike) -> None:
        for name, value in as_parameters(**parameters).items():
            setattr(self, name, value)
        if torch.compiler.is_compiling():  # where nothing can branch on numbers, and torch checks nothing
            validate_args = False
        if validate_args if validate_args is not None else self._validate_args:
            _check_bounds(type(self).__name__, self.low, self.high)
        super().__init__(self.low.shape, validate_args=validate_args)
        if self._validate_args:
            self._check_finite()

    def _check_finite(self) -> None:
        for name in self.arg_constraints:  # torch takes infinity for a real number; bounds have been checked
            if not torch._is_all_true(getattr(self, name).isfinite()):  # as torch checks, also under vmap
                raise ValueError(
                    f"{type(self).__name__}: {name} must be finite, got {getattr(self, name)}: clip what feeds it"
                )

    def expand(self, batch_shape: Any, _instance: Any = None) -> Self:
        """Return this distribution with its parameters expanded to `batch_shape` (no memory is copied)."""
        new = self._get_checked_instance(type(self), _instance)
        batch_shape = torch.Size(batch_shape)
        for name in self.arg_constraints:
            setattr(new, name, getattr(self, name).expand(batch_shape))
        Distribution.__init__(new, batch_shape, validate_args=False)
        new._validate_args = self._validate_args
        return new

    @property
    def width(self) -> Tensor:
        """`[...]` length of the interval, high − low, in units of the action."""
        return self.high - self.low

    @property
    def stddev(self) -> Tensor:
        """`[...]` standard deviation of the value; where the variance underflows to 0, so does its gradient."""
        variance = self.variance
        spread = ~(variance <= 0)  # what is NaN stays so
        return torch.where(spread, torch.where(spread, variance, 1.0).sqrt(), 0.0)

    def sample(self, sample_shape: Any = (), generator: torch.Generator | None = None) -> Tensor:
        """Return samples `[*sample_shape, ...]`, cut off from the graph; see `rsample`."""
        with torch.no_grad():
            return self.rsample(sample_shape, generator)

    def rsample(self, sample_shape: Any = (), generator: torch.Generator | None = None) -> Tensor:
        """Return reparametrised samples `[*sample_shape, ...]`, drawn by `rsample_latent`.

        Args:
            sample_shape: leading shape of the samples.
            generator: source of randomness; None is torch's global one.

        Returns:
            `[*sample_shape, ...]` values in the support, differentiable in the parameters.
        """
        return self.latent_to_value(self.rsample_latent(sample_shape, generator))

    def rsample_latent(self, sample_shape: Any = (), generator: torch.Generator | None = None) -> Tensor:
        """Return reparametrised latents `[*sample_shape, ...]`; the subclass says what its latent is."""
        raise NotImplementedError

    def latent_to_value(self, latent: Tensor) -> Tensor:
        """Return the value that a latent stands for; the subclass says which map that is."""
        raise NotImplementedError

    def _standard_normal(self, sample_shape: Any, generator: torch.Generator | None) -> Tensor:
        shape = self._extended_shape(torch.Size(sample_shape))
        return torch.randn(shape, dtype=self.low.dtype, device=self.low.device, generator=generator)

    def _validate_sample(self, value: Tensor) -> None:
        try:
            super()._validate_sample(value)
        except ValueError as error:
            if "support" not in str(error):
                raise
            assert self.support is not None  # every law here has one
            within, value = torch.broadcast_tensors(self.support.check(value), value)
            try:
                first = value[~within][0].item()
                count = f"{int((~within).sum())} of {value.numel()} values lie outside the support, the first {first}."
            except RuntimeError:  # within torch.vmap no value can be looked at
                count = "Values lie outside the support."
            raise ValueError(
                f"{count} Keep the latent of a sample (rsample_latent, log_prob_latent) instead of reading it back "
                "from a value that was rounded or clipped, or pass validate_args=False: outside the support log_prob "
                "is then -inf."
            ) from None


class NormalLatent(BoundedDistribution):
    """Base of the laws whose latent is z ~ Normal(loc, scale)."""

    arg_constraints: ClassVar[dict[str, constraints.Constraint]] = {
        "loc": constraints.real,
        "scale": constraints.positive,
        "low": constraints.dependent,
        "high": constraints.dependent,
    }
    has_rsample = True
    loc: Tensor
    scale: Tensor

    def rsample_latent(self, sample_shape: Any = (), generator: torch.Generator | None = None) -> Tensor:
        """Return latents z = loc + scale·ε, `[*sample_shape, ...]`; store these in a rollout, not the values."""
        return self.loc + self.scale * self._standard_normal(sample_shape, generator)

    def _normal(self) -> Normal:
        return Normal(self.loc, self.scale, validate_args=False)


class SigmoidMapped(BoundedDistribution):
    """Base of the laws whose value is low + (high − low) · sigmoid(latent): a bijection of ℝ and the open interval.

    A value that came from a latent lies strictly inside: what rounding would put on a bound is the nearest (normal)
    floating-point number inside. So the law can score its own samples, if not exactly: see `log_prob_latent`.
    """

    @constraints.dependent_property(is_discrete=False, event_dim=0)
    def support(self) -> constraints.Constraint:
        """Return the open interval (low, high)."""
        return OpenInterval(self.low, self.high)

    def latent_to_value(self, latent: Tensor) -> Tensor:
        """Return low + width · sigmoid(latent), strictly inside the bounds for every latent (±inf included).

        Args:
            latent: `[...]` latents, broadcast against the parameters.

        Returns:
            `[...]` values; each is measured from the bound that it is closer to.
        """
        return from_line(latent, self.low, self.high)

    def value_to_latent(self, value: Tensor) -> Tensor:
        """Return log(value − low) − log(high − value), `[...]`: the inverse, up to the rounding of the value.

        It is ±inf on the bounds and NaN beyond them.
        """
        return to_line(value, self.low, self.high)

    def _distances(self, value: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return value − low and high − value, positive everywhere, and which values lie outside (low, high).

        Outside, the distances are those of the midpoint, so that neither the value nor the gradient of what is
        computed from them is NaN; the caller masks it.
        """
        outside = (value <= self.low) | (value >= self.high)
        safe = torch.where(outside, self.low + self.width / 2, value)
        return safe - self.low, self.high - safe, outside


def as_parameters(**parameters: TensorLike) -> dict[str, Tensor]:
    """Return the parameters as tensors of one floating type, one device and one shape.

    The type is that of the law's own tensors (the bounds are cast to it; numbers adapt), else that of the bounds where
    they are tensors or arrays, or torch's default.

    Args:
        **parameters: numbers, tensors or arrays that broadcast together.

    Returns:
        The same names with tensors `[...]`.

    Raises:
        ValueError: the shapes do not broadcast.

    Example:
        >>> import numpy as np, torch
        >>> parameters = as_parameters(loc=torch.zeros(3), low=np.array([-1.0, -2.0, -3.0]), high=1.0)
        >>> parameters["low"].tolist(), parameters["low"].dtype, parameters["high"].shape
        ([-1.0, -2.0, -3.0], torch.float32, torch.Size([3]))
    """
    given = {name: _without_numpy(value) for name, value in parameters.items()}
    own = [v for name, v in given.items() if isinstance(v, Tensor) and name not in ("low", "high")]
    leading = own or [v for v in given.values() if isinstance(v, Tensor)]
    dtype = leading[0].dtype if leading else torch.get_default_dtype()
    for tensor in leading[1:]:
        dtype = torch.promote_types(dtype, tensor.dtype)
    if not dtype.is_floating_point:
        dtype = torch.get_default_dtype()
    device = leading[0].device if leading else None
    tensors = [torch.as_tensor(value, dtype=dtype, device=device) for value in given.values()]
    try:
        tensors = list(torch.broadcast_tensors(*tensors))
    except RuntimeError:
        shapes = ", ".join(f"{name} {list(t.shape)}" for name, t in zip(given, tensors, strict=True))
        raise ValueError(
            f"these shapes do not broadcast: {shapes}. Give bounds of shape [] or [act_dim] and parameters "
            "of shape [..., act_dim]."
        ) from None
    return dict(zip(given, tensors, strict=True))


def _without_numpy(value: TensorLike) -> TensorLike:
    if isinstance(value, np.ndarray):
        return torch.as_tensor(np.array(value))  # its own: writable, with no negative strides
    return value.item() if isinstance(value, np.generic) else value  # a number adapts to the others' type


def require_bounds(
    low: TensorLike, high: TensorLike, dtype: torch.dtype | None = None
) -> tuple[Tensor, Tensor]:
    """Return the two bounds as tensors of their own type and of one shape, checked whatever torch's settings are.

    Args:
        low: `[...]` lower bounds.
        high: `[...]` upper bounds.
        dtype: what actions are computed in; None is torch's default.

    Raises:
        ValueError: some are not finite or not in order, or no number of the dtype lies between them.

    Example:
        >>> require_bounds(-1.0, np.inf)  # doctest: +ELLIPSIS
        Traceback (most recent call last):
        ValueError: action box: the bounds must be finite, but low=-1.0, high=inf. Choose ... a Normal.
    """
    own = [b.detach().clone() if isinstance(b, Tensor) else np.array(b) for b in (low, high)]
    low, high = as_parameters(low=own[0], high=own[1]).values()
    _check_bounds("action box", low, high)
    dtype = dtype or torch.get_default_dtype()
    _check_bounds(f"action box in {dtype}", low.to(dtype), high.to(dtype))
    return low, high


def require_equal_bounds(p: BoundedDistribution, q: BoundedDistribution) -> None:
    """Raise unless p and q live on the same interval: otherwise their KL divergence is infinite or meaningless.

    Not in compiled code (`torch.compile`), where nothing can be checked, and not where both were made without checks.

    Args:
        p: a law with bounds.
        q: another.

    Raises:
        ValueError: the bounds differ anywhere.
    """
    if torch.compiler.is_compiling() or not (p._validate_args or q._validate_args):
        return  # compiled code cannot branch on numbers, nor can torch.vmap
    kind = min((p.low.dtype, q.low.dtype), key=lambda kind: torch.finfo(kind).bits)  # 0.1 is not 0.1 in both
    bounds = torch.broadcast_tensors(*(bound.to(kind) for bound in (p.low, p.high, q.low, q.high)))
    unequal = (bounds[0] != bounds[2]) | (bounds[1] != bounds[3])
    if bool(unequal.any()):
        index = tuple(unequal.nonzero()[0].tolist())
        said = "p has low={}, high={} and q has low={}, high={}".format(*(b[index].item() for b in bounds))
        raise ValueError(f"KL needs equal bounds, but {said}. Build both from the same action space.")


def _check_bounds(name: str, low: Tensor, high: Tensor) -> None:
    def complain(bad: Tensor, problem: str, remedy: str) -> None:
        if bool(bad.any()):
            index = tuple(bad.nonzero()[0].tolist())
            where = f" at index {index}" if index else ""
            raise ValueError(
                f"{name}: {problem}, but low={low[index].item()}, high={high[index].item()}{where}. {remedy}"
            )

    complain(
        ~(torch.isfinite(low) & torch.isfinite(high)),
        "the bounds must be finite",
        "Choose finite bounds; an action without bounds needs no bounded law: use a Normal.",
    )
    order = "low must be less than high"
    complain(low > high, order, "Swap the bounds.")
    complain(
        low == high, order, f"Drop the action without a range, or use float64 where {low.dtype} made one."
    )
    complain(
        torch.isinf(high - low),
        "the interval's length overflows",
        "Use float64, or choose bounds closer together.",
    )
    smallest, largest = open_ends(low, high)
    complain(
        smallest > largest,
        f"no {low.dtype} number lies strictly between the bounds",
        "Use float64, or move the interval closer to zero.",
    )
