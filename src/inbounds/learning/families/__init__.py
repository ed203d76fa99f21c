"""Policy families: a law for what is drawn, and a map to the action."""

from inbounds.learning.families.family import (
    BETA,
    CLIPPED_NORMAL,
    NORMAL,
    BetaLaw,
    ClippedNormalLaw,
    Law,
    Limits,
    NormalLaw,
    Parameters,
)
from inbounds.learning.families.initial_noise import executed_std, head_bias
from inbounds.learning.families.policy import FAMILIES, Family, Policy, PolicyConfig

__all__ = [
    "BETA",
    "CLIPPED_NORMAL",
    "FAMILIES",
    "NORMAL",
    "BetaLaw",
    "ClippedNormalLaw",
    "Family",
    "Law",
    "Limits",
    "NormalLaw",
    "Parameters",
    "Policy",
    "PolicyConfig",
    "executed_std",
    "head_bias",
]
