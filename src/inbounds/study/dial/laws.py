r"""What the laws earn on the dial, in closed form: moments of the executed action, and the Fisher information.

Per dimension and mirrored to the side of the sign, a policy is two outputs of the network, (μ, log σ) or the
pre-activations of (α, β). The expected reward needs E u and E u² of the executed action u, and E a² of the raw one.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, ndtr, polygamma

from inbounds.learning import Limits
from inbounds.learning.families.initial_noise import head_bias
from inbounds.learning.families.policy import PolicyConfig
from inbounds.study.dial.task import DialTask

CAP = Limits().concentration_max  # of a Beta's
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(80)
_WEIGHTS = _WEIGHTS / _WEIGHTS.sum()
Pair = NDArray[np.float64]


def _density(x: float) -> float:
    return math.exp(-x * x / 2) / math.sqrt(2 * math.pi)


def clipped_moments(loc: float, scale: float) -> tuple[float, float]:
    """Return E u and E u² of a Normal clipped to [−1, 1].

    Example:
        >>> mean, square = clipped_moments(1.0, 0.001)  # half of the mass is at the bound
        >>> round(1 - mean, 6), round(1e-3 * math.sqrt(1 / (2 * math.pi)), 6)
        (0.000399, 0.000399)
    """
    low, high = (-1 - loc) / scale, (1 - loc) / scale
    inside, above, below = ndtr(high) - ndtr(low), ndtr(-high), ndtr(low)
    mean = loc * inside + scale * (_density(low) - _density(high))
    square = (loc**2 + scale**2) * inside + scale * ((loc - 1) * _density(low) - (loc + 1) * _density(high))
    return float(mean + above - below), float(square + above + below)


def concentrations(outputs: Pair) -> tuple[float, float]:
    """Return α and β for the two outputs of the network: 1 + softplus, capped."""
    alpha, beta = np.minimum(1 + np.logaddexp(outputs, 0), CAP)
    return float(alpha), float(beta)


def moments(family: str, outputs: Pair) -> tuple[float, float, float]:
    """Return E u, E u² of the executed action, and E a² of the raw one.

    Args:
        family: gaussian, beta or logit-normal.
        outputs: `[2]` of the network, for one dimension.

    Example:
        >>> [round(abs(x), 3) for x in moments("logit-normal", np.array([0.0, 0.0]))]
        [0.0, 0.174, 0.174]
    """
    if family == "beta":
        alpha, beta = concentrations(outputs)
        share = alpha / (alpha + beta)
        mean, variance = 2 * share - 1, 4 * share * (1 - share) / (alpha + beta + 1)
        return mean, variance + mean**2, variance + mean**2
    loc, scale = float(outputs[0]), math.exp(outputs[1])
    if family == "gaussian":
        return *clipped_moments(loc, scale), loc**2 + scale**2
    unit = np.tanh((loc + scale * _NODES) / 2)
    square = float(_WEIGHTS @ unit**2)
    return float(_WEIGHTS @ unit), square, square


def expected_return(task: DialTask, family: str, outputs: Pair) -> float:
    """Return the expected reward of one dimension, hence of the mean over all.

    Example:
        >>> quiet = np.array([0.5, -10.0])  # a Gaussian on the best action
        >>> round(expected_return(DialTask(0.5), "gaussian", quiet), 6)
        -0.0
    """
    mean, square, raw = moments(family, outputs)
    paid = raw if task.charged == "raw" else square
    return -(square - 2 * task.target * mean + task.target**2) - task.cost * paid


def information(family: str, outputs: Pair) -> NDArray[np.float64]:
    """Return the Fisher information `[2, 2]` of the outputs.

    Example:
        >>> information("gaussian", np.array([0.3, 0.0])).tolist()  # σ = 1
        [[1.0, 0.0], [0.0, 2.0]]
    """
    if family != "beta":
        return np.diag([math.exp(-2 * outputs[1]), 2.0])
    alpha, beta = concentrations(outputs)
    slopes = np.where(np.array([alpha, beta]) < CAP, expit(outputs), 0.0)
    shared = float(polygamma(1, alpha + beta))
    full = np.diag([float(polygamma(1, alpha)), float(polygamma(1, beta))]) - shared
    return np.asarray(full * np.outer(slopes, slopes))


def start(family: str, std: float) -> Pair:
    """Return the outputs of a policy that has learned nothing and executes a given noise."""
    bias = head_bias(PolicyConfig(family, initial_std=std))
    assert bias is not None
    return np.array(bias)
