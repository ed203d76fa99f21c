r"""Starting all families with the same noise.

Left alone, a zero output means σ = 1 for a Normal and α = β = 1 + log 2 for a Beta: the families start with different
noise on the robot, and a comparison at defaults compares noise levels. `initial_std` removes that. It is the
standard deviation of the *executed* unit action u = min(max(map(latent), −1), 1) while the network's features are
zero, so that only the head's bias speaks, with the law centred on the middle of the box:

$$ sd(u) = initial_std, $$

in units of half the action range. The last layer's small initial weights (preset `common`) keep it close to that in
every state; under PyTorch's default initialisation it is right on average only.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from inbounds.distributions import trapezoid
from inbounds.learning.families.policy import PolicyConfig


def executed_std(family: str, scale: float) -> float:
    """Return the standard deviation of the executed unit action of a centred law.

    Args:
        family: name of the policy family.
        scale: σ of the latent Normal; for `beta`, α = β.

    Returns:
        The standard deviation, in units of half the action range; below 1, where all mass is on the bounds.

    Example:
        >>> [round(executed_std(f, 1.0), 4) for f in ("gaussian", "logit-normal", "beta")]
        [0.7184, 0.4166, 0.5774]
    """
    if family == "beta":
        return 1 / math.sqrt(2 * scale + 1)
    if family == "logit-normal":
        nodes, weights = (x.numpy() for x in trapezoid())
        return math.sqrt(np.sum(weights * np.tanh(scale * nodes / 2) ** 2))
    bound = 1 / scale  # E[u²] = σ² E[ε²; |ε| < 1/σ] + P(|ε| > 1/σ)
    outside = math.erfc(bound / math.sqrt(2))
    density = math.exp(-(bound**2) / 2) / math.sqrt(2 * math.pi)
    return math.sqrt(scale**2 * (1 - outside - 2 * bound * density) + outside)


def head_bias(config: PolicyConfig) -> tuple[float, float] | None:
    """Return the biases of the head's two outputs that make `config.initial_std` true; None where it is None.

    Args:
        config: the policy's; its limits bound what can be reached.

    Returns:
        The bias of loc and of log_scale; for `beta`, of α's and β's pre-activations.

    Raises:
        ValueError: no parameters within the limits have that standard deviation.

    Example:
        >>> loc, log_scale = head_bias(PolicyConfig("logit-normal", initial_std=0.4166))
        >>> loc, round(log_scale, 3)
        (0.0, 0.0)
    """
    std = config.initial_std
    if std is None:
        return None
    limits = config.limits
    if config.family == "beta":
        smallest, largest = (executed_std("beta", a) for a in (limits.concentration_max, 1.0))
    else:
        smallest, largest = (
            executed_std(config.family, math.exp(s)) for s in (limits.log_std_min, limits.log_std_max)
        )
    if not smallest < std < largest:
        raise ValueError(
            f"initial_std={std} is out of reach: within its limits the {config.family} policy can execute standard "
            f"deviations between {smallest:.4g} and {largest:.4g} of half the action range"
        )
    if config.family == "beta":
        excess = (1 / std**2 - 1) / 2 - 1  # α − 1, from sd² = 1/(2α + 1)
        pre_activation = excess + math.log(-math.expm1(-excess))  # softplus⁻¹
        return pre_activation, pre_activation
    log_scale = brentq(
        lambda s: executed_std(config.family, math.exp(s)) - std,
        limits.log_std_min,
        limits.log_std_max,
        xtol=1e-14,
    )
    return 0.0, log_scale
