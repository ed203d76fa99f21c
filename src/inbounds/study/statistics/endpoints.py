"""From learning curves to one number per seed: the endpoints of the study, fixed before it ran.

`curves` are mean training returns `[..., E]`, one number an epoch, any axes (environments, seeds) in front. An epoch
without a number makes the endpoint NaN: what is missing stays visible. `carry_forward` fills the one harmless gap,
an epoch in which no episode happened to end.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from inbounds.study.statistics.seeds import Floats


def _curves(curves: ArrayLike) -> Floats:
    array = np.asarray(curves, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] == 0:
        raise ValueError(f"expected learning curves [..., epochs] with at least one epoch, got {array.shape}")
    return array


def area_under_curve(curves: ArrayLike) -> Floats:
    """Return the area under learning curves by the trapezoid rule, divided by its length: a return.

    In units of return it reads as "the average return on the way". Epochs are equally long in environment steps.

    Args:
        curves: `[..., E]` mean return of each epoch.

    Returns:
        `[...]`; NaN where any epoch is NaN (missing, or after the seed diverged).

    Raises:
        ValueError: no epochs.

    Example:
        >>> area_under_curve([[0.0, 10.0, 20.0], [0.0, 20.0, 20.0]]).tolist()
        [10.0, 15.0]
    """
    array = _curves(curves)
    if array.shape[-1] == 1:
        return array[..., 0]
    return np.trapezoid(array, axis=-1) / (array.shape[-1] - 1)


def final_score(curves: ArrayLike, fraction: float = 0.1) -> Floats:
    """Return the mean return over the last tenth of the epochs.

    A mean over an interval that was fixed beforehand; the best epoch would reward noise.

    Args:
        curves: `[..., E]` mean return of each epoch; pad a run that is not finished with NaN.
        fraction: of the epochs, rounded up to whole ones, in (0, 1].

    Returns:
        `[...]`; NaN where an epoch of that interval is NaN.

    Raises:
        ValueError: no epochs, or a fraction outside (0, 1].

    Example:
        >>> final_score(list(range(20))).item()  # of 18 and 19
        18.5
    """
    array = _curves(curves)
    if not 0 < fraction <= 1:
        raise ValueError(f"fraction must be in (0, 1], got {fraction}")
    # Rounding before the ceiling: 0.1 · 30 is 3.0000000000000004 in binary.
    last = math.ceil(round(fraction * array.shape[-1], 9))
    return array[..., -last:].mean(-1)


def carry_forward(curves: ArrayLike, alive: ArrayLike) -> Floats:
    """Fill the epochs in which no episode ended with the return of the epoch before.

    Only a seed that was alive in such an epoch has a gap there; a seed that diverged or stopped stays NaN, for its
    last good return says nothing about what came after. Epochs before the first return stay NaN too.

    Args:
        curves: `[..., E]` mean return of each epoch; NaN where no episode ended.
        alive: `[..., E]` or broadcast against it, booleans: whether the seed was still training in that epoch.

    Returns:
        `[..., E]` a copy, filled.

    Raises:
        ValueError: the shapes do not fit.

    Example:
        >>> nan = float("nan")
        >>> carry_forward([[1.0, nan, 3.0], [1.0, nan, nan]], alive=[[True] * 3, [True, True, False]]).tolist()
        [[1.0, 1.0, 3.0], [1.0, 1.0, nan]]
    """
    array = _curves(curves).copy()
    going = np.broadcast_to(np.asarray(alive, dtype=bool), array.shape)
    for epoch in range(1, array.shape[-1]):
        gap = np.isnan(array[..., epoch]) & going[..., epoch]
        array[..., epoch] = np.where(gap, array[..., epoch - 1], array[..., epoch])
    return array


def normalize_scores(scores: ArrayLike, low: ArrayLike, high: ArrayLike) -> Floats:
    """Return (score − low) / (high − low): 0 at one reference and 1 at another, environment by environment.

    Returns of different robots share no unit; only such ratios can be averaged over robots (Agarwal et al. 2021,
    section 2). The references are taken as constants: fix them before looking, for instance the untrained policy and
    the Gaussian's mean final return, and say which.

    Args:
        scores: `[..., S]` raw scores.
        low: the score that becomes 0, `[...]` (one per environment) or a number.
        high: the score that becomes 1.

    Returns:
        `[..., S]`; missing seeds stay NaN, values beyond [0, 1] are kept.

    Raises:
        ValueError: the references are not finite, or high is not above low.

    Example:
        >>> normalize_scores([[50.0, 100.0], [3.0, 5.0]], low=[0.0, 1.0], high=[100.0, 5.0]).tolist()
        [[0.5, 1.0], [0.5, 1.0]]
    """
    array, zero, one = (np.asarray(x, dtype=np.float64) for x in (scores, low, high))
    if not (np.isfinite(zero).all() and np.isfinite(one).all() and np.all(one > zero)):
        raise ValueError(
            "each reference must be finite, with high above low: choose another pair of references"
        )
    return (array - zero[..., None]) / (one - zero)[..., None]
