"""`clipped-gaussian`: the Gaussian, scored as the robot executes it (CAPG: Fujita & Maeda 2018, section 3)."""

from __future__ import annotations

from torch import Tensor
from torch.distributions import kl_divergence

from inbounds.distributions import ClippedNormal
from inbounds.learning.families.family import Family, clip
from inbounds.learning.families.gaussian import (
    NormalLaw,
    NormalParameters,
    clipped_std,
    in_box,
    normal_head_bias,
    normal_scales,
)


class ClippedNormalLaw(NormalLaw):
    """The Normal as a robot that clips to [−1, 1] executes it.

    It draws the same latents as `NORMAL`, and scores only what the robot sees: beyond a bound, the probability of
    that bound.

    Example:
        >>> import torch
        >>> from inbounds.learning.families import CLIPPED_NORMAL, NormalParameters
        >>> standard = NormalParameters(torch.zeros(1), torch.zeros(1))
        >>> [round(CLIPPED_NORMAL.log_prob(standard, torch.tensor([z])).exp().item(), 4) for z in (1.0, 5.0)]
        [0.1587, 0.1587]
    """

    def log_prob(self, parameters: NormalParameters, latent: Tensor) -> Tensor:
        """Return Σ_A of the log-probability of a bound, or of the Normal's log-density between them, `[...]`."""
        return clipped_normal(parameters).log_prob_latent(latent).sum(-1)

    def kl(self, old: NormalParameters, new: NormalParameters) -> Tensor:
        """Return the KL divergence of the mixed laws, `[...]`; never more than that of the Normals."""
        return kl_divergence(clipped_normal(old), clipped_normal(new)).sum(-1)


CLIPPED_NORMAL = ClippedNormalLaw()


def clipped_normal(parameters: NormalParameters) -> ClippedNormal:
    """Return the law of the unit action min(max(z, −1), 1), elementwise `[..., A]`."""
    return ClippedNormal(parameters.loc, parameters.log_scale.exp(), -1.0, 1.0, validate_args=False)


FAMILY = Family(
    name="clipped-gaussian",
    law=CLIPPED_NORMAL,
    to_unit=lambda latent, xp: clip(latent, -1.0, 1.0),
    entropy=lambda p: clipped_normal(p).entropy().sum(-1),
    greedy={
        "mean": lambda p: clipped_normal(p).mean,
        "median": lambda p: clipped_normal(p).median,
        "mode": lambda p: clipped_normal(p).mode,
    },
    distribution=lambda p, low, high: ClippedNormal(*in_box(p, low, high), low, high),
    executed_std=clipped_std,
    scales=normal_scales,
    head_bias=lambda std, limits: normal_head_bias(clipped_std, std, limits),
    kernels="inbounds.learning.families.clipped_gaussian_kernel",
)
