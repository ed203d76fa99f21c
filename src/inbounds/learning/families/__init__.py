"""Policy families: a law for what is drawn, and a map to the action. One file a family."""

from inbounds.learning.families.beta import BETA, BetaLaw, BetaParameters
from inbounds.learning.families.clipped_gaussian import CLIPPED_NORMAL, ClippedNormalLaw
from inbounds.learning.families.family import Family, Law, Limits, Parameters
from inbounds.learning.families.gaussian import NORMAL, NormalLaw, NormalParameters
from inbounds.learning.families.initial_noise import executed_std, head_bias
from inbounds.learning.families.policy import FAMILIES, Policy, PolicyConfig

__all__ = [
    "BETA",
    "CLIPPED_NORMAL",
    "FAMILIES",
    "NORMAL",
    "BetaLaw",
    "BetaParameters",
    "ClippedNormalLaw",
    "Family",
    "Law",
    "Limits",
    "NormalLaw",
    "NormalParameters",
    "Parameters",
    "Policy",
    "PolicyConfig",
    "executed_std",
    "head_bias",
]
