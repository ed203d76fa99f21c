"""A quiet start in other libraries: which scale makes an untrained policy execute so much noise, and no more.

An untrained policy acts by its noise alone, and libraries start with σ = 1: a Gaussian that the environment clips then
executes 0.72 of half the action range, a third of it on the bounds. The book's second study compares its laws from 0.4.
"""

from __future__ import annotations

import math

import torch
from scipy.optimize import brentq

from inbounds.distributions import ClippedNormal, LogitNormal

__all__ = ["quiet_concentration", "quiet_scale"]

_LOG_SCALES = -10.0, 3.0


def quiet_scale(law: type[ClippedNormal | LogitNormal], std: float = 0.4) -> float:
    """Return the σ with which a law centred in its box executes a standard deviation of std.

    Args:
        law: `ClippedNormal`, a Gaussian whose actions the environment clips, or `LogitNormal`.
        std: of the executed action, in units of half the action range.

    Returns:
        The latent's σ; a Gaussian's in units of half the action range.

    Raises:
        ValueError: another law, or a std that is not one number or that no σ of it gives.

    Example:
        >>> from inbounds.distributions import ClippedNormal, LogitNormal
        >>> round(quiet_scale(LogitNormal, 0.4), 3), round(quiet_scale(ClippedNormal, 0.4), 3)
        (0.946, 0.405)
    """
    if law not in (ClippedNormal, LogitNormal):
        raise ValueError(f"quiet_scale knows the laws ClippedNormal and LogitNormal, not {law}")

    std = one_number(std)

    def executed(log_scale: float) -> float:
        loc, scale = torch.tensor([0.0, math.exp(log_scale)], dtype=torch.float64)
        return law(loc, scale, -1.0, 1.0).stddev.item()

    least, most = map(executed, _LOG_SCALES)
    if not least < std < most:
        raise ValueError(
            f"std={std} is out of reach: centred in its box, a {law.__name__} executes between {least:.2g} and "
            f"{most:.2g} of half the action range"
        )
    return math.exp(brentq(lambda s: executed(s) - std, *_LOG_SCALES, xtol=1e-12))


def quiet_concentration(std: float = 0.4) -> float:
    """Return the α = β above 1 with which a Beta executes a standard deviation of std, 1/√(2α + 1) of half the range.

    Args:
        std: of the executed action, in units of half the action range.

    Raises:
        ValueError: not one number, or out of reach: between 0 and 0.577, which is the uniform law's.

    Example:
        >>> round(quiet_concentration(0.4), 3)
        2.625
    """
    std = one_number(std)
    if not 0 < std < 3**-0.5:
        raise ValueError(
            f"std={std} is out of reach: a Beta without modes on its bounds executes less than 0.577"
        )
    return (std**-2 - 1) / 2


def one_number(std: float) -> float:
    """Return a standard deviation as Python's number.

    Raises:
        ValueError: it is None, or several.

    Example:
        >>> one_number([0.4, 0.2])
        Traceback (most recent call last):
        ...
        ValueError: std is one number, for all components of the action, and not [0.4, 0.2]
    """
    try:
        return float(std)
    except (TypeError, ValueError, RuntimeError):
        raise ValueError(f"std is one number, for all components of the action, and not {std!r}") from None
