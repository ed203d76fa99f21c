"""Density φ and distribution function Φ of the standard Normal, with their tails, and quantiles of any Normal."""

import math

import torch
from torch import Tensor
from torch.special import ndtri

__all__ = ["normal_quantile", "standard_normal_cdf", "standard_normal_pdf"]


def standard_normal_pdf(x: Tensor) -> Tensor:
    """Return φ(x) = exp(−x²/2)/√(2π), elementwise.

    Example:
        >>> import torch
        >>> round(standard_normal_pdf(torch.tensor(0.0)).item(), 6)
        0.398942
    """
    return torch.exp(-x.square() / 2) / math.sqrt(2 * math.pi)


def standard_normal_cdf(x: Tensor) -> Tensor:
    """Return Φ(x) = P(t ≤ x), elementwise, by the complementary error function.

    `torch.special.ndtr` is (1 + erf)/2 and has no lower tail: it returns 0 from x = −8.3 in float64, where the
    gradient of a clipped policy would vanish. For log Φ use `torch.special.log_ndtr`, which is sound.

    Example:
        >>> import torch
        >>> x = torch.tensor(-10.0, dtype=torch.float64)
        >>> f"{standard_normal_cdf(x):.3e} {torch.special.ndtr(x):.3e}"
        '7.620e-24 0.000e+00'
    """
    return torch.erfc(-x / math.sqrt(2)) / 2


def normal_quantile(probability: Tensor, loc: Tensor, scale: Tensor) -> Tensor:
    """Return loc + scale · Φ⁻¹(probability), broadcast; −∞ and ∞ at 0 and 1, NaN beyond.

    What is not finite is a constant: a bound that it is clamped to does not move, and 0 · ∞ is NaN.

    Example:
        >>> import torch
        >>> scale = torch.tensor(2.0, requires_grad=True)
        >>> quantile = normal_quantile(torch.tensor([0.0, 0.5]), torch.tensor(1.0), scale)
        >>> quantile.clamp(-3, 3).sum().backward()
        >>> quantile.tolist(), scale.grad.item()
        ([-inf, 1.0], 0.0)
    """
    inside = (probability > 0) & (probability < 1)
    latent = loc + scale * ndtri(torch.where(inside, probability, 0.5))
    return torch.where(inside, latent, ndtri(probability).detach())
