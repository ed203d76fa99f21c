"""The open interval (low, high): the check of it, its ends in floating point, and the map of the line into it."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.distributions import Transform, biject_to, constraints, transform_to

__all__ = ["OpenInterval", "from_line", "open_ends", "to_line"]


class OpenInterval(constraints.Constraint):
    """Constrain to low < value < high, both ends excluded.

    Args:
        low: `[...]` lower bound.
        high: `[...]` upper bound.

    Example:
        >>> import torch
        >>> OpenInterval(0.0, 1.0).check(torch.tensor([0.0, 0.5, 1.0])).tolist()
        [False, True, False]
    """

    def __init__(self, low: Tensor | float, high: Tensor | float) -> None:
        self.lower_bound, self.upper_bound = low, high
        super().__init__()

    def check(self, value: Tensor) -> Tensor:
        """Return, elementwise, whether value lies strictly between the bounds."""
        return (self.lower_bound < value) & (value < self.upper_bound)

    def __repr__(self) -> str:
        return f"OpenInterval(low={self.lower_bound}, high={self.upper_bound})"


def open_ends(low: Tensor, high: Tensor) -> tuple[Tensor, Tensor]:
    """Return the smallest and the largest normal floating-point number strictly between low and high.

    Normal, because next to a bound at zero the subnormals have infinite reciprocals.

    Args:
        low: `[...]` lower bounds.
        high: `[...]` upper bounds.

    Example:
        >>> smallest, largest = open_ends(torch.tensor(10.0), torch.tensor(11.0))
        >>> smallest.item() > 10, largest.item() < 11
        (True, True)
    """
    low, high = low.detach(), high.detach()
    tiny = torch.finfo(low.dtype).tiny
    smallest = torch.maximum(torch.nextafter(low, high), low + tiny)
    largest = torch.minimum(torch.nextafter(high, low), high - tiny)
    return smallest, largest


def from_line(latent: Tensor, low: Tensor, high: Tensor, ends: tuple[Tensor, Tensor] | None = None) -> Tensor:
    """Return low + (high − low) · sigmoid(latent), strictly inside the bounds for every latent (±inf included).

    Args:
        latent: `[...]` numbers, broadcast against the bounds.
        low: `[...]` lower bounds.
        high: `[...]` upper bounds.
        ends: `open_ends(low, high)`, where they are known; they are none of ONNX's operators.

    Returns:
        `[...]` values; each is measured from the bound that it is closer to.

    Example:
        >>> from_line(torch.tensor([0.0, 99.0]), torch.tensor(-1.0), torch.tensor(1.0)) < 1
        tensor([True, True])
    """
    width = high - low
    fraction, complement = torch.sigmoid(latent), torch.sigmoid(-latent)
    value = torch.where(fraction < 0.5, low + width * fraction, high - width * complement)
    return torch.clamp(value, *(ends or open_ends(low, high)))


def to_line(value: Tensor, low: Tensor, high: Tensor) -> Tensor:
    """Return log(value − low) − log(high − value), `[...]`: the inverse of `from_line`, up to the value's rounding.

    It is ±inf on the bounds and NaN beyond them.

    Args:
        value: `[...]` values, broadcast against the bounds.
        low: `[...]` lower bounds.
        high: `[...]` upper bounds.

    Example:
        >>> to_line(torch.tensor(0.0), torch.tensor(-1.0), torch.tensor(1.0)).item()
        0.0
    """
    return torch.log(value - low) - torch.log(high - value)


class _IntoTheInterval(Transform):
    """`from_line` as torch's transforms are: what `biject_to` and `transform_to` give for the open interval."""

    domain = constraints.real
    bijective = True
    sign = +1

    def __init__(self, interval: OpenInterval, cache_size: int = 0) -> None:
        super().__init__(cache_size)
        self.codomain = self._interval = interval

    def with_cache(self, cache_size: int = 1) -> Transform:
        return self if cache_size == self._cache_size else _IntoTheInterval(self._interval, cache_size)

    def __eq__(self, other: object) -> bool:
        exact = torch.zeros((), dtype=torch.float64)
        return isinstance(other, _IntoTheInterval) and all(
            torch.equal(a, b) for a, b in zip(self._bounds(exact), other._bounds(exact), strict=True)
        )

    __hash__ = Transform.__hash__

    def _bounds(self, like: Tensor) -> tuple[Tensor, Tensor]:
        """Return the two bounds; Python's numbers in the type of what is mapped."""
        low, high = (
            bound if isinstance(bound, Tensor) else like.new_tensor(bound)
            for bound in (self._interval.lower_bound, self._interval.upper_bound)
        )
        return low, high

    def _call(self, x: Tensor) -> Tensor:
        return from_line(x, *self._bounds(x))

    def _inverse(self, y: Tensor) -> Tensor:
        return to_line(y, *self._bounds(y))

    def log_abs_det_jacobian(self, x: Tensor, y: Tensor) -> Tensor:
        """Return log width + log sigmoid(x) + log sigmoid(−x), `[...]`, finite wherever x is."""
        log_sigmoid = torch.nn.functional.logsigmoid
        low, high = self._bounds(x)
        return (high - low).log() + log_sigmoid(x) + log_sigmoid(-x)


@biject_to.register(OpenInterval)
@transform_to.register(OpenInterval)
def _from_the_line(constraint: Any) -> Transform:
    return _IntoTheInterval(constraint)
