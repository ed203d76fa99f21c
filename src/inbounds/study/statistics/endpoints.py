"""From learning curves to one number per seed: the endpoints of the study, fixed before it ran.

`curves` are mean training returns `[..., E]`, one number an epoch, any axes (environments, seeds) in front. An epoch
without a number makes the endpoint NaN: what is missing stays visible. `carry_forward` fills such epochs by the rule of
`results/PROTOCOL.md`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from inbounds.study.statistics.seeds import Floats
from inbounds.study.statistics.settings import FINAL_FRACTION


def _curves(curves: ArrayLike) -> Floats:
    array = np.asarray(curves, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] == 0:
        raise ValueError(f"expected learning curves [..., epochs] with at least one epoch, got {array.shape}")
    return array


def area_under_curve(curves: ArrayLike) -> Floats:
    """Return the area under learning curves divided by their length: the mean over epochs, a return.

    An epoch's number is the mean over a whole epoch, and epochs are equally long: the area is that of a bar chart, not
    of a line through points. It reads as "the average return on the way".

    Args:
        curves: `[..., E]` mean return of each epoch.

    Returns:
        `[...]`; NaN where any epoch is NaN.

    Raises:
        ValueError: no epochs.

    Example:
        >>> area_under_curve([[0.0, 10.0, 20.0], [0.0, 20.0, 22.0]]).tolist()
        [10.0, 14.0]
    """
    return _curves(curves).mean(-1)


def final_score(curves: ArrayLike, fraction: float = FINAL_FRACTION) -> Floats:
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


def carry_forward(curves: ArrayLike) -> Floats:
    """Fill the epochs without a return: each with the last known return, those before the first with the first.

    Two kinds of epochs have none: those in which no episode ended, and those after a seed diverged. A diverged seed is
    thereby charged with what it had reached: a choice, of which the protocol says that the analysis is repeated
    without such seeds.

    Args:
        curves: `[..., E]` mean return of each epoch; NaN where there is none.

    Returns:
        `[..., E]` a copy, filled; NaN throughout where there is no return at all.

    Raises:
        ValueError: no epochs.

    Example:
        >>> nan = float("nan")
        >>> carry_forward([[1.0, nan, 3.0], [nan, 2.0, nan], [nan, nan, nan]]).tolist()
        [[1.0, 1.0, 3.0], [2.0, 2.0, 2.0], [nan, nan, nan]]
    """
    array = _curves(curves)
    known = ~np.isnan(array)
    epochs = np.arange(array.shape[-1])
    last_known = np.maximum.accumulate(np.where(known, epochs, -1), -1)
    first_known = known.argmax(-1)[..., None]
    return np.take_along_axis(array, np.where(last_known < 0, first_known, last_known), -1)


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
