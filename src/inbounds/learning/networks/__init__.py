"""The networks of S seeds side by side: what they compute, how they step, what they see."""

from inbounds.learning.networks.actor_critic import ActorCritic, NetworkConfig
from inbounds.learning.networks.adam import SeedAdam, clip_gradients
from inbounds.learning.networks.normalizer import RunningNormalizer
from inbounds.learning.networks.perceptron import (
    Mlp,
    SeedLinear,
    flatten,
    initialize_orthogonal,
    initialize_pytorch,
    mlp,
)

__all__ = [
    "ActorCritic",
    "Mlp",
    "NetworkConfig",
    "RunningNormalizer",
    "SeedAdam",
    "SeedLinear",
    "clip_gradients",
    "flatten",
    "initialize_orthogonal",
    "initialize_pytorch",
    "mlp",
]
