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

from inbounds.learning.families.policy import PolicyConfig, family_of


def executed_std(family: str, scale: float) -> float:
    """Return the standard deviation of the executed unit action of a centred law.

    Args:
        family: name of the policy family.
        scale: σ of the latent Normal; for `beta`, α = β.

    Returns:
        The standard deviation, in units of half the action range; at most 1, where all mass is on the bounds.

    Raises:
        ValueError: no family of that name, or a scale that is not positive and finite.

    Example:
        >>> [round(executed_std(f, 1.0), 4) for f in ("gaussian", "logit-normal", "beta")]
        [0.7184, 0.4166, 0.5774]
    """
    if not 0 < scale < math.inf:
        raise ValueError(f"a scale must be positive and finite, got {scale}")
    return min(1.0, family_of(family).executed_std(scale))


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
    std, family = config.initial_std, family_of(config.family)
    if std is None:
        return None
    smallest, largest = map(family.executed_std, family.scales(config.limits))
    if not smallest < std < largest:
        raise ValueError(
            f"initial_std={std} is out of reach: within its limits the {config.family} policy can execute standard "
            f"deviations between {smallest:.4g} and {largest:.4g} of half the action range"
        )
    return family.head_bias(std, config.limits)
